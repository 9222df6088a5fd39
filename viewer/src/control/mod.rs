//! Connection between a running simulation and its viewers: commands, snapshot delivery and recording playback.

mod conductor;
mod hub;
mod pace;
mod recording;
mod spring;
#[cfg(test)]
mod tests;

pub use conductor::{Conductor, Film, Play, PlayError};
pub(crate) use hub::TAKES_NONE;
pub use hub::Viewer;
pub use recording::{RecordButton, Recording, RecordingState};

use crate::stage::Shown;
use kinetoscope_sim::{EnvId, JointIndex, RobotId, SimulationManager};

/// A request of a viewer to the simulation. Commands run between two steps, on the simulation's thread.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Command {
    /// Pauses the simulation: `update` blocks until any viewer resumes it, or until all viewers that paused it are
    /// dropped.
    Pause,
    /// Resumes the simulation.
    Resume,
    /// Pauses a running simulation and resumes a paused one.
    TogglePause,
    /// Runs this many steps and pauses again. The program has to request these steps: `update(n)` still does n steps in
    /// total.
    Step(u32),
    /// Sets the speed of simulated time. The latest setting counts; when its viewer is dropped, the previous setting of
    /// another viewer applies again.
    SetSpeed(Speed),
    /// Resets one environment to its initial state; `None` resets all environments.
    Reset(Option<EnvId>),
    /// Sets the drive target of a joint in one environment; `None` sets it in all environments. The program may
    /// overwrite the target before the next step.
    SetTarget {
        /// The robot.
        robot: RobotId,
        /// The joint.
        joint: JointIndex,
        /// The environment; `None` for all.
        env: Option<EnvId>,
        /// Drive target \[rad or m\].
        value: f64,
    },
    /// Pulls a body with a spring until [`Release`](Self::Release), the next drag of the same viewer, or the drop of
    /// that viewer. The stiffness scales with the mass: a free body follows as a critically damped oscillator.
    Drag {
        /// The environment.
        env: EnvId,
        /// Index of the body in [`Names::bodies`](crate::stage::Names::bodies).
        body: usize,
        /// Attachment point of the spring, in the body frame \[m\].
        hold: [f64; 3],
        /// Target position of the spring's other end, in the environment frame \[m\].
        target: [f64; 3],
    },
    /// Ends the drag of this viewer.
    Release,
    /// Starts (`true`) or stops (`false`) the recording through the simulation's [`RecordButton`].
    Record(bool),
    /// Seeks to a time of a recording \[s\], limited to its first and last time. The last frame at or before that time
    /// is shown. Supported only while a recording [plays](Play).
    Seek(f64),
}

impl Command {
    /// True if this command makes an `earlier` queued command of the same viewer redundant.
    fn replaces(&self, earlier: &Self) -> bool {
        match (self, earlier) {
            (Self::SetTarget { robot, joint, env, .. }, Self::SetTarget { robot: r, joint: j, env: e, .. }) => {
                (robot, joint, env) == (r, j, e)
            }
            (Self::Drag { .. } | Self::Release, Self::Drag { .. })
            | (Self::SetSpeed(_), Self::SetSpeed(_))
            | (Self::Seek(_), Self::Seek(_)) => true,
            _ => false,
        }
    }
}

/// Speed of simulated time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Speed {
    /// As fast as the machine can step.
    #[default]
    Free,
    /// Simulated seconds per wall-clock second, or fewer if the machine is too slow: 1 is real time, 0.1 is slow
    /// motion.
    Times(f64),
}

impl Speed {
    /// Real time.
    pub const REAL: Self = Self::Times(1.0);
    /// Smallest and largest factor of [`Speed::Times`].
    pub const RANGE: [f64; 2] = [1e-3, 1e3];

    /// True if the factor is inside [`Self::RANGE`].
    fn is_valid(self) -> bool {
        match self {
            Self::Free => true,
            Self::Times(factor) => (Self::RANGE[0]..=Self::RANGE[1]).contains(&factor),
        }
    }
}

/// Optional snapshot contents that a viewer requests, in addition to poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wants {
    /// Maximum number of snapshots per second of wall-clock time.
    pub rate: f64,
    /// Environments whose contacts and contact forces are included. Computing them costs as much as a simulation step.
    pub contacts: Option<Shown>,
    /// Debug markers of sensors: see `debug_vis` in their configurations.
    pub markers: bool,
    /// Joint positions, targets and efforts.
    pub joints: bool,
    /// Views of camera sensors.
    pub cameras: bool,
}

impl Default for Wants {
    fn default() -> Self {
        Self { rate: 30.0, contacts: None, markers: true, joints: true, cameras: true }
    }
}

impl Wants {
    /// Requests nothing.
    pub(crate) const NOTHING: Self = Self { rate: 0.0, contacts: None, markers: false, joints: false, cameras: false };

    /// Combines the requests of two viewers.
    fn union(self, other: Self) -> Self {
        Self {
            rate: self.rate.max(other.rate),
            contacts: match (self.contacts, other.contacts) {
                (None, one) | (one, None) => one,
                (Some(one), Some(other)) => Some(if one == other { one } else { Shown::All }),
            },
            markers: self.markers || other.markers,
            joints: self.joints || other.joints,
            cameras: self.cameras || other.cameras,
        }
    }
}

/// Access of viewers to a simulation.
pub trait Viewing {
    /// Adds a viewer. Its first snapshot is available at once; further snapshots follow with the steps. All viewers of
    /// a simulation share one [`Conductor`], which the first viewer adds.
    ///
    /// The pause, speed and spring of a viewer end when the viewer is dropped. After the last viewer is dropped, the
    /// simulation runs freely and as fast as it can.
    fn viewer(&mut self, wants: Wants) -> Viewer;

    /// Sets the record button that all viewers show. A recording that the previous button was running is stopped.
    fn record_button(&mut self, button: RecordButton);
}

impl Viewing for SimulationManager {
    fn viewer(&mut self, wants: Wants) -> Viewer {
        let viewer = with_conductor(self, |conductor, sim| {
            let viewer = conductor.admit(wants);
            conductor.publish(sim);
            viewer
        });
        viewer.unwrap_or_else(Viewer::of_nothing)
    }

    fn record_button(&mut self, button: RecordButton) {
        with_conductor(self, |conductor, sim| conductor.set_button(sim, button));
    }
}

/// Calls `act` with the conductor of the simulation, which is added if missing.
fn with_conductor<T>(
    sim: &mut SimulationManager,
    act: impl FnOnce(&mut Conductor, &mut SimulationManager) -> T,
) -> Option<T> {
    let known = sim.observers().ids::<Conductor>().first().copied();
    let id = known.unwrap_or_else(|| sim.observers_mut().add(Conductor::new()));
    // The conductor is removed and added again, because `act` needs the whole simulation. No other code removes it.
    let mut conductor = sim.observers_mut().remove(id).ok()?;
    let done = act(&mut conductor, sim);
    sim.observers_mut().add(conductor);
    Some(done)
}

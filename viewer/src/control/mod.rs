//! Connection between a running simulation and its viewers: commands, snapshot delivery and recording playback.

mod hub;
mod real_time_clock;
mod recording;
mod spring;
#[cfg(test)]
mod tests;
mod view_controller;

pub(crate) use hub::NOT_STEPPING;
pub use hub::Viewer;
pub use recording::{RecordButton, RecordControl, RecordingState};
pub use view_controller::{Play, PlayError, PlaybackSource, ViewController};

use crate::scene_view::EnvSelection;
use kinetoscope_sim::{EnvId, JointIndex, RobotId, SimulationManager};
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// A request of a viewer to the simulation. Commands run between two steps, on the simulation's thread.
/// [`RunState::last_refusal`](crate::RunState::last_refusal) has the reason if a command cannot be run.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Command {
    /// Pauses the simulation: `update` blocks until any viewer resumes it, or until all viewers that paused it are
    /// dropped.
    Pause,
    /// Resumes the simulation, regardless of the viewers that paused it.
    Resume,
    /// Pauses a running simulation and resumes a paused one.
    TogglePause,
    /// Runs this many steps, then pauses; a running simulation pauses after them, too. The steps run inside the
    /// program's calls of `update`; `update(n)` does n steps in total. During playback: pauses and moves ahead by this
    /// many frames.
    Step(u32),
    /// Sets the speed of simulated time. The latest setting counts; when its viewer is dropped, the previous setting of
    /// another viewer applies again.
    SetSpeed(Speed),
    /// Resets one environment to its initial state; `None` resets all environments. During playback: returns to the
    /// first frame.
    Reset(Option<EnvId>),
    /// Sets the position target of a joint's drive. Targets are clamped to the joint limits; joints without a drive
    /// ignore them. The program may overwrite the target before the next step.
    SetTarget {
        /// The robot or articulation.
        robot: RobotId,
        /// The joint.
        joint: JointIndex,
        /// The environment; `None` for all.
        env: Option<EnvId>,
        /// Position target \[rad or m\].
        value: f64,
    },
    /// Pulls a body with a spring until [`Release`](Self::Release), the next drag of the same viewer, the drop of that
    /// viewer, or the addition of an entity to the simulation. The stiffness scales with the mass: a free body follows
    /// as a critically damped oscillator.
    Drag {
        /// The environment.
        env: EnvId,
        /// Index of the body in [`Names::bodies`](crate::scene_view::Names::bodies).
        body: usize,
        /// Attachment point of the spring, in the body frame \[m\].
        anchor: [f64; 3],
        /// Target position of the spring's other end, in the environment frame \[m\].
        target: [f64; 3],
    },
    /// Ends the drag of this viewer, if any.
    Release,
    /// Starts (`true`) or stops (`false`) the recording through the simulation's [`RecordButton`].
    Record(bool),
    /// Seeks to a time of a recording \[s\], limited to its first and last time. The last frame at or before that time
    /// is shown. Supported only while a recording [plays](Play).
    Seek(f64),
}

impl Command {
    /// True if this command makes an `earlier` queued command of the same viewer redundant.
    fn supersedes(&self, earlier: &Self) -> bool {
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Speed {
    /// As fast as the machine can step.
    #[default]
    Unlimited,
    /// Simulated seconds per wall-clock second, or fewer if the machine is too slow: 1 is real time, 0.1 is slow
    /// motion. A factor outside [`FACTOR_RANGE`](Self::FACTOR_RANGE) is refused.
    Factor(f64),
}

impl Speed {
    /// Real time.
    pub const REAL_TIME: Self = Self::Factor(1.0);
    /// Smallest and largest factor of [`Speed::Factor`].
    pub const FACTOR_RANGE: [f64; 2] = [1e-3, 1e3];

    /// True if the factor is inside [`Self::FACTOR_RANGE`].
    fn is_valid(self) -> bool {
        match self {
            Self::Unlimited => true,
            Self::Factor(factor) => (Self::FACTOR_RANGE[0]..=Self::FACTOR_RANGE[1]).contains(&factor),
        }
    }
}

/// Rate of snapshots, and their contents in addition to poses, that a viewer requests. All viewers of a simulation get
/// the same snapshots, at the highest requested rate and with all requested contents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SnapshotRequest {
    /// Number of snapshots per second of wall-clock time, clamped to 0.1 to 1000. A simulation that does not change or
    /// steps more slowly publishes fewer.
    pub rate: f64,
    /// Environments whose contacts and contact forces are included; `None` for no contacts. Computing them costs as
    /// much as a simulation step.
    pub contacts: Option<EnvSelection>,
    /// Debug markers of sensors: see `debug_vis` in their configurations.
    pub markers: bool,
    /// Joint positions, targets and efforts.
    pub joints: bool,
    /// Views of camera sensors.
    pub cameras: bool,
}

impl Default for SnapshotRequest {
    fn default() -> Self {
        Self { rate: 30.0, contacts: None, markers: true, joints: true, cameras: true }
    }
}

impl SnapshotRequest {
    /// Requests no contents besides poses, at the lowest rate.
    pub(crate) const EMPTY: Self = Self { rate: 0.0, contacts: None, markers: false, joints: false, cameras: false };

    /// Combines the requests of two viewers.
    fn union(self, other: Self) -> Self {
        Self {
            rate: self.rate.max(other.rate),
            contacts: match (self.contacts, other.contacts) {
                (None, one) | (one, None) => one,
                (Some(one), Some(other)) => Some(if one == other { one } else { EnvSelection::All }),
            },
            markers: self.markers || other.markers,
            joints: self.joints || other.joints,
            cameras: self.cameras || other.cameras,
        }
    }
}

/// Access of viewers to a simulation.
pub trait ViewerExt {
    /// Adds a viewer. Its first snapshot is available at once; further snapshots follow with the steps. All viewers of
    /// a simulation share one [`ViewController`], which the first viewer adds.
    ///
    /// The pause, speed and spring of a viewer, and a recording that it started, end when the viewer is dropped. After
    /// the last viewer is dropped, the simulation runs freely and as fast as it can.
    fn viewer(&mut self, wants: SnapshotRequest) -> Viewer;

    /// Sets the record button that all viewers show. The recording of the previous button is stopped, unless both
    /// buttons are equal.
    fn set_record_button(&mut self, button: RecordButton);

    /// Steps like [`update`](SimulationManager::update), but returns where `update` would wait for viewers: while they
    /// pause the simulation, or it is ahead of their speed. Returns the number of steps done, and the time to wait
    /// before the next call: above zero if viewers hold the next step, even after all steps. During such a wait, a call
    /// with 0 steps serves viewers.
    ///
    /// For callers that must not block, such as a program that handles signals.
    fn update_without_waiting(&mut self, steps: u32) -> (u32, Duration);
}

impl ViewerExt for SimulationManager {
    fn viewer(&mut self, wants: SnapshotRequest) -> Viewer {
        let viewer = with_view_controller(self, |controller, sim| {
            let viewer = controller.add_viewer(wants);
            controller.publish(sim);
            viewer
        });
        viewer.unwrap_or_else(Viewer::ended)
    }

    fn set_record_button(&mut self, button: RecordButton) {
        with_view_controller(self, |controller, sim| controller.set_button(sim, button));
    }

    fn update_without_waiting(&mut self, steps: u32) -> (u32, Duration) {
        if self.observers().ids::<ViewController>().is_empty() {
            self.update(steps);
            return (steps, Duration::ZERO);
        }
        let turn = |sim: &mut Self| {
            with_view_controller(sim, |controller, sim| {
                controller.set_caller_waits(true);
                controller.turn_of_caller(sim)
            })
            .unwrap_or_default()
        };
        let mut done = 0;
        let mut wait = turn(self);
        while done < steps && wait.is_zero() {
            self.update(1);
            done += 1;
            wait = turn(self);
        }
        with_view_controller(self, |controller, _| controller.set_caller_waits(false));
        (done, wait)
    }
}

/// Calls `act` with the view controller of the simulation, which is added if missing. Returns the result; `None` if the
/// controller cannot be removed for the call.
fn with_view_controller<T>(
    sim: &mut SimulationManager,
    act: impl FnOnce(&mut ViewController, &mut SimulationManager) -> T,
) -> Option<T> {
    let known = sim.observers().ids::<ViewController>().first().copied();
    let id = known.unwrap_or_else(|| sim.observers_mut().add(ViewController::new()));
    // The controller is removed and added again, because `act` needs the whole simulation. No other code removes it.
    let mut controller = sim.observers_mut().remove(id).ok()?;
    let done = act(&mut controller, sim);
    sim.observers_mut().add(controller);
    Some(done)
}

//! Between a running simulation and those who watch it: what they may do, and who does it.

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

/// What a viewer asks a simulation to do. It is done between two steps, on the simulation's thread.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Command {
    /// Hold the simulation where it is: `update` does not return until it goes on. It goes on when somebody says so, or when
    /// all who paused it are gone.
    Pause,
    /// Go on.
    Resume,
    /// Hold a simulation that runs, let go on one that is held.
    TogglePause,
    /// Do this many steps, then hold again. They are steps that the program asked for: `update(n)` still does n.
    Step(u32),
    /// How fast simulated time passes from now on, until a viewer sets another speed or this one goes: then it is what the
    /// others set last.
    SetSpeed(Speed),
    /// Put environments back to their initial state, all of them where `None`.
    Reset(Option<EnvId>),
    /// Give a joint's drive a target \[rad or m\], in all environments where `env` is `None`. The program may set another
    /// one with its next step.
    SetTarget {
        /// The robot.
        robot: RobotId,
        /// The joint.
        joint: JointIndex,
        /// The environment.
        env: Option<EnvId>,
        /// The target \[rad or m\].
        value: f64,
    },
    /// Pull at a body with a spring, until [`Release`](Self::Release), another drag by the same viewer, or its end. The
    /// spring is as strong as the body is heavy: a free body follows as a critically damped oscillator.
    Drag {
        /// The environment.
        env: EnvId,
        /// The body, as [`Names::bodies`](crate::stage::Names::bodies) numbers them.
        body: usize,
        /// Where the spring holds it, in the body's frame \[m\].
        hold: [f64; 3],
        /// Where the spring's other end is, in the environment \[m\].
        target: [f64; 3],
    },
    /// End this viewer's drag.
    Release,
    /// Begin to record, or end it, as the simulation's [`RecordButton`] says.
    Record(bool),
    /// Go to a time of what was recorded \[s\], the nearest that there is: only where a film is [played](Play).
    Seek(f64),
}

impl Command {
    /// Whether the earlier of two commands that wait has no effect where this one follows.
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

/// How fast simulated time passes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Speed {
    /// As fast as the machine can.
    #[default]
    Free,
    /// This many simulated seconds in a second, or fewer where the machine cannot: 1 is real time, 0.1 slow motion.
    Times(f64),
}

impl Speed {
    /// Real time.
    pub const REAL: Self = Self::Times(1.0);
    /// The slowest and the fastest factor.
    pub const RANGE: [f64; 2] = [1e-3, 1e3];

    /// Whether it is one that can be had.
    fn is_valid(self) -> bool {
        match self {
            Self::Free => true,
            Self::Times(factor) => (Self::RANGE[0]..=Self::RANGE[1]).contains(&factor),
        }
    }
}

/// What a viewer wants to find in snapshots, besides where everything is that can be seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wants {
    /// Snapshots per second of wall time, at most.
    pub rate: f64,
    /// Whose contacts, with forces. They are solved for the purpose: as much work as a step.
    pub contacts: Option<Shown>,
    /// What sensors show of their measurements: see `debug_vis` in their configurations.
    pub markers: bool,
    /// Positions and targets of joints.
    pub joints: bool,
    /// What camera sensors look at.
    pub cameras: bool,
}

impl Default for Wants {
    fn default() -> Self {
        Self { rate: 30.0, contacts: None, markers: true, joints: true, cameras: true }
    }
}

impl Wants {
    /// Nothing.
    pub(crate) const NOTHING: Self = Self { rate: 0.0, contacts: None, markers: false, joints: false, cameras: false };

    /// What two viewers want together.
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

/// What viewers need of a simulation.
pub trait Viewing {
    /// A new viewer of this simulation. The first snapshot is there at once; the next ones come with the steps. All viewers
    /// of a simulation have one [`Conductor`] between them, which the first brings along.
    ///
    /// What a viewer told the simulation ends with the viewer: its pause, its speed, its spring. So a simulation goes on, as
    /// fast as it can, when all are gone.
    fn viewer(&mut self, wants: Wants) -> Viewer;

    /// Gives all viewers a record button, in place of the one they had; what that one was recording ends.
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

/// Does something with the conductor of a simulation, which is made where there is none.
fn with_conductor<T>(
    sim: &mut SimulationManager,
    act: impl FnOnce(&mut Conductor, &mut SimulationManager) -> T,
) -> Option<T> {
    let known = sim.observers().ids::<Conductor>().first().copied();
    let id = known.unwrap_or_else(|| sim.observers_mut().add(Conductor::new()));
    // Taken out and put back: it reads the whole simulation. Nobody else takes it.
    let mut conductor = sim.observers_mut().remove(id).ok()?;
    let done = act(&mut conductor, sim);
    sim.observers_mut().add(conductor);
    Some(done)
}

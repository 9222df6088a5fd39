//! Why an MJCF file is no robot.

use crate::mjcf::part::PartError;
use kinetoscope_mujoco::CompileError;
use kinetoscope_scene::source::Source;

/// The other use of a file: [`add_mjcf`](crate::SimulationManager::add_mjcf).
const AS_A_PART: &str = "such a file is a scene, or a part of one";

/// Why an MJCF file is no robot.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RobotFileError {
    /// MuJoCo refuses the file; its words name element and line.
    #[error("{0}")]
    Compile(#[source] CompileError),
    /// Something of it cannot be written back.
    #[error(transparent)]
    Part(#[from] PartError),
    /// There is no body.
    #[error("the file has no body; a robot is one body in the file's world and what hangs on it")]
    NoBody,
    /// Several bodies stand in the file's world.
    #[error("the file has {} bodies in its world ({}); a robot is one and what hangs on it: give each a file, or {AS_A_PART}", .roots.len(), few(.roots))]
    SeveralRoots {
        /// Their names.
        roots: Vec<String>,
    },
    /// Nothing moves but the base.
    #[error("the file has no hinge and no slide joint, so there is nothing to drive; {AS_A_PART}")]
    NoJoint,
    /// A joint that robots do not have.
    #[error(
        "{at}: joint {joint:?} is a ball; robots have hinges and slides, and a free joint of the root body: write three hinges, or {AS_A_PART}"
    )]
    BallJoint {
        /// Where it is.
        at: Source,
        /// Its name.
        joint: String,
    },
    /// A body that is moved by hand.
    #[error("{at}: body {body:?} is a mocap body, which no joint moves; {AS_A_PART}")]
    MocapBody {
        /// Where it is.
        at: Source,
        /// Its name.
        body: String,
    },
    /// The base shall be free, and is held by a joint.
    #[error(
        "{at}: joint {joint:?} holds the root body {body:?} in the world, so the base cannot be free; set fix_base: true, or move the joint to a body below"
    )]
    BaseIsJointed {
        /// Where the joint is.
        at: Source,
        /// The joint.
        joint: String,
        /// The body.
        body: String,
    },
    /// An actuator that no drive stands for.
    #[error(
        "{at}: actuator {actuator:?} acts on {target}; the drives of a robot act on hinges and slides: leave it out, or {AS_A_PART}"
    )]
    Actuator {
        /// Where it is.
        at: Source,
        /// Its name.
        actuator: String,
        /// What it acts on.
        target: String,
    },
    /// Something of the robot needs what is left out.
    #[error(
        "{at}: {element} {name:?} needs {needs:?} in the file's world, which a robot leaves out: put it into a body, or {AS_A_PART}"
    )]
    NeedsWorld {
        /// Where it is.
        at: Source,
        /// The kind of element.
        element: &'static str,
        /// Its name.
        name: String,
        /// What it needs.
        needs: String,
    },
}

/// The first of some names, and how many more there are.
fn few(names: &[String]) -> String {
    const SHOWN: usize = 5;
    let first = names[..names.len().min(SHOWN)].join(", ");
    match names.len().saturating_sub(SHOWN) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}

//! Errors of MJCF files that cannot be loaded as robots.

use crate::mjcf::part::PartError;
use kinetoscope_mujoco::CompileError;
use kinetoscope_scene::source_location::SourceLocation;

/// Advice on another use of a file: [`add_mjcf`](crate::SimulationManager::add_mjcf).
const AS_A_PART: &str = "such a file is a scene, or a part of one";

/// Error of loading an MJCF file as a robot.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RobotFileError {
    /// MuJoCo rejects the file; its message names element and line.
    #[error("{0}")]
    Compile(#[source] CompileError),
    /// A part cannot represent an element of the file.
    #[error(transparent)]
    Part(#[from] PartError),
    /// The file has no body.
    #[error("the file has no body; a robot is one body in the file's world and what hangs on it")]
    NoBody,
    /// The file's world has several child bodies.
    #[error("the file has {} bodies in its world ({}); a robot is one and what hangs on it: give each a file, or {AS_A_PART}", .roots.len(), format_first(.roots))]
    MultipleRoots {
        /// Names of these bodies.
        roots: Vec<String>,
    },
    /// The file has no hinge and no slide joint.
    #[error("the file has no hinge and no slide joint, so there is nothing to drive; {AS_A_PART}")]
    NoJoint,
    /// A joint is a ball joint, which robots do not support.
    #[error(
        "{at}: joint {joint:?} is a ball; robots have hinges and slides, and a free joint of the root body: write three hinges, or {AS_A_PART}"
    )]
    BallJoint {
        /// Location of the joint.
        at: SourceLocation,
        /// Name of the joint.
        joint: String,
    },
    /// A body is a mocap body.
    #[error("{at}: body {body:?} is a mocap body, which no joint moves; {AS_A_PART}")]
    MocapBody {
        /// Location of the body.
        at: SourceLocation,
        /// Name of the body.
        body: String,
    },
    /// The base is configured as free, but a joint attaches the root body to the world.
    #[error(
        "{at}: joint {joint:?} holds the root body {body:?} in the world, so the base cannot be free; set fix_base: true, or move the joint to a body below"
    )]
    BaseNotFree {
        /// Location of the joint.
        at: SourceLocation,
        /// Name of the joint.
        joint: String,
        /// Name of the body.
        body: String,
    },
    /// An actuator acts on a target that drives do not support.
    #[error(
        "{at}: actuator {actuator:?} acts on {target}; the drives of a robot act on hinges and slides: leave it out, or {AS_A_PART}"
    )]
    Actuator {
        /// Location of the actuator.
        at: SourceLocation,
        /// Name of the actuator.
        actuator: String,
        /// Description of the target.
        target: String,
    },
    /// An element of the robot depends on an element of the file's world, which a robot leaves out.
    #[error(
        "{at}: {element} {name:?} needs {needs:?} in the file's world, which a robot leaves out: put it into a body, or {AS_A_PART}"
    )]
    NeedsWorld {
        /// Location of the element.
        at: SourceLocation,
        /// Kind of the element, as in MJCF.
        element: &'static str,
        /// Name of the element.
        name: String,
        /// Name of the element that it depends on.
        needs: String,
    },
}

/// Lists the first names and the number of further ones.
fn format_first(names: &[String]) -> String {
    const SHOWN: usize = 5;
    let first = names[..names.len().min(SHOWN)].join(", ");
    match names.len().saturating_sub(SHOWN) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}

//! Errors of MJCF files that cannot be loaded as robots.

use crate::mjcf::part::PartError;
use kinetoscope_mujoco::CompileError;
use kinetoscope_scene::source_location::SourceLocation;

/// Advice on another use of a file: [`add_mjcf`](crate::SimulationManager::add_mjcf).
const AS_A_PART: &str = "add the file with add_mjcf (entity type mjcf) instead";

/// Error of loading an MJCF file as a robot.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RobotFileError {
    /// MuJoCo rejects the file; its message names element and line.
    #[error("{0}")]
    Compile(#[source] CompileError),
    /// The file has an element that cannot be attached to a scene.
    #[error(transparent)]
    Part(#[from] PartError),
    /// The file has no body.
    #[error("the file has no body; a robot file has exactly one top-level body, in <worldbody>")]
    NoBody,
    /// The file's world has several child bodies.
    #[error("the file has {} top-level bodies ({}), but a robot has exactly one; split the file, or {AS_A_PART}", .roots.len(), format_first(.roots))]
    MultipleRoots {
        /// Names of these bodies, in quotes.
        roots: Vec<String>,
    },
    /// The file has no hinge and no slide joint.
    #[error("the file has no hinge or slide joint, so a robot would have no drives; {AS_A_PART}")]
    NoJoint,
    /// A joint is a ball joint, which robots do not support.
    #[error(
        "{at}: joint {joint:?} is a ball joint; a robot supports hinge and slide joints, and a free joint of the root \
         body: replace it by three hinges, or {AS_A_PART}"
    )]
    BallJoint {
        /// Location of the joint.
        at: SourceLocation,
        /// Name of the joint.
        joint: String,
    },
    /// A body is a mocap body.
    #[error("{at}: body {body:?} is a mocap body, which a robot does not support; {AS_A_PART}")]
    MocapBody {
        /// Location of the body.
        at: SourceLocation,
        /// Name of the body.
        body: String,
    },
    /// The base is configured as free, but a hinge or slide attaches the root body to the world.
    #[error(
        "{at}: joint {joint:?} connects the root body {body:?} to the world, so the base cannot be free; set fix_base: \
         true, or move the joint to a child body"
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
        "{at}: actuator {actuator:?} acts on {target}, but robot drives act on hinge and slide joints only; remove it, \
         or {AS_A_PART}"
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
        "{at}: {element} {name:?} refers to {needs:?} of <worldbody>, which a robot does not import; move it into a \
         body, or {AS_A_PART}"
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

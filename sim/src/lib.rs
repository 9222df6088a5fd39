//! URDF to MJCF to batched MuJoCo.

pub mod batch;
pub mod description;
pub mod diagnostic;
pub mod drive;
pub mod dynamics;
pub mod env;
pub mod inertia;
#[allow(unsafe_code, reason = "the wall to MuJoCo")]
pub mod mj;
pub mod mjcf;
pub mod pattern;
pub mod source;
pub mod urdf;

pub use description::RobotDescription;
pub use diagnostic::{Diagnostic, DiagnosticKind};
pub use inertia::{InertiaFault, RigidInertia};
pub use source::Source;

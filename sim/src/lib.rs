//! URDF to MJCF to batched MuJoCo.

pub mod description;
pub mod diagnostic;
#[allow(unsafe_code, reason = "the wall to MuJoCo")]
pub mod mj;
pub mod source;

pub use description::RobotDescription;
pub use diagnostic::{Diagnostic, DiagnosticKind};
pub use source::Source;

//! URDF to MJCF to batched MuJoCo.

pub mod description;
pub mod diagnostic;
pub mod pattern;
pub mod source;
pub mod urdf;

pub use description::RobotDescription;
pub use diagnostic::{Diagnostic, DiagnosticKind};
pub use source::Source;

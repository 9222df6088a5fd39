//! Kinetoscope: robots from URDF, thousands of MuJoCo environments, on any CPU.
#![forbid(unsafe_code)]

pub use scene;
pub use sensors;
pub use sim;

//! Two cameras on one rig, and what only a pair can measure.

mod cfg;
mod disparity;
mod sensor;

pub use cfg::{StereoCameraCfg, StereoOrigin};
pub use sensor::StereoCamera;

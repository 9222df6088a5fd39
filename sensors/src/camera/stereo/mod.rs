//! Two cameras on one rig, and what only a pair can measure.

mod cfg;
mod disparity;
mod infos;
mod rectify;
mod sensor;

pub use cfg::{StereoCameraCfg, StereoOrigin};
pub use rectify::Rectification;
pub use sensor::StereoCamera;

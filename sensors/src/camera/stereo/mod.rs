//! Stereo cameras: two cameras on one rig, with disparity, rectification and ROS calibrations.

mod cfg;
mod disparity;
mod infos;
mod rectify;
mod sensor;

pub use cfg::{StereoCameraCfg, StereoOrigin};
pub use rectify::Rectification;
pub use sensor::StereoCamera;

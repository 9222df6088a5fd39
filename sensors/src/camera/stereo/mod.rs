//! Stereo cameras: two cameras on one rig, with disparity, rectification and ROS calibrations.

mod camera_info;
mod cfg;
mod disparity;
mod rectify;
mod sensor;

pub use cfg::{StereoCameraCfg, StereoOrigin};
pub use rectify::Rectification;
pub use sensor::StereoCamera;

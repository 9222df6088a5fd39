//! Cameras: sensor, configuration, frame buffer, imperfections, calibration, segmentation, bounding boxes and stereo.

mod accessors;
mod boxes;
mod build;
mod calibration;
mod cfg;
pub mod colormap;
mod delivered;
pub(crate) mod env_rows;
mod error;
mod extrinsics;
mod frame_buffer;
pub(crate) mod frustum;
mod image_noise;
pub mod imperfection;
mod motion;
mod noise_model;
pub(crate) mod placement;
pub(crate) mod point_cloud;
mod segmentation;
mod sensor;
mod stereo;
mod summary;
pub(crate) mod viewpoints;

#[cfg(test)]
mod tests;

pub use boxes::{Box2d, Box3d, Occlusion, PixelBox};
pub use calibration::{CalibrationError, CameraInfo, DistortionModel};
pub use cfg::{CameraCfg, DepthMiss};
pub use delivered::HistoryView;
pub use error::CameraError;
pub use extrinsics::{CameraConvention, Extrinsics, Placement, Poses, look_at_pose};
pub use imperfection::Imperfections;
pub use placement::CameraPlacement;
pub use point_cloud::PointFrame;
pub use segmentation::{Segment, SegmentLevel, Segmentation, SegmentationCfg, SegmentedEntity, segment_color};
pub use sensor::Camera;
pub use stereo::{Rectification, StereoCamera, StereoCameraCfg, StereoOrigin};

//! Cameras: the sensor, its configuration, channels, frames and the rasterizer that fills them.

pub mod aperture;
mod arrived;
pub mod boxes;
pub mod calibration;
mod captures;
pub mod cfg;
pub mod channel;
pub mod colormap;
mod earlier;
pub mod error;
mod exposure;
pub mod extrinsics;
mod faults;
pub(crate) mod frustum;
pub mod imperfection;
pub mod intrinsics;
pub mod lens;
mod memory;
pub(crate) mod mounts;
mod opening;
pub mod parallel;
mod past;
mod picture_noise;
pub mod point_cloud;
mod progress;
pub mod rasterizer;
pub mod renderer;
mod rolling;
pub mod segmentation;
pub mod sensor;
pub mod shutter;
pub mod stereo;
pub(crate) mod ticket;

#[cfg(test)]
mod tests;

pub use aperture::Aperture;
pub use boxes::{Box2d, Box3d, Occlusion, PixelBox};
pub use calibration::{CalibrationError, CameraInfo, DistortionModel};
pub use cfg::{CameraCfg, DepthMiss};
pub use channel::{Channel, Channels, Frame, FrameMut, Pictures};
pub use error::CameraError;
pub use extrinsics::{CameraConvention, Extrinsics, Placement, Poses, look_at_pose};
pub use imperfection::Imperfections;
pub use intrinsics::{Intrinsics, PixelIntrinsics};
pub use lens::{Lens, LensModel, LensRays, Optics};
pub use parallel::ParallelRasterizer;
pub use past::HistoryView;
pub use point_cloud::PointFrame;
pub use progress::RenderProgress;
pub use rasterizer::{Before, RasterCfg, Rasterizer, Shot};
pub use renderer::Renderer;
pub use segmentation::{Segment, SegmentLevel, Segmentation, SegmentationCfg, Thing, segment_color};
pub use sensor::Camera;
pub use shutter::{Opened, Shutter, Take};
pub use stereo::{StereoCamera, StereoCameraCfg, StereoOrigin};

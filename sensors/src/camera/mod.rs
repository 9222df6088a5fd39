//! Cameras: the sensor, its configuration, channels, frames and the rasterizer that fills them.

mod accessors;
mod arrivals;
pub mod boxes;
mod build;
pub mod calibration;
pub mod cfg;
pub mod colormap;
pub(crate) mod env_rows;
pub mod error;
pub mod extrinsics;
mod faults;
mod frame_buffer;
pub(crate) mod frustum;
pub mod imperfection;
mod motion;
mod picture_noise;
pub(crate) mod placement;
pub mod point_cloud;
pub mod segmentation;
pub mod sensor;
pub mod stereo;
mod summary;
pub(crate) mod viewpoints;

#[cfg(test)]
mod tests;

pub use arrivals::HistoryView;
pub use boxes::{Box2d, Box3d, Occlusion, PixelBox};
pub use calibration::{CalibrationError, CameraInfo, DistortionModel};
pub use cfg::{CameraCfg, DepthMiss};
pub use error::CameraError;
pub use extrinsics::{CameraConvention, Extrinsics, Placement, Poses, look_at_pose};
pub use imperfection::Imperfections;
pub use kinetoscope_render::aperture::Aperture;
pub use kinetoscope_render::frame::{Channel, Channels, Frame, FrameMut, Pictures};
pub use kinetoscope_render::intrinsics::{Intrinsics, PixelIntrinsics};
pub use kinetoscope_render::lens::{Lens, LensModel, LensRays, Optics};
pub use kinetoscope_render::optics_error::OpticsError;
pub use kinetoscope_render::parallel::ParallelRasterizer;
pub use kinetoscope_render::progress::RenderProgress;
pub use kinetoscope_render::rasterizer::Rasterizer;
pub use kinetoscope_render::renderer::Renderer;
pub use kinetoscope_render::request::{Before, RasterCfg, Shot};
pub use kinetoscope_render::shade::tone::ToneCurve;
pub use kinetoscope_render::shutter::{Opened, Shutter, Take};
pub use placement::CameraPlacement;
pub use point_cloud::PointFrame;
pub use segmentation::{Segment, SegmentLevel, Segmentation, SegmentationCfg, Thing, segment_color};
pub use sensor::Camera;
pub use stereo::{Rectification, StereoCamera, StereoCameraCfg, StereoOrigin};

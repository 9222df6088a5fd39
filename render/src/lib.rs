//! A renderer for CPUs: depth, masks, normals and color of a [`RenderScene`](kinetoscope_scene::RenderScene), by a
//! rasterizer, a ray tracer or a path tracer; and exact distances along rays.
//!
//! ```text
//! Shot (scene, poses, view) -> shade::plan -> raster | trace -> shade::group -> frame
//!       request                preparation     visibility       light            channels
//! ```
//!
//! | module | content |
//! |---|---|
//! | `rasterizer`, `parallel` | one frame, and many on several threads |
//! | `request` | the scene, the view and the settings of a frame |
//! | [`frame`] | channels (color, depth, ...), one file each, and their images |
//! | `renderer`, `aperture`, `shutter`, `progress` | settings of a frame |
//! | [`lens`], `intrinsics` | from pixels to rays |
//! | `visibility` | views and the surface at each pixel; `raster` finds it by triangles, `trace` by rays |
//! | `shade` | light: from what is seen to channels; `path` is the path tracer |
//! | [`geometry`] | rays, triangles, shapes, bounding volume hierarchies |
//! | `simd` | lanes, chosen at run time |
#![forbid(unsafe_code)]

mod aperture;
mod exposure;
pub mod frame;
pub mod geometry;
mod intrinsics;
pub mod lens;
mod optics_error;
mod parallel;
mod path;
mod progress;
mod raster;
mod rasterizer;
mod renderer;
mod request;
mod rolling;
mod shade;
mod shutter;
mod simd;
mod ticket;
mod trace;
mod visibility;

#[cfg(test)]
mod tests;

pub use aperture::Aperture;
pub use intrinsics::{Intrinsics, PixelIntrinsics};
pub use optics_error::OpticsError;
pub use parallel::Job;
pub use parallel::ParallelRasterizer;
pub use path::film::Film;
pub use progress::RenderProgress;
pub use raster::Layer;
pub use rasterizer::Rasterizer;
pub use renderer::Renderer;
pub use request::{Before, RasterCfg, Shot};
pub use shade::plan::{check_light, check_occlusion};
pub use shade::tone::ToneCurve;
pub use shutter::{Opened, Shutter, Take};
pub use ticket::{Stream, Ticket};
pub use visibility::{RenderError, View};

//! A CPU renderer, and exact ray casting. Renders depth, segmentation masks, normals and color of a
//! [`RenderScene`](kinetoscope_scene::RenderScene) by a rasterizer, a ray tracer or a path tracer.
//!
//! A render request (scene, poses, view) is prepared once per frame, then passes through these stages:
//!
//! ```text
//! request -> shade::prepared_frame -> raster | trace -> shade::group -> frame
//!            preparation              visibility        shading         channels
//! ```
//!
//! | module | content |
//! |---|---|
//! | `image_renderer`, `parallel_renderer` | one frame, and many frames on several threads |
//! | `request` | scene, view and options of a frame |
//! | [`frame`] | image channels (color, depth, ...), one file each, and their buffers |
//! | `renderer`, `aperture`, `shutter`, `progress` | choice of the renderer, depth of field, motion blur, progress |
//! | [`lens`], `intrinsics` | mapping from pixels to rays |
//! | `visibility` | views, and the surface at each pixel: `raster` finds it by triangles, `trace` by rays |
//! | `shade` | shading: from visible surfaces to channels |
//! | `path`, `path_frame`, `rolling_shutter` | path tracing, its frames, and rolling shutter of all other channels |
//! | [`geometry`] | rays, triangles, shapes, bounding volume hierarchies |
//! | `rng_key` | counter-based random numbers of sensor noise |
//! | `simd` | SIMD lanes, instruction set selected at run time |
//! | `optics_error` | errors of lenses and intrinsics |
//!
//! A red ball, seen from 2 m away:
//!
//! ```
//! use kinetoscope_render::frame::{Channels, Frame};
//! use kinetoscope_render::{RasterCfg, ImageRenderer, View};
//! use kinetoscope_scene::shape::Sphere;
//! use kinetoscope_scene::{Instance, Material, PoseF32, RenderScene};
//!
//! let red = Material::from_rgba([0.8, 0.1, 0.1, 1.0]);
//! let scene = RenderScene::new(vec![Instance::new(Sphere { radius: 0.5 }, red, 1)])?;
//! let view = View::look_at([64, 48], 0.8, [2.0, 0.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0])?;
//! let mut frame = Frame::new(64, 48, Channels { depth: true, mask: true, ..Channels::NONE });
//! ImageRenderer::new(RasterCfg::default()).render(&scene, &[PoseF32::IDENTITY], &view, &mut frame)?;
//!
//! let (depth, mask) = (frame.depth.ok_or("no depth")?, frame.mask.ok_or("no mask")?);
//! let center = 24 * 64 + 32;
//! assert_eq!(mask[center], 1);
//! assert!((depth[center] - 1.5).abs() < 1e-2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod aperture;
pub mod frame;
pub mod geometry;
mod image_renderer;
mod intrinsics;
pub mod lens;
mod optics_error;
mod parallel_renderer;
mod path;
mod path_frame;
mod progress;
mod raster;
mod renderer;
mod request;
mod rng_key;
mod rolling_shutter;
mod shade;
mod shutter;
mod simd;
mod trace;
mod visibility;

#[cfg(test)]
mod tests;

pub use aperture::Aperture;
pub use image_renderer::ImageRenderer;
pub use intrinsics::{Intrinsics, PixelIntrinsics};
pub use optics_error::OpticsError;
pub use parallel_renderer::ParallelRenderer;
pub use parallel_renderer::RenderJob;
pub use path::accumulator::Accumulator;
pub use progress::RenderProgress;
pub use raster::Layer;
pub use renderer::Renderer;
pub use request::{PreviousState, RasterCfg, RenderRequest};
pub use rng_key::{RngKey, RngStream};
pub use shade::prepared_frame::{check_exposure_optics, check_occlusion};
pub use shade::tone::ToneCurve;
pub use shutter::{FrameSample, Shutter, ShutterOpenState};
pub use visibility::{RenderError, View};

//! A renderer for CPUs: depth, masks, normals and colour of a [`RenderScene`](kinetoscope_scene::RenderScene), by a
//! rasterizer, a ray tracer or a path tracer; and exact distances along rays.
//!
//! ```text
//! Shot (scene, poses, view) -> shade::plan -> raster | trace -> shade::group -> frame
//!       request                preparation     visibility       light            channels
//! ```
//!
//! | module | content |
//! |---|---|
//! | [`rasterizer`], [`parallel`] | one frame, and many on several threads |
//! | [`request`] | the scene, the view and the settings of a frame |
//! | [`frame`] | channels (colour, depth, ...), one file each, and their images |
//! | [`renderer`], [`aperture`], [`shutter`], [`progress`] | settings of a frame |
//! | [`lens`], [`intrinsics`] | from pixels to rays |
//! | [`visibility`] | views and the surface at each pixel; [`raster`] finds it by triangles, `trace` by rays |
//! | [`shade`] | light: from what is seen to channels; [`path`] is the path tracer |
//! | [`geometry`] | rays, triangles, shapes, bounding volume hierarchies |
//! | `simd` | lanes, chosen at run time |
#![forbid(unsafe_code)]

pub mod aperture;
mod exposure;
pub mod frame;
pub mod geometry;
pub mod intrinsics;
pub mod lens;
pub mod optics_error;
pub mod parallel;
pub mod path;
pub mod progress;
pub mod raster;
pub mod rasterizer;
pub mod renderer;
pub mod request;
mod rolling;
pub mod shade;
pub mod shutter;
mod simd;
pub mod ticket;
mod trace;
pub mod visibility;

#[cfg(test)]
mod tests;

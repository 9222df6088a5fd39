//! Exact distances along rays to what is in a scene, for ray casters, ray tracing and cameras made of rays.
//!
//! Geometry is in double precision: a distance of 20 m is right to far less than a micrometer, up to the single precision
//! sizes of shapes. [`world::RayTargets`] is what can be hit, prepared once; [`world::RayWorld`] is where it is in one environment.
//!
//! Rays are cast in packets of eight, a lane for each. A shape says what one ray touches; a shape that can do better for rays
//! that run side by side does so by the same operations in the same order, so that a hit never depends on which other rays
//! are cast with it, on the order of the rays or on the instruction set. Meshes have lists of what steep rays may meet
//! (`shape/mesh/columns`); for others they walk their tree once for a packet (`bvh/beam`) and test triangles in all lanes;
//! height fields look at the first cells in all lanes. Rays that run apart are cast one by one.

pub(crate) mod assets;
pub(crate) mod bvh;
pub(crate) mod corner;
pub mod packet;
pub(crate) mod shape;
pub(crate) mod triangle;
pub(crate) mod world;

pub use assets::{Assets, RayAssets};
pub use world::{FixedWorld, RayHit, RayTargets, RayWorld};

#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) use tests::Dice;

//! Exact ray casting against the shapes of a scene, for ray casters, ray tracing and cameras made of rays.
//!
//! Geometry is in double precision: a distance of 20 m is right to far less than a micrometer, up to the single
//! precision sizes of shapes. [`RayTargets`] holds the targets, prepared once; [`RayWorld`] holds their poses in one
//! environment.
//!
//! Rays are cast in packets of eight, one per lane. A shape intersects one ray at a time. A shape that can do better
//! for nearly parallel rays uses the same operations in the same order. So a hit never depends on the other rays of the
//! packet, on the order of the rays or on the instruction set.
//!
//! Meshes have lists of the triangles that steep rays may meet (`shape/mesh/columns`). For other rays they traverse
//! their BVH once per packet (`bvh/beam`) and test triangles in all lanes. Height fields test their first cells in all
//! lanes. Diverging rays are cast one by one.

pub(crate) mod assets;
pub(crate) mod bvh;
pub(crate) mod interpolation;
pub mod packet;
pub(crate) mod shape;
pub(crate) mod triangle;
pub(crate) mod world;

pub use assets::{AssetCache, RayAssetCache};
pub use world::{FixedTargets, RayHit, RayTargets, RayWorld};

#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) use tests::TestRng;

//! Ray-caster cameras: depth, distances, normals and masks of chosen targets, computed in double precision.

mod cfg;
mod pictures;
mod pixels;
mod points;
mod sensor;

pub use cfg::RayCasterCameraCfg;
pub use pictures::RayImages;
pub use sensor::RayCasterCamera;

#[cfg(test)]
mod tests;

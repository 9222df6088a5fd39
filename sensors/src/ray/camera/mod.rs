//! Ray-caster cameras: depth, distances, normals and masks of chosen targets, computed in double precision.

mod cfg;
mod images;
mod pixels;
mod points;
mod sensor;

pub use cfg::RayCasterCameraCfg;
pub use images::RayImages;
pub use sensor::RayCasterCamera;

#[cfg(test)]
mod tests;

//! Cameras made of rays: depth, distances, normals and masks in double precision, of chosen targets.

mod cfg;
mod pixels;
mod placing;
mod points;
mod sensor;

pub use cfg::RayCasterCameraCfg;
pub use sensor::RayCasterCamera;

#[cfg(test)]
mod tests;

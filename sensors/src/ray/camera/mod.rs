//! Cameras made of rays: depth, distances, normals and masks in double precision, of chosen targets.

mod cfg;
mod pictures;
mod pixels;
mod points;
mod sensor;

pub use cfg::RayCasterCameraCfg;
pub use pictures::RayPictures;
pub use sensor::RayCasterCamera;

#[cfg(test)]
mod tests;

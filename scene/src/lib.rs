//! Plain data that both the simulation and the sensors agree on: poses, meshes, materials, shapes.
//!
//! Nothing here knows of MuJoCo or of time. Units are SI, angles radians, quaternions w, x, y, z.
#![forbid(unsafe_code)]

pub mod mesh;
pub mod pose;

pub use pose::Pose;

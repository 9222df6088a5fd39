//! Plain data that both the simulation and the sensors agree on: poses, meshes, materials, shapes.
//!
//! Nothing here knows of MuJoCo. Units are SI, angles radians, quaternions w, x, y, z.
#![forbid(unsafe_code)]

pub mod mesh;
pub mod pose;
pub mod state;

pub use pose::Pose;
pub use state::SceneState;

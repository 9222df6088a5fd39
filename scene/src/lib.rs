//! Plain data that both the simulation and the sensors agree on: poses, meshes, materials, shapes, random numbers.
//!
//! Nothing here knows of MuJoCo. Units are SI, angles radians, quaternions w, x, y, z.
#![forbid(unsafe_code)]

pub mod atomic_file;
pub mod basis;
pub mod file_format;
pub mod framing;
pub mod light;
pub mod marker;
pub mod material;
pub mod mesh;
pub mod pattern;
pub mod pose;
pub mod pose_f32;
pub mod pose_f64;
mod quantities;
pub mod random;
pub mod ray;
pub mod render_scene;
pub mod requires;
pub mod sampling;
pub mod shape;
pub mod source;
pub mod state;
pub mod terrain;
pub mod vector;
pub mod yaml;

pub use atomic_file::AtomicFile;
pub use light::{Haze, Headlight, Hemisphere, HorizonHaze, Light, LightKind, LightSum, Sky};
pub use marker::{Marker, MarkerKind};
pub use material::{Material, Texture, TextureKind};
pub use pose::Pose;
pub use pose_f32::PoseF32;
pub use pose_f64::PoseF64;
pub use random::Random;
pub use ray::Ray;
pub use render_scene::{Instance, RenderScene, RenderSceneError};
pub use requires::Requires;
pub use shape::{RenderMesh, Shape};
pub use state::{Lengths, OwnScene, SceneState, VisibleState};

//! Plain data that both the simulation and the sensors agree on: poses, meshes, materials, shapes, random numbers.
//!
//! Nothing here knows of MuJoCo. Units are SI, angles radians, quaternions w, x, y, z.
#![forbid(unsafe_code)]

mod atomic_file;
pub mod basis;
pub mod file_format;
pub mod framing;
mod light;
mod marker;
mod material;
pub mod mesh;
pub mod pattern;
pub mod pose;
mod pose_f32;
mod pose_f64;
mod quantities;
mod random;
mod ray;
mod render_scene;
mod requires;
pub mod sampling;
pub mod shape;
pub mod source;
mod state;
pub mod terrain;
pub mod vector;
pub mod yaml;

pub use atomic_file::AtomicFile;
pub use light::{Haze, Headlight, Hemisphere, HorizonHaze, Light, LightKind, LightSum, Sky};
pub use marker::{Marker, MarkerKind};
pub use material::{Level, Material, Texture, TextureKind, decode_srgb};
pub use pose::Pose;
pub use pose_f32::PoseF32;
pub use pose_f64::PoseF64;
pub use random::{Philox, Random};
pub use ray::Ray;
pub use render_scene::{Instance, RenderScene, RenderSceneError};
pub use requires::Requires;
pub use state::{Contact, Contacts, Lengths, OwnScene, SceneState, VisibleState};

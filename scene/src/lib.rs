//! Plain data shared by simulation, renderer and sensors: poses, shapes, meshes, materials, lights, random numbers.
//!
//! This crate is independent of MuJoCo. Units are SI, angles are in radians, and quaternions are ordered w, x, y, z.
//!
//! | item | content |
//! |---|---|
//! | [`Pose`], [`PoseF64`], [`PoseF32`], [`pose`], [`vector`], [`basis`] | poses, vectors and bases |
//! | [`shape`], [`mesh`], [`terrain`] | shapes, mesh files and their convex decomposition, generated terrain |
//! | [`RenderScene`], [`Instance`], [`Material`], [`Texture`], [`Light`], [`Sky`], [`Marker`] | a scene to render |
//! | [`SceneState`], [`VisibleState`], [`Contacts`], [`StateFields`] | state of all environments at one time |
//! | [`KeyedRng`], [`Philox`], [`sampling`] | random numbers and sample warping |
//! | [`Ray`], [`camera_fit`] | rays, and camera placement around a scene |
//! | [`npy`] | NumPy array files |
//! | [`file_format`], [`yaml`], [`pattern`], [`source_location`] | configuration files and name patterns |
//! | [`input_file`], [`AtomicFile`] | reading of files with a bound, complete writing of files |
//!
//! ```
//! use kinetoscope_scene::shape::Sphere;
//! use kinetoscope_scene::{Instance, Material, RenderScene};
//!
//! let ball = Instance::new(Sphere { radius: 0.5 }, Material::default(), 1);
//! let scene = RenderScene::new(vec![ball])?;
//! assert_eq!(scene.instances().len(), 1);
//! # Ok::<(), kinetoscope_scene::RenderSceneError>(())
//! ```
#![forbid(unsafe_code)]

mod atomic_file;
pub mod basis;
pub mod camera_fit;
pub mod file_format;
pub mod input_file;
mod light;
mod marker;
mod material;
pub mod mesh;
pub mod npy;
pub mod pattern;
mod polygons;
pub mod pose;
mod pose_f32;
mod pose_f64;
mod quantities;
mod random;
mod ray;
mod render_scene;
pub mod sampling;
pub mod shape;
pub mod source_location;
mod state;
mod state_fields;
pub mod terrain;
pub mod vector;
pub mod yaml;

pub use atomic_file::AtomicFile;
pub use light::{Haze, Headlight, Hemisphere, HorizonHaze, Light, LightKind, LightingSpace, OpenGlRules, Sky};
pub use marker::{Marker, MarkerKind};
pub use material::{Material, MipLevel, Texture, TextureKind, decode_srgb};
pub use polygons::{PlaneLines, Tessellation};
pub use pose::Pose;
pub use pose_f32::PoseF32;
pub use pose_f64::PoseF64;
pub use random::{KeyedRng, Philox};
pub use ray::Ray;
pub use render_scene::{Instance, RenderScene, RenderSceneError};
pub use state::{Contact, Contacts, EnvScene, SceneState, StateDims, VisibleState};
pub use state_fields::StateFields;

//! Appearance of MuJoCo models: from plain slices of meshes, textures, materials and lights to shapes, materials and
//! lights of a [`RenderScene`](kinetoscope_scene::RenderScene).
//!
//! This crate does not know MuJoCo's library. A [`VisualModel`] supplies the slices: a compiled model of the crate
//! `kinetoscope-mujoco`, or arrays of Python's `mujoco` package.
//!
//! | module | content |
//! |---|---|
//! | `arrays`, `visual_model` | plain slices and numbers of a model, and the trait of their source |
//! | `geom_type`, `geom` | types and shapes of geoms |
//! | `surface` | materials and textures |
//! | `lighting` | lights, headlight, haze |
//! | [`mjv`] | scenes of MuJoCo's visualizer, read from their memory |
#![forbid(unsafe_code)]

mod arrays;
mod geom;
mod geom_type;
mod lighting;
pub mod mjv;
mod surface;
mod visual_model;

pub use arrays::{
    HeadlightValues, HeightFieldArrays, LightType, LightValues, MaterialValues, MeshArrays, TextureArrays, TextureType,
};
pub use geom::{GeomShapes, shape_from_size};
pub use geom_type::GeomType;
pub use lighting::{horizon_haze, linear_light, scene_headlight, scene_light};
pub use surface::{ModelMaterials, element_color, first_skybox, skybox};
pub use visual_model::VisualModel;

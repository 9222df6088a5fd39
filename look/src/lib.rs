//! Appearance of MuJoCo models: plain slices of their meshes, textures, materials and lights.
//!
//! This crate does not know MuJoCo's library. The crate `kinetoscope-mujoco` fills these types from a compiled model.
#![forbid(unsafe_code)]

mod arrays;

pub use arrays::{
    HeadlightValues, HeightFieldArrays, LightType, LightValues, MaterialValues, MeshArrays, TextureArrays, TextureType,
};

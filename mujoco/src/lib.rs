//! Safe MuJoCo: owned models and data with bounds-checked slices, for MuJoCo 2.2.2 and 4.x.
//!
//! This is the only crate that depends on the MuJoCo version, and holds all hand-written unsafe code for MuJoCo. It
//! guarantees:
//!
//! * No input makes MuJoCo end the process: its error handler unwinds to `guard`, which returns an [`EngineError`].
//!   MuJoCo writes no log file and no warnings. (The hull library inside 2.2.2 prints to stderr for a flat mesh; the
//!   MJCF writer passes it no flat mesh.)
//! * A model never changes while it is shared. [`Data`] keeps its model alive.
//! * A slice has the length that MuJoCo's own `mjxmacro.h` declares (`mujoco_sys::fields`).
//!
//! Names are MuJoCo's own (`qpos`, `geom`, `efc_aref`).
//!
//! | files | content |
//! |---|---|
//! | `compile`, `plugins` | compilation of MJCF text and files with their assets |
//! | `model`, `arrays`, `version_counts`, `options`, `name`, `weld`, `raw` | [`Model`]: sizes, arrays, options, names |
//! | `visual`, `skin_flex` | meshes, textures, materials, lights, skins and flexes |
//! | `data`, `state`, `ray`, `jacobian`, `prefetch` | [`Data`]: state, steps, contacts, rays, Jacobians |
//! | `editor`, `patch` | [`ModelEditor`], [`ModelPatch`]: models that share most arrays with a compiled model |
//! | `unsupported`, `unknown_keyword`, [`mjcf_keywords`] | features by version, and MJCF keywords |
//! | `version`, `guard`, `error`, `heap` | version check, error handler, error types, allocator |
//!
//! ```
//! use kinetoscope_mujoco::{Data, compile};
//!
//! let mjcf = r#"<mujoco><worldbody><body><freejoint/><geom size="0.1"/></body></worldbody></mujoco>"#;
//! let model = compile(mjcf, &[])?.into_model();
//! let mut data = Data::new(&model)?;
//! data.step()?;
//! assert!(data.qpos()[2] < 0.0, "free fall");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![allow(unsafe_code, reason = "FFI boundary to MuJoCo")]

mod arrays;
mod compile;
mod data;
mod editor;
mod error;
mod guard;
mod heap;
mod input_limits;
mod jacobian;
pub mod mjcf_keywords;
mod model;
mod name;
mod options;
mod patch;
mod plugins;
mod prefetch;
mod raw;
mod ray;
mod skin_flex;
mod state;
#[cfg(test)]
mod tests;
mod unknown_keyword;
mod unsupported;
mod version;
mod version_counts;
mod visual;
mod weld;

pub use compile::{Asset, LoadError, compile, compile_file, compile_text};
pub use data::{Data, Overflow, Warning, WarningCounts};
pub use editor::{DiagonalInertia, ModelEditor};
pub use error::{CompileError, EngineError};
pub use heap::trim_heap;
pub use model::{Buffers, Compiled, Model};
pub use name::ObjectKind;
pub use options::OptionDifference;
pub use patch::{ModelPatch, NumberArray};
pub use prefetch::prefetch;
pub use ray::RayHit;
pub use skin_flex::{Bone, FlexArrays, SkinArrays};
pub use state::{BodyInputs, IntegrationState, JointInputs, SolvedState, UnnormalizedQuats, UserInputs};
pub use unsupported::UnsupportedFeature;
pub use version::{BUILD_VERSION, SupportedVersion, VersionError, check_version, version_string};
pub use weld::Weld;

pub use mujoco_sys as sys;
pub use mujoco_sys::{
    mjCNSTR_FRICTION_DOF, mjCNSTR_FRICTION_TENDON, mjGEOM_BOX, mjGEOM_CAPSULE, mjGEOM_CYLINDER, mjGEOM_ELLIPSOID,
    mjGEOM_HFIELD, mjGEOM_MESH, mjGEOM_PLANE, mjGEOM_SPHERE, mjINT_EULER, mjINT_IMPLICIT, mjINT_RK4, mjJNT_BALL,
    mjJNT_FREE, mjJNT_HINGE, mjJNT_SLIDE, mjWRAP_JOINT,
};

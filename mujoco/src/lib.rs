//! The unsafe wall: owned MuJoCo models and data with checked slices, for MuJoCo 2.2.2 and 4.x.
//!
//! This is the only place of hand-written unsafe code and the only one that knows MuJoCo versions. What it guarantees:
//!
//! * No input makes MuJoCo end the process: its error handler unwinds to [`guard`](self), which returns an
//!   [`EngineError`]; it writes no log file and no warnings. (The hull library inside 2.2.2 prints to stderr when a mesh is
//!   flat; `mjcf` gives it none.)
//! * A model never changes while it is shared; [`Data`] keeps its model alive.
//! * A slice has the length that MuJoCo's own `mjxmacro.h` declares (`mujoco_sys::fields`).
//!
//! Names are MuJoCo's own (`qpos`, `geom`, `efc_aref`) in this module and in `mjcf` only.
#![allow(unsafe_code, reason = "the wall to MuJoCo")]

mod arrays;
mod beyond;
mod control;
mod data;
mod deforming;
mod editor;
mod error;
mod guard;
mod jacobian;
mod look;
mod memory;
mod model;
mod name;
mod newer;
mod options;
mod plugins;
mod prefetch;
mod raw;
mod ray;
mod state;
#[cfg(test)]
mod tests;
mod version;
mod vfs;
mod weld;
pub mod words;

pub use beyond::Beyond;
pub use data::{Data, Overflow, Warning, WarningCounts};
pub use deforming::{Bone, FlexArrays, SkinArrays};
pub use editor::{DiagonalInertia, Editor};
pub use error::{CompileError, EngineError};
pub use look::{
    HeadlightValues, HeightFieldArrays, LightType, LightValues, MaterialValues, MeshArrays, TextureArrays, TextureType,
};
pub use memory::release_freed;
pub use model::{Buffers, Compiled, Model};
pub use name::ObjectKind;
pub use options::OptionDifference;
pub use prefetch::prefetch;
pub use ray::RayHit;
pub use state::{Inputs, Motion, RawQuats};
pub use version::{TARGET, Target, VersionError, check_version, version_string};
pub use vfs::{Asset, LoadError, compile, compile_file};
pub use weld::Weld;

pub use mujoco_sys as sys;
pub use mujoco_sys::{
    mjCNSTR_FRICTION_DOF, mjCNSTR_FRICTION_TENDON, mjGEOM_BOX, mjGEOM_CAPSULE, mjGEOM_CYLINDER, mjGEOM_ELLIPSOID,
    mjGEOM_HFIELD, mjGEOM_MESH, mjGEOM_PLANE, mjGEOM_SPHERE, mjINT_EULER, mjINT_IMPLICIT, mjINT_RK4, mjJNT_BALL,
    mjJNT_FREE, mjJNT_HINGE, mjJNT_SLIDE, mjWRAP_JOINT,
};

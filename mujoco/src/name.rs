//! Names of MuJoCo objects.

use super::model::{Compiled, Model};
use mujoco_sys as mj;
use std::ffi::CStr;

/// Kinds of named objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "MuJoCo's own names")]
pub enum ObjectKind {
    Body,
    Joint,
    Geom,
    Site,
    Camera,
    Light,
    Mesh,
    HeightField,
    Texture,
    Material,
    Equality,
    Tendon,
    Actuator,
    Sensor,
    Skin,
    Flex,
}

impl ObjectKind {
    fn code(self) -> i32 {
        (match self {
            Self::Body => mj::mjOBJ_BODY,
            Self::Joint => mj::mjOBJ_JOINT,
            Self::Geom => mj::mjOBJ_GEOM,
            Self::Site => mj::mjOBJ_SITE,
            Self::Camera => mj::mjOBJ_CAMERA,
            Self::Light => mj::mjOBJ_LIGHT,
            Self::Mesh => mj::mjOBJ_MESH,
            Self::HeightField => mj::mjOBJ_HFIELD,
            Self::Texture => mj::mjOBJ_TEXTURE,
            Self::Material => mj::mjOBJ_MATERIAL,
            Self::Equality => mj::mjOBJ_EQUALITY,
            Self::Tendon => mj::mjOBJ_TENDON,
            Self::Actuator => mj::mjOBJ_ACTUATOR,
            Self::Sensor => mj::mjOBJ_SENSOR,
            Self::Skin => mj::mjOBJ_SKIN,
            #[cfg(mj4)]
            Self::Flex => mj::mjOBJ_FLEX,
            // 2.2.2 has no flexes.
            #[cfg(not(mj4))]
            Self::Flex => mj::mjOBJ_UNKNOWN,
        }) as i32
    }
}

/// # Safety
/// `model` is alive.
unsafe fn id(model: *const mj::mjModel, kind: ObjectKind, name: &str) -> Option<usize> {
    let name = std::ffi::CString::new(name).ok()?;
    // SAFETY: the model is alive (contract); the name is NUL-terminated; an unknown name gives -1.
    let id = unsafe { mj::mj_name2id(model, kind.code(), name.as_ptr()) };
    usize::try_from(id).ok()
}

impl Compiled {
    /// Index of the object called `name`; `None` if there is no such object.
    pub fn id(&self, kind: ObjectKind, name: &str) -> Option<usize> {
        // SAFETY: the model is alive as long as `self`.
        unsafe { id(self.raw(), kind, name) }
    }

    /// Indices of the first position and the first degree of freedom of the joint called `name`; `None` if there is no
    /// such joint.
    pub fn joint_address(&self, name: &str) -> Option<(usize, usize)> {
        let joint = self.id(ObjectKind::Joint, name)?;
        // SAFETY: the model is alive and nothing writes to it while `self` is borrowed.
        let qpos = unsafe { mj::fields::model::jnt_qposadr(self.raw()) };
        // SAFETY: as above.
        let dofs = unsafe { mj::fields::model::jnt_dofadr(self.raw()) };
        Some((qpos[joint] as usize, dofs[joint] as usize))
    }
}

impl Model {
    /// Index of the object called `name`; `None` if there is no such object.
    pub fn id(&self, kind: ObjectKind, name: &str) -> Option<usize> {
        // SAFETY: the model is alive as long as `self`.
        unsafe { id(self.raw(), kind, name) }
    }

    /// Name of object `id`; `None` for an unnamed object or an index out of range.
    pub fn name(&self, kind: ObjectKind, id: usize) -> Option<String> {
        let id = i32::try_from(id).ok()?;
        // SAFETY: the model is alive; MuJoCo returns null for an index out of range.
        let name = unsafe { mj::mj_id2name(self.raw(), kind.code(), id) };
        if name.is_null() {
            return None;
        }
        // SAFETY: the name is NUL-terminated and lives in the model.
        let name = unsafe { CStr::from_ptr(name) };
        Some(name.to_string_lossy().into_owned()).filter(|n| !n.is_empty())
    }
}

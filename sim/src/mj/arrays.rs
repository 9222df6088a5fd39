//! Arrays of models and data as checked slices. One list line each; sizes come from `mujoco_sys::fields`.

use super::data::Data;
use super::model::{Compiled, Model};
use mujoco_sys::fields;

/// MuJoCo's flags: bytes on 2.2.2, booleans on 4.x.
#[cfg(not(mj4))]
pub(super) type Flag = u8;
#[cfg(mj4)]
pub(super) type Flag = bool;

macro_rules! model_arrays {
    ($($name:ident: $element:ty, $doc:literal;)*) => {
        impl Model {
            $(
                #[doc = $doc]
                pub fn $name(&self) -> &[$element] {
                    // SAFETY: the model is alive as long as `self` and nothing writes to a shared model.
                    unsafe { fields::model::$name(self.raw()) }
                }
            )*
        }
    };
}

macro_rules! model_arrays_mut {
    ($($name:ident = $field:ident: $element:ty;)*) => {
        impl Compiled {
            $(
                #[doc = concat!("MuJoCo's `", stringify!($field), "`, while the model may still be edited.")]
                pub(crate) fn $name(&mut self) -> &mut [$element] {
                    // SAFETY: `Compiled` is the only owner of the model and is borrowed mutably.
                    unsafe { fields::model::$field(self.raw_mut()) }
                }
            )*
        }
    };
}

macro_rules! data_arrays {
    ($($name:ident: $element:ty, $doc:literal;)*) => {
        impl Data {
            $(
                #[doc = $doc]
                pub fn $name(&self) -> &[$element] {
                    // SAFETY: model and data are alive as long as `self`; only `&mut self` writes.
                    unsafe { fields::data::$name(self.model().raw(), self.raw()) }
                }
            )*
        }
    };
}

macro_rules! data_arrays_mut {
    ($($name:ident = $field:ident: $element:ty;)*) => {
        impl Data {
            $(
                #[doc = concat!("MuJoCo's `", stringify!($field), "`, for writing.")]
                pub fn $name(&mut self) -> &mut [$element] {
                    // SAFETY: model and data are alive as long as `self`, which is borrowed mutably.
                    unsafe { fields::data::$field(self.model().raw(), self.raw_mut()) }
                }
            )*
        }
    };
}

model_arrays! {
    qpos0: f64, "Positions of the initial state, (nq,).";
    body_parentid: i32, "Parent of each body, (nbody,).";
    body_rootid: i32, "Root of each body's tree, (nbody,).";
    body_weldid: i32, "Body each body is welded to, (nbody,).";
    body_mocapid: i32, "Index of each body among those moved by hand, -1 for others, (nbody,).";
    body_mass: f64, "Mass \\[kg\\], (nbody,).";
    body_inertia: f64, "Principal moments of inertia \\[kg m²\\], (nbody, 3).";
    body_ipos: f64, "Centre of mass in the body frame \\[m\\], (nbody, 3).";
    body_iquat: f64, "Principal axes in the body frame, wxyz, (nbody, 4).";
    body_pos: f64, "Position in the parent body's frame \\[m\\], (nbody, 3).";
    body_quat: f64, "Orientation in the parent body's frame, wxyz, (nbody, 4).";
    body_subtreemass: f64, "Mass of the body and all below it \\[kg\\], (nbody,).";
    jnt_type: i32, "Joint types, (njnt,).";
    jnt_qposadr: i32, "First position of each joint, (njnt,).";
    jnt_dofadr: i32, "First degree of freedom of each joint, (njnt,).";
    jnt_bodyid: i32, "Body each joint moves, (njnt,).";
    jnt_range: f64, "Limits \\[rad or m\\], (njnt, 2).";
    dof_jntid: i32, "Joint of each degree of freedom, (nv,).";
    dof_damping: f64, "Viscous damping, (nv,).";
    dof_armature: f64, "Rotor inertia, (nv,).";
    dof_frictionloss: f64, "Dry friction, (nv,).";
    dof_invweight0: f64, "Diagonal of the inverse inertia at qpos0, (nv,).";
    tendon_frictionloss: f64, "Dry friction of tendons, (ntendon,).";
    geom_type: i32, "Geom types, (ngeom,).";
    geom_bodyid: i32, "Body of each geom, (ngeom,).";
    geom_contype: i32, "Contact type bits, (ngeom,).";
    geom_conaffinity: i32, "Contact affinity bits, (ngeom,).";
    geom_size: f64, "Sizes, (ngeom, 3).";
    geom_dataid: i32, "Mesh or height field of each geom, -1 for none, (ngeom,).";
    geom_matid: i32, "Material of each geom, -1 for none, (ngeom,).";
    geom_group: i32, "Group of each geom, (ngeom,).";
    geom_rgba: f32, "Colours, (ngeom, 4).";
    cam_fovy: f64, "Vertical fields of view \\[deg\\], (ncam,).";
    actuator_gainprm: f64, "Gain parameters, (nu, mjNGAIN).";
    actuator_biasprm: f64, "Bias parameters, (nu, mjNBIAS).";
    actuator_forcerange: f64, "Force limits, (nu, 2).";
    body_jntnum: i32, "Number of joints of each body, (nbody,).";
    body_geomadr: i32, "First geom of each body or -1, (nbody,).";
    body_geomnum: i32, "Number of geoms of each body, (nbody,).";
}

model_arrays_mut! {
    dof_frictionloss_mut = dof_frictionloss_mut: f64;
    actuator_gainprm_mut = actuator_gainprm_mut: f64;
    actuator_biasprm_mut = actuator_biasprm_mut: f64;
    actuator_ctrllimited_mut = actuator_ctrllimited_mut: Flag;
}

data_arrays! {
    qpos: f64, "Positions, (nq,).";
    qvel: f64, "Velocities, (nv,).";
    qacc: f64, "Accelerations of the last solve, (nv,).";
    qacc_warmstart: f64, "Accelerations the solver starts from, (nv,).";
    ctrl: f64, "Control inputs, (nu,).";
    qfrc_applied: f64, "Applied generalised forces, (nv,).";
    xfrc_applied: f64, "Applied forces and torques on bodies, (nbody, 6).";
    actuator_force: f64, "Force of each actuator, (nu,).";
    qfrc_actuator: f64, "Actuator forces, (nv,).";
    qfrc_bias: f64, "Coriolis, centrifugal and gravity forces, (nv,).";
    qfrc_constraint: f64, "Constraint forces, (nv,).";
    qfrc_passive: f64, "Passive forces, (nv,).";
    xpos: f64, "Body positions \\[m\\], (nbody, 3).";
    xquat: f64, "Body orientations, wxyz, (nbody, 4).";
    xipos: f64, "Centres of mass \\[m\\], (nbody, 3).";
    cvel: f64, "Spatial velocities about the subtree's centre of mass, (nbody, 6).";
    cacc: f64, "Spatial accelerations about the subtree's centre of mass, minus gravity, (nbody, 6); see [`Data::solve_accelerations`].";
    cfrc_int: f64, "Torques and forces that parents exert on bodies, about the subtree's centre of mass, (nbody, 6); see [`Data::solve_accelerations`].";
    subtree_com: f64, "Centres of mass of subtrees \\[m\\], (nbody, 3).";
    light_xpos: f64, "Light positions \\[m\\], (nlight, 3).";
    light_xdir: f64, "Light directions, (nlight, 3).";
    cam_xpos: f64, "Camera positions \\[m\\], (ncam, 3).";
    cam_xmat: f64, "Camera rotation matrices (x right, y up, looking along -z), row-major, (ncam, 9).";
    geom_xpos: f64, "Geom positions \\[m\\], (ngeom, 3).";
    geom_xmat: f64, "Geom rotation matrices, row-major, (ngeom, 9).";
    efc_type: i32, "Kind of each constraint row, (nefc,).";
    efc_id: i32, "Object of each constraint row, (nefc,).";
    efc_force: f64, "Force of each constraint row, (nefc,).";
    contact: mujoco_sys::mjContact, "Contacts, (ncon,).";
    sensordata: f64, "Readings of MuJoCo's own sensors, (nsensordata,).";
}

data_arrays_mut! {
    qpos_mut = qpos_mut: f64;
    qvel_mut = qvel_mut: f64;
    ctrl_mut = ctrl_mut: f64;
    qacc_warmstart_mut = qacc_warmstart_mut: f64;
    qfrc_applied_mut = qfrc_applied_mut: f64;
    xfrc_applied_mut = xfrc_applied_mut: f64;
    efc_d_mut = efc_D_mut: f64;
    efc_r_mut = efc_R_mut: f64;
    efc_aref_mut = efc_aref_mut: f64;
    efc_frictionloss_mut = efc_frictionloss_mut: f64;
}

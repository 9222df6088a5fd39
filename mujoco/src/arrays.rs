//! Accessors of model and data arrays as checked slices. Sizes come from `mujoco_sys::fields`.

use super::data::Data;
use super::model::{Compiled, Model};
use mujoco_sys::fields;

/// Type of MuJoCo's flags: a byte on 2.2.2, a boolean on 4.x.
#[cfg(not(mj4))]
pub(super) type Flag = u8;
#[cfg(mj4)]
pub(super) type Flag = bool;

/// True if the flag is set.
#[cfg(not(mj4))]
pub(super) fn is_set(flag: Flag) -> bool {
    flag != 0
}
/// True if the flag is set.
#[cfg(mj4)]
pub(super) fn is_set(flag: Flag) -> bool {
    flag
}

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

macro_rules! model_flags {
    ($($name:ident, $doc:literal;)*) => {
        impl Model {
            $(
                #[doc = $doc]
                ///
                /// # Panics
                /// There is no such object.
                pub fn $name(&self, index: usize) -> bool {
                    // SAFETY: the model is alive as long as `self` and nothing writes to a shared model.
                    is_set(unsafe { fields::model::$name(self.raw()) }[index])
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
                pub fn $name(&mut self) -> &mut [$element] {
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
    body_rootid: i32, "Ancestor of each body that is a child of the world, (nbody,).";
    body_weldid: i32, "Body that each body is welded to: itself if it has a joint, 0 if it is fixed to the world, (nbody,).";
    body_mocapid: i32, "Mocap index of each body, -1 for others, (nbody,).";
    body_mass: f64, "Mass \\[kg\\], (nbody,).";
    body_inertia: f64, "Principal moments of inertia \\[kg m²\\], (nbody, 3).";
    body_ipos: f64, "Center of mass of each body alone, in the body frame \\[m\\], (nbody, 3).";
    body_iquat: f64, "Principal axes in the body frame, wxyz, (nbody, 4).";
    body_pos: f64, "Position in the parent body's frame \\[m\\], (nbody, 3).";
    body_quat: f64, "Orientation in the parent body's frame, wxyz, (nbody, 4).";
    body_subtreemass: f64, "Mass of the body and all below it \\[kg\\], (nbody,).";
    jnt_type: i32, "Joint types, (njnt,).";
    jnt_qposadr: i32, "Index in `qpos` of the first position of each joint, (njnt,).";
    jnt_dofadr: i32, "Index of the first degree of freedom of each joint, (njnt,).";
    jnt_bodyid: i32, "Body each joint moves, (njnt,).";
    jnt_range: f64, "Limits \\[rad or m\\], valid only if the joint is limited, (njnt, 2).";
    dof_jntid: i32, "Joint of each degree of freedom, (nv,).";
    dof_damping: f64, "Viscous damping \\[N m s/rad or N s/m\\], (nv,).";
    dof_armature: f64, "Rotor inertia, (nv,).";
    dof_frictionloss: f64, "Dry friction \\[N m or N\\], (nv,).";
    dof_bodyid: i32, "Body each degree of freedom moves, (nv,).";
    body_invweight0: f64, "Inverse inertia of bodies at qpos0, translation and rotation, (nbody, 2).";
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
    geom_rgba: f32, "Colors (RGBA), (ngeom, 4).";
    cam_fovy: f64, "Vertical fields of view \\[deg\\], (ncam,).";
    actuator_gainprm: f64, "Gain parameters, (nactuator, mjNGAIN).";
    actuator_biasprm: f64, "Bias parameters, (nactuator, mjNBIAS).";
    actuator_forcerange: f64, "Force limits, (nactuator, 2).";
    body_jntnum: i32, "Number of joints of each body, (nbody,).";
    body_geomadr: i32, "First geom of each body or -1, (nbody,).";
    body_geomnum: i32, "Number of geoms of each body, (nbody,).";
    qpos_spring: f64, "Positions in which springs are at rest, (nq,).";
    jnt_group: i32, "Group of each joint, (njnt,).";
    jnt_solref: f64, "Reference of the limit constraints, (njnt, mjNREF).";
    jnt_solimp: f64, "Impedance of the limit constraints, (njnt, mjNIMP).";
    jnt_pos: f64, "Anchors in the body frame \\[m\\], (njnt, 3).";
    jnt_axis: f64, "Axes in the body frame, (njnt, 3).";
    jnt_stiffness: f64, "Stiffness of springs \\[N m/rad or N/m\\], (njnt,).";
    jnt_margin: f64, "Distances at which limits act \\[rad or m\\], (njnt,).";
    dof_solref: f64, "Reference of friction, (nv, mjNREF).";
    dof_solimp: f64, "Impedance of friction, (nv, mjNIMP).";
    geom_condim: i32, "Dimension of contacts, (ngeom,).";
    geom_priority: i32, "Priority of the contact parameters, (ngeom,): the geom with the higher priority sets them.";
    geom_solmix: f64, "Weights in the mixing of contact parameters, (ngeom,).";
    geom_solref: f64, "Reference of contacts, (ngeom, mjNREF).";
    geom_solimp: f64, "Impedance of contacts, (ngeom, mjNIMP).";
    geom_pos: f64, "Positions in the body frame \\[m\\], (ngeom, 3).";
    geom_quat: f64, "Orientations in the body frame, wxyz, (ngeom, 4).";
    geom_friction: f64, "Sliding, torsional and rolling friction, (ngeom, 3).";
    geom_margin: f64, "Distances at which contacts are found \\[m\\], (ngeom,).";
    geom_gap: f64, "Width of the distance range in which a contact is detected but exerts no force \\[m\\], (ngeom,).";
    geom_fluid: f64, "Parameters of fluid forces, (ngeom, mjNFLUID).";
    site_type: i32, "Site types, as those of geoms, (nsite,).";
    site_bodyid: i32, "Body of each site, (nsite,).";
    site_matid: i32, "Material of each site, -1 for none, (nsite,).";
    site_group: i32, "Group of each site, (nsite,).";
    site_size: f64, "Sizes, (nsite, 3).";
    site_pos: f64, "Positions in the body frame \\[m\\], (nsite, 3).";
    site_quat: f64, "Orientations in the body frame, wxyz, (nsite, 4).";
    site_rgba: f32, "Colors (RGBA), (nsite, 4).";
    cam_mode: i32, "Tracking mode of each camera, (ncam,).";
    cam_bodyid: i32, "Body of each camera, (ncam,).";
    cam_targetbodyid: i32, "Body each camera looks at, -1 for none, (ncam,).";
    cam_pos: f64, "Positions in the body frame \\[m\\], (ncam, 3).";
    cam_quat: f64, "Orientations in the body frame, wxyz, (ncam, 4).";
    cam_ipd: f64, "Interpupillary distances \\[m\\], (ncam,).";
    light_mode: i32, "Tracking mode of each light, (nlight,).";
    light_bodyid: i32, "Body of each light, (nlight,).";
    light_targetbodyid: i32, "Body each light shines at, -1 for none, (nlight,).";
    light_pos: f64, "Positions in the body frame \\[m\\], (nlight, 3).";
    light_dir: f64, "Directions in the body frame, (nlight, 3).";
    hfield_size: f64, "Half lengths, height and depth \\[m\\], (nhfield, 4).";
    pair_dim: i32, "Dimension of the contacts of each pair, (npair,).";
    pair_geom1: i32, "First geoms of pairs, (npair,).";
    pair_geom2: i32, "Second geoms of pairs, (npair,).";
    pair_solref: f64, "Reference of contacts, (npair, mjNREF).";
    pair_solimp: f64, "Impedance of contacts, (npair, mjNIMP).";
    pair_margin: f64, "Distances at which contacts are found \\[m\\], (npair,).";
    pair_gap: f64, "Width of the distance range in which a contact is detected but exerts no force \\[m\\], (npair,).";
    pair_friction: f64, "Friction: two tangential, one torsional, two rolling coefficients, (npair, 5).";
    exclude_signature: i32, "Excluded body pairs in MuJoCo's packed form, (nexclude,); see [`Model::excluded_bodies`].";
    eq_type: i32, "Equality types, (neq,).";
    eq_obj1id: i32, "First objects of equalities, (neq,).";
    eq_obj2id: i32, "Second objects of equalities, -1 for none, (neq,).";
    eq_solref: f64, "Reference of equalities, (neq, mjNREF).";
    eq_solimp: f64, "Impedance of equalities, (neq, mjNIMP).";
    eq_data: f64, "Parameters of equalities, (neq, mjNEQDATA).";
    tendon_adr: i32, "First point of each tendon's path, (ntendon,).";
    tendon_num: i32, "Number of points of each tendon's path, (ntendon,).";
    tendon_matid: i32, "Material of each tendon, -1 for none, (ntendon,).";
    tendon_group: i32, "Group of each tendon, (ntendon,).";
    tendon_width: f64, "Rendered widths \\[m\\], (ntendon,).";
    tendon_solref_lim: f64, "Reference of limits, (ntendon, mjNREF).";
    tendon_solimp_lim: f64, "Impedance of limits, (ntendon, mjNIMP).";
    tendon_solref_fri: f64, "Reference of friction, (ntendon, mjNREF).";
    tendon_solimp_fri: f64, "Impedance of friction, (ntendon, mjNIMP).";
    tendon_range: f64, "Limits \\[m, in fixed tendons the unit of the sum\\], (ntendon, 2).";
    tendon_margin: f64, "Distances at which limits act \\[m\\], (ntendon,).";
    tendon_stiffness: f64, "Stiffness of springs, (ntendon,).";
    tendon_damping: f64, "Viscous damping, (ntendon,).";
    tendon_lengthspring: f64, "Lengths at which springs are at rest \\[m\\], (ntendon,); on 4.x the two ends, (ntendon, 2).";
    tendon_rgba: f32, "Colors (RGBA), (ntendon, 4).";
    wrap_type: i32, "Kinds of path points, (nwrap,).";
    wrap_objid: i32, "Objects of path points, (nwrap,).";
    wrap_prm: f64, "Divisors, coefficients or side sites of path points, (nwrap,).";
    actuator_trntype: i32, "Transmission type of each actuator, (nactuator,).";
    actuator_dyntype: i32, "Activation dynamics of each actuator, (nactuator,).";
    actuator_gaintype: i32, "Gain of each actuator, (nactuator,).";
    actuator_biastype: i32, "Bias of each actuator, (nactuator,).";
    actuator_trnid: i32, "Objects each actuator acts on, (nactuator, 2).";
    actuator_group: i32, "Group of each actuator, (nactuator,).";
    actuator_dynprm: f64, "Parameters of activation dynamics, (nactuator, mjNDYN).";
    actuator_ctrlrange: f64, "Ranges of controls, (nu, 2).";
    actuator_actrange: f64, "Ranges of activations, (nactuator, 2).";
    actuator_gear: f64, "Gears, (nactuator, 6).";
    actuator_cranklength: f64, "Lengths of cranks \\[m\\], (nactuator,).";
    actuator_lengthrange: f64, "Ranges of lengths, (nactuator, 2).";
    sensor_type: i32, "Types of MuJoCo's own sensors, (nsensor,).";
    sensor_needstage: i32, "Stage of a step that gives each sensor's value, (nsensor,).";
    sensor_objtype: i32, "Kind of object of each sensor, (nsensor,).";
    sensor_objid: i32, "Object of each sensor, (nsensor,).";
    sensor_reftype: i32, "Kind of reference frame of each sensor, (nsensor,).";
    sensor_refid: i32, "Reference frame of each sensor, -1 for the world, (nsensor,).";
    sensor_dim: i32, "Number of values of each sensor, (nsensor,).";
    sensor_adr: i32, "First value of each sensor, (nsensor,).";
    sensor_cutoff: f64, "Cutoff of each sensor value, 0 for no cutoff, (nsensor,).";
    sensor_noise: f64, "Standard deviations, which MuJoCo does not use by itself, (nsensor,).";
}

model_flags! {
    jnt_limited, "True if joint `index` has limits.";
    tendon_limited, "True if tendon `index` has limits.";
    actuator_ctrllimited, "True if control `index` is clamped.";
    actuator_forcelimited, "True if the force of actuator `index` is clamped.";
    actuator_actlimited, "True if the activation of actuator `index` is clamped.";
}

model_arrays_mut! {
    dof_damping_mut = dof_damping_mut: f64;
    dof_frictionloss_mut = dof_frictionloss_mut: f64;
    actuator_gainprm_mut = actuator_gainprm_mut: f64;
    actuator_biasprm_mut = actuator_biasprm_mut: f64;
    actuator_ctrllimited_mut = actuator_ctrllimited_mut: Flag;
    actuator_forcelimited_mut = actuator_forcelimited_mut: Flag;
}

data_arrays! {
    qpos: f64, "Positions, (nq,).";
    qvel: f64, "Velocities, (nv,).";
    qacc: f64, "Accelerations of the last solve, (nv,).";
    qacc_warmstart: f64, "Accelerations from which the solver starts (warm start), (nv,).";
    ctrl: f64, "Control inputs, (nu,).";
    qfrc_applied: f64, "Applied generalized forces, (nv,).";
    xfrc_applied: f64, "Applied force and torque on each body, in world axes at its center of mass, (nbody, 6).";
    actuator_force: f64, "Force of each actuator, (nu,); on 4.x of each actuator output.";
    qfrc_actuator: f64, "Actuator forces, (nv,).";
    qfrc_bias: f64, "Generalized force for zero acceleration without other forces (Coriolis, centrifugal, gravity), (nv,).";
    qfrc_constraint: f64, "Constraint forces, (nv,).";
    qfrc_passive: f64, "Passive forces, (nv,).";
    xpos: f64, "Body positions \\[m\\], (nbody, 3).";
    xquat: f64, "Body orientations, wxyz, (nbody, 4).";
    xipos: f64, "Centers of mass of the bodies alone in the world frame \\[m\\], (nbody, 3).";
    xanchor: f64, "Anchors of joints \\[m\\], (njnt, 3).";
    xaxis: f64, "Axes of joints, (njnt, 3).";
    cvel: f64, "Spatial velocities, angular before linear, in world axes about the center of mass of the body's kinematic tree, (nbody, 6).";
    cacc: f64, "Spatial accelerations about the subtree's center of mass, minus gravity, (nbody, 6); see [`Data::rne_post_constraint`].";
    cfrc_int: f64, "Torques and forces that parents exert on bodies, about the subtree's center of mass, (nbody, 6); see [`Data::rne_post_constraint`].";
    subtree_com: f64, "Centers of mass of subtrees \\[m\\], (nbody, 3).";
    light_xpos: f64, "Light positions \\[m\\], (nlight, 3).";
    light_xdir: f64, "Light directions, (nlight, 3).";
    cam_xpos: f64, "Camera positions \\[m\\], (ncam, 3).";
    cam_xmat: f64, "Camera rotation matrices (x right, y up, looking along -z), row-major, (ncam, 9).";
    geom_xpos: f64, "Geom positions \\[m\\], (ngeom, 3).";
    geom_xmat: f64, "Geom rotation matrices, row-major, (ngeom, 9).";
    efc_type: i32, "Kind of each constraint row, (nefc,).";
    efc_id: i32, "Object of each constraint row, (nefc,).";
    efc_pos: f64, "Residual of each constraint row (meters or radians, depending on its type), (nefc,).";
    efc_force: f64, "Force of each constraint row, (nefc,), as [`Data::step2`] or [`Data::forward`] solved it. After [`Data::step1`] alone, its content is undefined on MuJoCo 4.";
    contact: mujoco_sys::mjContact, "Contacts, (ncon,).";
    act: f64, "Activations of actuators with a state, (na,).";
    site_xpos: f64, "Site positions \\[m\\], (nsite, 3).";
    site_xmat: f64, "Site rotation matrices, row-major, (nsite, 9).";
    mocap_pos: f64, "Positions of mocap bodies \\[m\\], (nmocap, 3).";
    mocap_quat: f64, "Orientations of mocap bodies, wxyz, (nmocap, 4).";
    sensordata: f64, "Readings of MuJoCo's own sensors, (nsensordata,).";
    ten_wrapadr: i32, "First point of each tendon's path in `wrap_xpos`, (ntendon,).";
    ten_wrapnum: i32, "Number of points of each tendon's path, (ntendon,).";
    ten_length: f64, "Lengths of tendons \\[m; fixed tendons: weighted sum of joint positions\\], (ntendon,).";
    wrap_obj: i32, "Geom that each point of a path lies on, -1 at a site, -2 at a pulley, (nwrap, 2).";
    wrap_xpos: f64, "Points of paths \\[m\\], (nwrap, 6): two points in each row.";
}

data_arrays_mut! {
    qpos_mut = qpos_mut: f64;
    qvel_mut = qvel_mut: f64;
    act_mut = act_mut: f64;
    mocap_pos_mut = mocap_pos_mut: f64;
    mocap_quat_mut = mocap_quat_mut: f64;
    ctrl_mut = ctrl_mut: f64;
    qacc_mut = qacc_mut: f64;
    qacc_warmstart_mut = qacc_warmstart_mut: f64;
    qfrc_applied_mut = qfrc_applied_mut: f64;
    xfrc_applied_mut = xfrc_applied_mut: f64;
    efc_d_mut = efc_D_mut: f64;
    efc_r_mut = efc_R_mut: f64;
    efc_aref_mut = efc_aref_mut: f64;
    efc_frictionloss_mut = efc_frictionloss_mut: f64;
}

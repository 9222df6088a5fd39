//! The report: plain data, written as JSON by `serde`. Numbers are SI; quaternions are w, x, y, z; `None` is `null`.

use super::{FREE_COLUMNS, InspectCfg, free_joint_columns};
use crate::drive::plan::own_limit;
use kinetoscope_robot::description::{Joint, JointKind, LinkId, RobotDescription};
use kinetoscope_robot::diagnostic::Diagnostic;
use kinetoscope_robot::dynamics::Kinematics;
use kinetoscope_robot::inertia::RigidInertia;
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::to_row;
use nalgebra::Vector3;
use serde::Serialize;

/// A robot in one position.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Name of the robot.
    pub robot: String,
    /// The files, as they were named.
    pub files: Vec<String>,
    /// Sum of the link masses \[kg\].
    pub total_mass: f64,
    /// Centre of mass in the world \[m\]; `None` where there is no mass.
    pub com: Option<[f64; 3]>,
    /// All links, also those that are fixed to another, in the order of the merged files.
    pub links: Vec<LinkReport>,
    /// All joints, also fixed ones, in the order of the merged files.
    pub joints: Vec<JointReport>,
    /// Joints with one degree of freedom, mimic ones included, in the order of the merged files.
    pub joint_names: Vec<String>,
    /// Position of each of `joint_names` \[rad or m\].
    pub qpos: Vec<f64>,
    /// Rows and columns of `mass_matrix` and entries of `gravity_torque`: `joint_names`. With a floating base, ahead of
    /// them `base.vx` to `base.wz`: the velocity of the root's origin in world axes, then the angular velocity in the
    /// axes of the root. After them, for each floating joint six, for each planar joint three (`.vx`, `.vy`, `.wz`).
    pub columns: Vec<String>,
    /// Joint-space inertia at `qpos`, with the rotor inertias (`armature`) of an MJCF file on the diagonal; mimic joints are
    /// coordinates of their own.
    pub mass_matrix: Vec<Vec<f64>>,
    /// The generalized force that holds the robot still at `qpos`, gravity being (0, 0, -9.81) m/s².
    pub gravity_torque: Vec<f64>,
    /// What was repaired, ignored or missing.
    pub warnings: Vec<Warning>,
}

/// A link.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LinkReport {
    /// Name.
    pub name: String,
    /// The parent link; `None` for the root.
    pub parent: Option<String>,
    /// Mass \[kg\]; 0 where the file gives none.
    pub mass: f64,
    /// Centre of mass in the link frame \[m\]; `None` where the file gives no inertia.
    pub com: Option<[f64; 3]>,
    /// Inertia \[kg m²\] about the centre of mass in link axes; `None` where the file gives none.
    pub inertia: Option<[[f64; 3]; 3]>,
    /// Pose in the world, `[x, y, z, qw, qx, qy, qz]`. The root is at the origin.
    pub pose: [f64; 7],
}

/// A joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointReport {
    /// Name.
    pub name: String,
    /// URDF's word for how it moves.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Parent link.
    pub parent: String,
    /// Child link.
    pub child: String,
    /// Axis in the joint frame.
    pub axis: [f64; 3],
    /// Lower limit \[rad or m\]; `None` where it is not limited. 0 where the file gives the upper one only.
    pub lower: Option<f64>,
    /// Upper limit \[rad or m\]; `None` where it is not limited. 0 where the file gives the lower one only.
    pub upper: Option<f64>,
    /// Largest effort \[N m or N\] as the file says; `None` where it gives none.
    pub effort: Option<f64>,
    /// Largest speed \[rad/s or m/s\] as the file says; `None` where it gives none.
    pub velocity: Option<f64>,
    /// The joint it follows.
    pub mimic: Option<MimicReport>,
}

/// `position = multiplier * position(joint) + offset`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MimicReport {
    /// The joint that is followed, as the file says.
    pub joint: String,
    /// Ratio.
    pub multiplier: f64,
    /// Offset \[rad or m\].
    pub offset: f64,
}

/// Something that was repaired, ignored or missing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// Stable name of the kind ([`DiagnosticKind::name`](kinetoscope_robot::diagnostic::DiagnosticKind::name)).
    pub kind: &'static str,
    /// The file; `None` where it is in none.
    pub file: Option<String>,
    /// Line, counted from 1.
    pub line: Option<u32>,
    /// A sentence that names the element.
    pub message: String,
}

impl Report {
    pub(super) fn new(
        cfg: &InspectCfg,
        description: &RobotDescription,
        kinematics: &Kinematics<'_>,
        qpos: Vec<f64>,
        gravity: &Vector3<f64>,
        diagnostics: &[Diagnostic],
    ) -> Self {
        let joint_names: Vec<String> = description.drivable_joints().map(|(_, j)| j.name.clone()).collect();
        let base = FREE_COLUMNS.iter().filter(|_| cfg.floating_base).map(|part| format!("base.{part}"));
        let columns: Vec<String> =
            base.chain(joint_names.iter().cloned()).chain(free_joint_columns(description)).collect();
        let poses = kinematics.link_poses();
        let mut mass_matrix = kinematics.mass_matrix();
        for (id, joint) in description.drivable_joints() {
            let column = kinematics.columns(id).start;
            mass_matrix[(column, column)] += joint.defaults.map_or(0.0, |file| file.armature);
        }
        Self {
            robot: description.name.clone(),
            files: cfg.files().map(|file| file.display().to_string()).collect(),
            total_mass: kinematics.total_mass(),
            com: kinematics.center_of_mass().map(Into::into),
            links: poses.iter().enumerate().map(|(i, pose)| LinkReport::new(description, LinkId(i), pose)).collect(),
            joints: description.joints.iter().map(|j| JointReport::new(description, j)).collect(),
            joint_names,
            qpos,
            columns,
            mass_matrix: mass_matrix.row_iter().map(|r| r.iter().copied().collect()).collect(),
            gravity_torque: kinematics.gravity_torque(gravity).iter().copied().collect(),
            warnings: diagnostics.iter().map(Warning::new).collect(),
        }
    }
}

impl LinkReport {
    fn new(description: &RobotDescription, id: LinkId, pose: &Pose) -> Self {
        let link = description.link(id);
        let inertia = link.inertial.as_ref().map(RigidInertia::from_inertial);
        let parent = link.parent_joint.map(|j| description.joint(j).parent);
        Self {
            name: link.name.clone(),
            parent: parent.map(|p| description.link(p).name.clone()),
            mass: inertia.map_or(0.0, |i| i.mass),
            com: inertia.map(|i| i.com.into()),
            // nalgebra's arrays are columns; the tensor is symmetric but for rounding.
            inertia: inertia.map(|i| i.inertia.transpose().into()),
            pose: to_row(pose),
        }
    }
}

impl JointReport {
    fn new(description: &RobotDescription, joint: &Joint) -> Self {
        let limits = joint.limit.as_ref().filter(|_| joint.kind != JointKind::Fixed);
        let range = own_limit(joint).filter(|_| joint.kind.is_drivable());
        Self {
            name: joint.name.clone(),
            kind: joint.kind.name(),
            parent: description.link(joint.parent).name.clone(),
            child: description.link(joint.child).name.clone(),
            axis: joint.axis.into_inner().into(),
            lower: range.map(|[lower, _]| lower),
            upper: range.map(|[_, upper]| upper),
            effort: limits.and_then(|l| l.effort),
            velocity: limits.and_then(|l| l.velocity),
            mimic: joint.mimic.as_ref().map(|mimic| MimicReport {
                joint: description.joint(mimic.joint).name.clone(),
                multiplier: mimic.multiplier,
                offset: mimic.offset,
            }),
        }
    }
}

impl Warning {
    fn new(diagnostic: &Diagnostic) -> Self {
        Self {
            kind: diagnostic.kind.name(),
            file: diagnostic.source.as_ref().map(|s| s.file.display().to_string()),
            line: diagnostic.source.as_ref().map(|s| s.line),
            message: diagnostic.message.clone(),
        }
    }
}

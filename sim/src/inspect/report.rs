//! Report as plain data that `serde` writes as JSON. Numbers are SI; quaternions are w, x, y, z; `None` is `null`.

use super::{FREE_COLUMNS, InspectCfg, free_joint_columns};
use kinetoscope_robot::description::{Joint, JointKind, LinkId, RobotDescription};
use kinetoscope_robot::diagnostic::Diagnostic;
use kinetoscope_robot::dynamics::Dynamics;
use kinetoscope_robot::inertia::RigidInertia;
use kinetoscope_robot::position_range::own_limit;
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::to_row;
use nalgebra::Vector3;
use serde::Serialize;

/// Masses, links, joints, mass matrix and gravity torque of a robot at one joint configuration, with warnings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RobotReport {
    /// Name of the robot in its merged URDF; `robot` for an MJCF file.
    pub robot: String,
    /// The files, as given.
    pub files: Vec<String>,
    /// Sum of the link masses, completed ones included \[kg\].
    pub total_mass: f64,
    /// Center of mass at `qpos` in the frame of the root link \[m\]; `None` for a massless robot.
    pub com: Option<[f64; 3]>,
    /// All links in the order of the merged files, including links fixed to others. For an MJCF file: bodies, named
    /// sites, and frames between joints.
    pub links: Vec<LinkReport>,
    /// All joints in the order of the merged files, including fixed joints.
    pub joints: Vec<JointReport>,
    /// Names of the joints with one degree of freedom, mimic joints included, in the order of the merged files.
    pub joint_names: Vec<String>,
    /// Position of each of `joint_names` \[rad or m\]; mimic joints have the implied one.
    pub qpos: Vec<f64>,
    /// Names of the generalized velocities: rows and columns of `mass_matrix`, entries of `gravity_torque`. They are
    /// `joint_names`. With a floating base, `base.vx` to `base.wz` come first: the velocity of the root's origin in
    /// world axes, then the angular velocity in root axes. Floating joints (six entries each) and planar joints (`.vx`,
    /// `.vy`, `.wz`) come last.
    pub columns: Vec<String>,
    /// Joint-space inertia at `qpos` \[kg m², kg m or kg\], with the rotor inertias (`armature`) of an MJCF file on the
    /// diagonal; mimic joints have columns of their own.
    pub mass_matrix: Vec<Vec<f64>>,
    /// Generalized force \[N m or N\] that holds the robot still at `qpos`, for gravity (0, 0, -9.81) m/s².
    pub gravity_torque: Vec<f64>,
    /// Warnings about everything repaired, ignored or missing.
    pub warnings: Vec<ReportWarning>,
}

/// Mass properties and pose of a link.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LinkReport {
    /// Name.
    pub name: String,
    /// Name of the parent link; `None` for the root.
    pub parent: Option<String>,
    /// Mass \[kg\], from the file or completed from shapes; 0 without one.
    pub mass: f64,
    /// Center of mass in the link frame \[m\]; `None` without inertia (file or completed).
    pub com: Option<[f64; 3]>,
    /// Inertia \[kg m²\] about the center of mass in link axes; `None` without inertia (file or completed).
    pub inertia: Option<[[f64; 3]; 3]>,
    /// Pose at `qpos` in the frame of the root link, `[x, y, z, qw, qx, qy, qz]` \[m\].
    pub pose: [f64; 7],
}

/// Type, links, axis, limits and mimic relation of a joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointReport {
    /// Name.
    pub name: String,
    /// Joint type, as in URDF.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Name of the parent link.
    pub parent: String,
    /// Name of the child link.
    pub child: String,
    /// Axis in the joint frame.
    pub axis: [f64; 3],
    /// Lower position limit \[rad or m\]; `None` for an unlimited joint, and for one without a single degree of
    /// freedom. 0 if the file gives only the upper limit.
    pub lower: Option<f64>,
    /// Upper position limit \[rad or m\]; `None` for an unlimited joint, and for one without a single degree of
    /// freedom. 0 if the file gives only the lower limit.
    pub upper: Option<f64>,
    /// Effort limit of the file \[N m or N\]; `None` if it gives none.
    pub effort: Option<f64>,
    /// Velocity limit of the file \[rad/s or m/s\]; `None` if it gives none.
    pub velocity: Option<f64>,
    /// Mimic relation as in the file, chains not resolved; `None` for a joint without a linear relation.
    pub mimic: Option<MimicReport>,
}

/// Mimic relation of a joint: `position = multiplier * position(joint) + offset`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MimicReport {
    /// Name of the driving joint, as in the file.
    pub joint: String,
    /// Factor of the driving joint's position.
    pub multiplier: f64,
    /// Offset \[rad or m\].
    pub offset: f64,
}

/// Warning about something repaired, ignored or missing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ReportWarning {
    /// Stable name of the kind ([`DiagnosticKind::name`](kinetoscope_robot::diagnostic::DiagnosticKind::name)).
    pub kind: &'static str,
    /// The file; `None` if the warning belongs to no file.
    pub file: Option<String>,
    /// Line, counted from 1; `None` without a file.
    pub line: Option<u32>,
    /// Sentence that names the element.
    pub message: String,
}

impl RobotReport {
    pub(super) fn new(
        cfg: &InspectCfg,
        description: &RobotDescription,
        kinematics: &Dynamics<'_>,
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
            let column = kinematics.dof_range(id).start;
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
            warnings: diagnostics.iter().map(ReportWarning::new).collect(),
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
            // nalgebra's arrays are columns; the tensor is symmetric up to rounding.
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

impl ReportWarning {
    fn new(diagnostic: &Diagnostic) -> Self {
        Self {
            kind: diagnostic.kind.name(),
            file: diagnostic.source.as_ref().map(|s| s.file.display().to_string()),
            line: diagnostic.source.as_ref().map(|s| s.line),
            message: diagnostic.message.clone(),
        }
    }
}

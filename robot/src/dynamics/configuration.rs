//! Configuration of a robot: pose of its root and positions of its joints.

use super::DynamicsError;
use crate::description::{JointKind, RobotDescription};
use kinetoscope_scene::Pose;
use nalgebra::{DVector, Translation3, Unit, UnitQuaternion, Vector3};

/// Interpretation of the positions of mimic joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum MimicPositions {
    /// Derived from the driver by [`Mimic`](crate::description::Mimic); the numbers given for mimic joints are ignored.
    /// Other couplings of MJCF files are not included.
    #[default]
    FollowDriver,
    /// As given, even where they disagree with the driver: MuJoCo's equality constraints may be slightly violated.
    AsGiven,
}

/// Pose of the root and positions of the joints of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration {
    /// Pose of the root link in the world, `world_from_root`.
    pub root_pose: Pose,
    /// True if the root link moves freely. Its six degrees of freedom then precede all others.
    pub floating_base: bool,
    /// Position \[rad or m\] of each joint of [`RobotDescription::drivable_joints`], in that order, mimic joints
    /// included.
    pub joint_positions: Vec<f64>,
    /// Interpretation of the positions of mimic joints.
    pub mimic: MimicPositions,
    /// Pose `joint_from_child` of each floating and planar joint, in the order of the description; the identity at the
    /// zero position. A planar joint allows a translation perpendicular to its axis and a rotation about its axis.
    /// Other poses are not rejected.
    pub free_joint_poses: Vec<Pose>,
}

impl Configuration {
    /// Creates the configuration with all joints at zero (mimic joints at their offsets) and the root fixed at the
    /// world origin.
    pub fn zero(description: &RobotDescription) -> Self {
        Self {
            root_pose: Pose::identity(),
            floating_base: false,
            joint_positions: vec![0.0; description.drivable_joints().count()],
            mimic: MimicPositions::FollowDriver,
            free_joint_poses: vec![
                Pose::identity();
                description.joints.iter().filter(|j| has_multiple_dofs(j.kind)).count()
            ],
        }
    }

    /// Position \[rad or m\] of each drivable joint, with mimic joints resolved according to [`Self::mimic`].
    ///
    /// # Errors
    ///
    /// [`DynamicsError::WrongLength`] if `joint_positions` does not have one number per drivable joint.
    pub fn resolved_positions(&self, description: &RobotDescription) -> Result<Vec<f64>, DynamicsError> {
        let drivable: Vec<_> = description.drivable_joints().map(|(id, _)| id).collect();
        check_length("joint_positions", drivable.len(), self.joint_positions.len())?;
        if self.mimic == MimicPositions::AsGiven {
            return Ok(self.joint_positions.clone());
        }
        let mut column = vec![None; description.joints.len()];
        for (k, id) in drivable.iter().enumerate() {
            column[id.0] = Some(k);
        }
        let follow = |(k, &id): (usize, &crate::description::JointId)| {
            if description.joint(id).mimic.is_none() {
                return self.joint_positions[k];
            }
            let (driver, multiplier, offset) = description.mimic_driver(id);
            // A driver without a column (a fixed joint) stays at zero.
            multiplier * column[driver.0].map_or(0.0, |c| self.joint_positions[c]) + offset
        };
        Ok(drivable.iter().enumerate().map(follow).collect())
    }

    /// Returns the configuration after motion at the constant generalized velocity `velocity` for `duration` \[s\].
    /// Joint limits are ignored. The layout of the velocity is that of [`Dynamics`](super::Dynamics).
    ///
    /// # Panics
    ///
    /// If the length of `velocity` is not [`Dynamics::dof_count`](super::Dynamics::dof_count).
    #[must_use]
    #[track_caller]
    pub fn integrate(&self, description: &RobotDescription, velocity: &DVector<f64>, duration: f64) -> Self {
        let step = velocity * duration;
        let mut next = self.clone();
        let mut at = 0;
        let mut take = |n: usize| {
            at += n;
            step.rows(at - n, n).into_owned()
        };
        if self.floating_base {
            next.root_pose = integrate_free_pose(&self.root_pose, take(6).as_slice());
        }
        for q in &mut next.joint_positions {
            *q += take(1)[0];
        }
        let free = description.joints.iter().filter(|j| has_multiple_dofs(j.kind));
        for (pose, joint) in next.free_joint_poses.iter_mut().zip(free) {
            *pose = match joint.kind {
                JointKind::Planar => {
                    let s = take(3);
                    let [x, y] = planar_axes(&joint.axis);
                    let shift = x.into_inner() * s[0] + y.into_inner() * s[1];
                    Pose::from_parts(
                        Translation3::from(pose.translation.vector + shift),
                        UnitQuaternion::from_axis_angle(&joint.axis, s[2]) * pose.rotation,
                    )
                }
                _ => integrate_free_pose(pose, take(6).as_slice()),
            };
        }
        assert_eq!(at, step.len(), "one velocity per degree of freedom");
        next
    }
}

/// The two directions of travel of a planar joint, in the joint frame: x and y turned by the shortest rotation that
/// takes z to `axis` (a half turn about x if the axis is -z).
///
/// URDF does not define them. A model of the joint as two slides and a hinge must use these directions.
pub fn planar_axes(axis: &Unit<Vector3<f64>>) -> [Unit<Vector3<f64>>; 2] {
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    [turn * Vector3::x_axis(), turn * Vector3::y_axis()]
}

/// True for joint types with several degrees of freedom.
pub(super) fn has_multiple_dofs(kind: JointKind) -> bool {
    matches!(kind, JointKind::Floating | JointKind::Planar)
}

pub(super) fn check_length(what: &'static str, expected: usize, found: usize) -> Result<(), DynamicsError> {
    if expected == found { Ok(()) } else { Err(DynamicsError::WrongLength { what, expected, found }) }
}

/// Moves a pose by `step`: translation in the axes of the parent, then rotation in the axes of the child.
fn integrate_free_pose(pose: &Pose, step: &[f64]) -> Pose {
    Pose::from_parts(
        Translation3::from(pose.translation.vector + Vector3::new(step[0], step[1], step[2])),
        pose.rotation * UnitQuaternion::from_scaled_axis(Vector3::new(step[3], step[4], step[5])),
    )
}

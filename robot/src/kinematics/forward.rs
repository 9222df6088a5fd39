//! Forward kinematics: poses of frames and of links.

use super::chain::{Chain, MimicRelation, joint_transform, mimic_relations};
use crate::description::{JointKind, LinkId, RobotDescription};
use kinetoscope_scene::Pose;

impl Chain {
    /// Pose of the chain's frame in the frame of the base link. `positions` \[rad or m\] has one value for each
    /// variable: for each drivable joint of the robot, unless the chain is [reduced](Self::reduced).
    ///
    /// Source: a product of transforms, one per joint (Siciliano et al., "Robotics", Springer 2009, section 2.8).
    ///
    /// # Panics
    /// If there are fewer positions than [`variables`](Self::variables).
    #[track_caller]
    pub fn pose(&self, positions: &[f64]) -> Pose {
        let mut pose = Pose::identity();
        for joint in &self.joints {
            pose = pose * joint.parent_from_joint * joint.transform(positions);
        }
        pose *= self.last_from_frame;
        // Without this, rounding errors would add up along very long chains.
        pose.rotation.renormalize();
        pose
    }
}

/// Poses of all links, indexed by [`LinkId`], at `positions` \[rad or m\], one for each drivable joint. Values of mimic
/// joints are ignored; they follow their drivers.
///
/// `standing` returns the pose of the root link and of each child of a floating or planar joint. The result has the
/// same reference frame as these poses.
///
/// # Panics
/// If there are fewer positions than drivable joints.
pub fn link_poses(description: &RobotDescription, positions: &[f64], standing: impl Fn(LinkId) -> Pose) -> Vec<Pose> {
    let follows = mimic_relations(description);
    let mut poses = vec![Pose::identity(); description.links.len()];
    poses[description.root.0] = standing(description.root);
    let mut open = vec![description.root];
    while let Some(parent) = open.pop() {
        for &id in &description.link(parent).child_joints {
            let joint = description.joint(id);
            let MimicRelation { column, ratio, offset } = follows[id.0];
            let position = || column.map_or(0.0, |c| ratio * positions[c]) + offset;
            let world_from_joint = poses[parent.0] * joint.parent_from_joint;
            let mut pose = match joint.kind {
                JointKind::Fixed => world_from_joint,
                JointKind::Revolute | JointKind::Continuous => {
                    world_from_joint * joint_transform(false, &joint.axis, position())
                }
                JointKind::Prismatic => world_from_joint * joint_transform(true, &joint.axis, position()),
                JointKind::Floating | JointKind::Planar => standing(joint.child),
            };
            pose.rotation.renormalize();
            poses[joint.child.0] = pose;
            open.push(joint.child);
        }
    }
    poses
}

//! Kinematic chain from a base link to a frame.

use super::KinematicsError;
use crate::description::{JointId, JointKind, LinkId, RobotDescription};
use kinetoscope_scene::Pose;
use nalgebra::{Translation3, Unit, UnitQuaternion, Vector3};

/// Kinematic chain from a base link to a frame, in a form that is fast to evaluate. Fixed joints are folded into the
/// poses between moving joints. A mimic joint moves by the variable of its driver.
///
/// The base of [`Chain::new`] is the root link, or the child of the last floating or planar joint above the frame;
/// [`Chain::between`] starts at any link below that. Floating and planar
/// joints have no column; callers must know the pose of their child.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    pub(super) base: LinkId,
    pub(super) joints: Vec<ChainJoint>,
    /// Pose of the frame relative to the child of the last joint; relative to the base in a chain without joints.
    pub(super) last_from_frame: Pose,
}

/// Joint of a chain, which moves everything behind it by one variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ChainJoint {
    /// Pose of the joint relative to the child of the previous joint; relative to the base for the first joint.
    pub(super) parent_from_joint: Pose,
    /// Axis in the joint's frame.
    pub(super) axis: Unit<Vector3<f64>>,
    /// True for a translation along the axis, false for a rotation about it.
    pub(super) is_prismatic: bool,
    /// Index of the variable among those of the chain.
    pub(super) variable: usize,
    /// Position of the joint = ratio * variable + offset.
    pub(super) ratio: f64,
    pub(super) offset: f64,
}

impl ChainJoint {
    /// Pose of the child in the frame of the joint.
    pub(super) fn transform(&self, positions: &[f64]) -> Pose {
        joint_transform(self.is_prismatic, &self.axis, self.ratio * positions[self.variable] + self.offset)
    }
}

/// Pose of a child in the frame of its joint at `position` \[rad or m\].
pub(super) fn joint_transform(slides: bool, axis: &Unit<Vector3<f64>>, position: f64) -> Pose {
    if slides {
        Pose::from_parts(Translation3::from(axis.into_inner() * position), UnitQuaternion::identity())
    } else {
        Pose::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(axis, position))
    }
}

/// Joint position as a linear function of a column: `ratio * positions[column] + offset`; `offset` alone without a
/// column.
#[derive(Clone, Copy, Debug)]
pub(super) struct MimicRelation {
    pub(super) column: Option<usize>,
    pub(super) ratio: f64,
    pub(super) offset: f64,
}

/// Expresses the position of every joint as a function of one column: its own, or that of its mimic driver. The column
/// is `None` if that joint cannot move. Columns are those of [`RobotDescription::drivable_joints`].
pub(super) fn mimic_relations(description: &RobotDescription) -> Vec<MimicRelation> {
    let mut column = vec![None; description.joints.len()];
    for (k, (id, _)) in description.drivable_joints().enumerate() {
        column[id.0] = Some(k);
    }
    let of = |index: usize| {
        let (driver, ratio, offset) = description.mimic_driver(JointId(index));
        // A driver that cannot move stays at zero and has no column.
        MimicRelation { column: column[driver.0], ratio, offset }
    };
    (0..description.joints.len()).map(of).collect()
}

impl Chain {
    /// Builds the chain to a frame at `link_from_frame` on `link`.
    ///
    /// The variables of the chain are the columns of [`RobotDescription::drivable_joints`]. Positions have as many
    /// entries; entries of mimic joints and of joints outside the chain are ignored. A joint with a polynomial coupling
    /// of an MJCF file counts as a free joint.
    ///
    /// # Errors
    /// The link does not exist, or it is not connected to the root.
    pub fn new(description: &RobotDescription, link: LinkId, link_from_frame: &Pose) -> Result<Self, KinematicsError> {
        Self::build(description, None, link, link_from_frame)
    }

    /// Builds the chain from the link `base` to a frame at `link_from_frame` on `link`. Variables are those of
    /// [`new`](Self::new).
    ///
    /// # Errors
    /// Same errors as [`new`](Self::new). `base` is neither `link` nor above it, or a floating or planar joint lies
    /// between them.
    pub fn between(
        description: &RobotDescription,
        base: LinkId,
        link: LinkId,
        link_from_frame: &Pose,
    ) -> Result<Self, KinematicsError> {
        let count = description.links.len();
        if base.0 >= count {
            return Err(KinematicsError::NoSuchLink { index: base.0, count });
        }
        Self::build(description, Some(base), link, link_from_frame)
    }

    fn build(
        description: &RobotDescription,
        wanted_base: Option<LinkId>,
        link: LinkId,
        link_from_frame: &Pose,
    ) -> Result<Self, KinematicsError> {
        let count = description.links.len();
        if link.0 >= count {
            return Err(KinematicsError::NoSuchLink { index: link.0, count });
        }
        let not_a_tree = || KinematicsError::NotATree { link: description.links[link.0].name.clone() };
        let (mut base, mut path) = (link, Vec::new());
        while wanted_base != Some(base)
            && let Some(id) = description.link(base).parent_joint
        {
            let joint = description.joints.get(id.0).ok_or_else(not_a_tree)?;
            if matches!(joint.kind, JointKind::Floating | JointKind::Planar) {
                break;
            }
            if path.len() == count || joint.parent.0 >= count {
                return Err(not_a_tree());
            }
            path.push(id);
            base = joint.parent;
        }
        if let Some(wanted) = wanted_base.filter(|&wanted| wanted != base) {
            let name = |link: LinkId| description.link(link).name.clone();
            return Err(KinematicsError::BaseNotAbove {
                base: name(wanted),
                link: name(link),
                above: path.iter().map(|&id| name(description.joint(id).parent)).collect(),
            });
        }
        let follows = mimic_relations(description);
        let (mut joints, mut parent_from_joint) = (Vec::new(), Pose::identity());
        for &id in path.iter().rev() {
            let joint = description.joint(id);
            parent_from_joint *= joint.parent_from_joint;
            if !joint.kind.is_drivable() {
                continue;
            }
            let (is_prismatic, axis) = (joint.kind == JointKind::Prismatic, joint.axis);
            let MimicRelation { column, ratio, offset } = follows[id.0];
            match column {
                Some(variable) => {
                    joints.push(ChainJoint { parent_from_joint, axis, is_prismatic, variable, ratio, offset });
                    parent_from_joint = Pose::identity();
                }
                None => parent_from_joint *= joint_transform(is_prismatic, &axis, offset),
            }
        }
        Ok(Self { base, joints, last_from_frame: parent_from_joint * link_from_frame })
    }

    /// Base link, in whose frame the poses of the chain are given.
    pub fn base(&self) -> LinkId {
        self.base
    }

    /// Largest index of a variable that the chain uses, plus one: the minimum number of positions for
    /// [`pose`](Self::pose).
    pub fn variables(&self) -> usize {
        self.joints.iter().map(|joint| joint.variable + 1).max().unwrap_or(0)
    }

    /// True if a variable moves the frame, directly or by a mimic joint. False for an index out of range.
    pub fn is_moved_by(&self, variable: usize) -> bool {
        self.joints.iter().any(|joint| joint.variable == variable && joint.ratio != 0.0)
    }

    /// Sum of the distances from the base over all joints to the frame \[m\]. With prismatic joints at zero, the frame
    /// is never farther from the base.
    pub fn reach(&self) -> f64 {
        let between = |pose: &Pose| pose.translation.vector.norm();
        self.joints.iter().map(|joint| between(&joint.parent_from_joint)).sum::<f64>() + between(&self.last_from_frame)
    }

    /// True if a full turn of the variable leaves the frame unchanged: the variable rotates joints only, and the ratios
    /// of its followers are integers.
    pub(super) fn is_full_turn_periodic(&self, variable: usize) -> bool {
        self.joints.iter().filter(|joint| joint.variable == variable).all(|j| !j.is_prismatic && j.ratio.fract() == 0.0)
    }

    /// Returns the chain with the variables `free` only, renumbered in that order. All other variables are fixed at
    /// `positions` \[rad or m\], one for each variable of this chain.
    ///
    /// # Panics
    /// If `positions` has fewer numbers than the chain has [`variables`](Self::variables).
    #[must_use]
    #[track_caller]
    pub fn reduced(&self, free: &[usize], positions: &[f64]) -> Self {
        let mut variable_of = vec![None; positions.len()];
        for (k, &variable) in free.iter().enumerate() {
            if let Some(entry) = variable_of.get_mut(variable) {
                *entry = Some(k);
            }
        }
        let mut held = Self { base: self.base, joints: Vec::new(), last_from_frame: Pose::identity() };
        self.reduce_into(&variable_of, positions, &mut held);
        held
    }

    /// Writes the chain that [`reduced`](Self::reduced) returns to `held`, and allocates only if `held` has too little
    /// memory for its joints. `variable_of` gives the new index of each variable that stays free, and `None` for each
    /// variable that is fixed at its value in `positions`.
    ///
    /// # Panics
    /// If `variable_of` has fewer entries than the chain has [`variables`](Self::variables), or `positions` has no
    /// value for a fixed variable.
    #[track_caller]
    pub fn reduce_into(&self, variable_of: &[Option<usize>], positions: &[f64], held: &mut Self) {
        held.base = self.base;
        held.joints.clear();
        let mut parent_from_joint = Pose::identity();
        for joint in &self.joints {
            parent_from_joint *= joint.parent_from_joint;
            match variable_of[joint.variable] {
                Some(variable) => {
                    held.joints.push(ChainJoint { parent_from_joint, variable, ..*joint });
                    parent_from_joint = Pose::identity();
                }
                None => parent_from_joint *= joint.transform(positions),
            }
        }
        held.last_from_frame = parent_from_joint * self.last_from_frame;
    }
}

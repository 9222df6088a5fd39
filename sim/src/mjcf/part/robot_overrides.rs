//! Changes to the elements of an MJCF robot file when it is written as a part of the scene's document.

use super::super::document::Inertial;
use std::collections::{BTreeMap, BTreeSet};

/// Changes to an MJCF file in a part that is a robot.
///
/// These elements of the file are omitted: geoms, sites, cameras and lights of the file's world, actuators, actuator
/// force limits of joints, contact exclusions with the world, and the geom pairs in `pairs`.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotOverrides {
    /// Passive properties of each joint of the file.
    pub joints: Vec<PassiveJointProperties>,
    /// Attachment of the root body.
    pub base: RootAttachment,
    /// MuJoCo's `contype` and `conaffinity` for every geom that collides in the file or is in `colliding`.
    pub contact: [i32; 2],
    /// Indices, in the file's model, of the geom pairs that are omitted.
    pub pairs: BTreeSet<usize>,
    /// Indices, in the file's model, of geoms that collide although the bits in the file disable their collisions.
    pub colliding: BTreeSet<usize>,
    /// Mass properties that replace those of the file, by index of the body in the file's model.
    pub inertials: BTreeMap<usize, Inertial>,
}

/// Passive properties of each degree of freedom of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassiveJointProperties {
    /// Viscous damping \[N m s/rad or N s/m\].
    pub damping: f64,
    /// Rotor inertia \[kg m² or kg\].
    pub armature: f64,
    /// Dry friction \[N m or N\].
    pub frictionloss: f64,
}

/// Attachment of a root body to the world.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RootAttachment {
    /// Joints as in the file.
    AsFile,
    /// Fixed in the world: the free joint with this index is not written.
    Fixed(usize),
    /// Free joint that the file does not have.
    Free {
        /// Index of the body in the file's model.
        body: usize,
        /// Full name of the joint.
        name: String,
    },
}

//! How a part is written that is a robot: what differs from its file.

use super::super::document::Inertial;
use std::collections::{BTreeMap, BTreeSet};

/// What differs from the file in a part that is a robot: what stands in the file's world, actuators, the joints' limits of
/// actuators' forces, excluded bodies together with the world, and the pairs in `pairs` are not written at all.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// Passive properties of each joint of the file.
    pub joints: Vec<Passive>,
    /// What holds its root body.
    pub base: Base,
    /// MuJoCo's `contype` and `conaffinity` of every geom that collides in the file.
    pub contact: [i32; 2],
    /// Pairs of geoms that are left out, by their numbers.
    pub pairs: BTreeSet<usize>,
    /// Geoms that collide though the file's bits say that they do not, by their numbers.
    pub colliding: BTreeSet<usize>,
    /// Mass properties of bodies that are not the file's.
    pub inertials: BTreeMap<usize, Inertial>,
}

/// Passive properties of each degree of freedom of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passive {
    /// Viscous damping \[N m s/rad or N s/m\].
    pub damping: f64,
    /// Rotor inertia \[kg m² or kg\].
    pub armature: f64,
    /// Dry friction \[N m or N\].
    pub frictionloss: f64,
}

/// What holds a root body.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Base {
    /// The joints that the file gives it.
    AsFile,
    /// Nothing lets it move: its free joint, of this number, is not written.
    Fixed(usize),
    /// A free joint of this name, which the file does not have.
    Free {
        /// The body.
        body: usize,
        /// Full name of the joint.
        name: String,
    },
}

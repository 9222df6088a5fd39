//! Data of groups of rigid objects.

use crate::objects::rigid_object_data::RigidObjectCfg;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Configuration of a group of rigid objects.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RigidObjectGroupCfg {
    /// Name of the group, unique in the simulation.
    pub uid: String,
    /// Objects of the group, in the order in which they are read and written. The name of an object in the simulation
    /// is the group's name, a point and its own name: `blocks.red`.
    pub objects: Vec<RigidObjectCfg>,
}

impl Default for RigidObjectGroupCfg {
    /// Empty group, to be filled in.
    fn default() -> Self {
        Self { uid: "group".into(), objects: Vec::new() }
    }
}

/// Handle of a group of rigid objects; valid for the manager that created it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RigidObjectGroupId {
    pub(super) manager: u64,
    pub(super) index: usize,
}

/// Group of a simulation, as a range of its objects.
#[derive(Clone, Debug)]
pub(crate) struct RigidObjectGroupData {
    pub(crate) uid: String,
    pub(crate) objects: Range<usize>,
}

//! Groups of rigid objects as they were added.

use crate::objects::rigid_object_data::RigidObjectCfg;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Configuration of a group of rigid objects.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RigidObjectGroupCfg {
    /// Name of the group, unique in the simulation.
    pub uid: String,
    /// Its objects, in the order in which they are read and written. In the simulation each is called by the group's name, a
    /// point and its own: `blocks.red`.
    pub objects: Vec<RigidObjectCfg>,
}

impl Default for RigidObjectGroupCfg {
    /// A group of nothing, which is to be filled in.
    fn default() -> Self {
        Self { uid: "group".into(), objects: Vec::new() }
    }
}

/// Handle of a group of rigid objects; valid for the manager that made it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct GroupId {
    pub(super) manager: u64,
    pub(super) index: usize,
}

/// A group that was added: which of the objects it is.
#[derive(Clone, Debug)]
pub(crate) struct GroupData {
    pub(crate) uid: String,
    pub(crate) objects: Range<usize>,
}

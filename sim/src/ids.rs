//! Handles of environments and entities.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Index of an environment of this process, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct EnvId(pub usize);

/// Handle of a robot, valid for the manager that created it. A passive articulation has such a handle too.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RobotId {
    pub(crate) manager: u64,
    pub(crate) index: usize,
}

/// Handle of a rigid object, valid for the manager that created it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RigidObjectId {
    pub(crate) manager: u64,
    pub(crate) index: usize,
}

/// Handle of an attached MJCF file, valid for the manager that created it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MjcfId {
    pub(crate) manager: u64,
    pub(crate) index: usize,
}

/// Handle of a terrain, valid for the manager that created it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TerrainId {
    pub(crate) manager: u64,
    pub(crate) index: usize,
}

/// Mask of the selected environments, shape (num_envs,); all are selected for `None`. Repeated ids are allowed; an id
/// out of range is an error.
pub(crate) fn env_mask(env_ids: Option<&[EnvId]>, num_envs: usize) -> Result<Vec<bool>> {
    let Some(ids) = env_ids else { return Ok(vec![true; num_envs]) };
    let mut mask = vec![false; num_envs];
    for &EnvId(index) in ids {
        *mask.get_mut(index).ok_or(Error::UnknownIndex { what: "environment", index, count: num_envs })? = true;
    }
    Ok(mask)
}

/// Indices of the selected environments in the given order; all environments for `None`. Repeated ids are allowed; an
/// id out of range is an error.
pub(crate) fn env_list(env_ids: Option<&[EnvId]>, num_envs: usize) -> Result<Vec<usize>> {
    env_mask(env_ids, num_envs)?;
    Ok(env_ids.map_or_else(|| (0..num_envs).collect(), |ids| ids.iter().map(|id| id.0).collect()))
}

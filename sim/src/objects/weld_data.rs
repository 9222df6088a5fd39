//! Data of welds.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Configuration of a weld. It does not hold until it is [attached](crate::WeldMut::attach).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WeldCfg {
    /// Name of the weld, unique in the simulation.
    pub uid: String,
    /// First body: the uid of an object, `uid/link` of a robot, `uid/body` of an MJCF part, or `world`. A link behind a
    /// fixed joint is one body with its parent link.
    pub first: String,
    /// Second body, named like the first.
    pub second: String,
}

impl Default for WeldCfg {
    /// Weld without bodies: both names must be filled in.
    fn default() -> Self {
        Self { uid: "weld".into(), first: String::new(), second: String::new() }
    }
}

/// Handle of a weld; valid for the manager that created it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct WeldId {
    pub(super) manager: u64,
    pub(super) index: usize,
}

/// Weld of a simulation.
#[derive(Clone, Debug)]
pub(crate) struct WeldData {
    pub(crate) cfg: Arc<WeldCfg>,
    /// True if the second body is fixed or kinematic, and the first is not.
    pub(crate) second_is_fixed: bool,
}

//! Welds as they were added.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Configuration of a weld. It holds nothing until it is [attached](crate::WeldMut::attach).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WeldCfg {
    /// Name of the weld, unique in the simulation.
    pub uid: String,
    /// The one body: the uid of an object, `uid/link` of a robot, `uid/body` of an MJCF part, or `world`. A link that a fixed
    /// joint holds is one body with the link that carries it.
    pub first: String,
    /// The other one.
    pub second: String,
}

impl Default for WeldCfg {
    /// A weld of nothing: both names are to be filled in.
    fn default() -> Self {
        Self { uid: "weld".into(), first: String::new(), second: String::new() }
    }
}

/// Handle of a weld; valid for the manager that made it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct WeldId {
    pub(super) manager: u64,
    pub(super) index: usize,
}

/// A weld that was added.
#[derive(Clone, Debug)]
pub(crate) struct WeldData {
    pub(crate) cfg: Arc<WeldCfg>,
    /// True if the second body is fixed or kinematic, and the first is not.
    pub(crate) second_is_fixed: bool,
}

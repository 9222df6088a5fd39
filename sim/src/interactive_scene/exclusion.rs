//! Collision exclusions of a scene.

use crate::error::{Error, Result};
use crate::manager::SimulationManager;
use crate::pattern::strip_env_prefix;
use kinetoscope_scene::source_location::SourceLocation;

/// Pair of bodies or robots whose contacts are excluded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExclusionCfg {
    /// Names, as in [`SimulationManager::exclude_collision`]; a prefix `{ENV}/` or `{ENV_REGEX_NS}/` is ignored.
    pub pair: [String; 2],
    /// File and line of the declaration, for error messages; `None` for a scene from Rust.
    pub at: Option<SourceLocation>,
}

impl ExclusionCfg {
    /// Adds the exclusion to a simulation.
    pub(super) fn add_to(&self, sim: &mut SimulationManager) -> Result<()> {
        let [one, other] = [&self.pair[0], &self.pair[1]].map(|name| strip_env_prefix(name));
        sim.exclude_collision(one, other).map_err(|error| match &self.at {
            Some(at) => Error::Exclusion { at: at.clone(), error: Box::new(error) },
            None => error,
        })
    }
}

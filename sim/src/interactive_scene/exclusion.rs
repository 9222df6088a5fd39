//! Pairs of a scene that never collide.

use crate::error::{Error, Result};
use crate::manager::SimulationManager;
use crate::pattern::in_every_env;
use kinetoscope_scene::source::Source;

/// Two things of a scene that pass through each other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExclusionCfg {
    /// Their names, as in [`SimulationManager::exclude_collision`]; `{ENV}/` before one changes nothing.
    pub between: [String; 2],
    /// Where it was declared: errors say it. A scene of Rust needs none.
    pub at: Option<Source>,
}

impl ExclusionCfg {
    /// Excludes the pair in a simulation.
    pub(super) fn add_to(&self, sim: &mut SimulationManager) -> Result<()> {
        let [one, other] = [&self.between[0], &self.between[1]].map(|name| in_every_env(name));
        sim.exclude_collision(one, other).map_err(|error| match &self.at {
            Some(at) => Error::Exclusion { at: at.clone(), error: Box::new(error) },
            None => error,
        })
    }
}

//! Collision exclusions of a scene.

use crate::error::{Error, Result};
use crate::manager::SimulationManager;
use crate::pattern::in_every_env;
use kinetoscope_scene::source::Source;

/// Pair of bodies or robots that never collide.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExclusionCfg {
    /// Names, as in [`SimulationManager::exclude_collision`]; a prefix `{ENV}/` is ignored.
    pub between: [String; 2],
    /// File and line of the declaration, for error messages; `None` for a scene from Rust.
    pub at: Option<Source>,
}

impl ExclusionCfg {
    /// Adds the exclusion to a simulation.
    pub(super) fn add_to(&self, sim: &mut SimulationManager) -> Result<()> {
        let [one, other] = [&self.between[0], &self.between[1]].map(|name| in_every_env(name));
        sim.exclude_collision(one, other).map_err(|error| match &self.at {
            Some(at) => Error::Exclusion { at: at.clone(), error: Box::new(error) },
            None => error,
        })
    }
}

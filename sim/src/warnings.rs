//! Counts of warnings.

use crate::env::{EnvStatus, Stage};
use crate::error::Result;
use crate::ids::{EnvId, env_mask};
use crate::manager::SimulationManager;
use kinetoscope_mujoco as mj;
use kinetoscope_robot::diagnostic::count_by_name;
use std::collections::BTreeMap;

impl SimulationManager {
    /// Counts of warnings since the simulation was created.
    pub fn warnings(&self) -> Warnings<'_> {
        Warnings::new(self)
    }
}

/// Counts of warnings since the simulation was created; see [`SimulationManager::warnings`].
#[derive(Clone, Copy, Debug)]
pub struct Warnings<'a> {
    sim: &'a SimulationManager,
}

impl<'a> Warnings<'a> {
    pub(crate) fn new(sim: &'a SimulationManager) -> Self {
        Self { sim }
    }

    /// Counts of all warnings that occurred, by name: diagnostics and MuJoCo's warnings over all environments.
    /// `environment-diverged` is the number of environments that are diverged now; a reset ends it. Names that did not
    /// occur are omitted.
    pub fn counts(&self) -> BTreeMap<String, u64> {
        let mut counts: BTreeMap<String, u64> =
            count_by_name(self.sim.diagnostics()).into_iter().map(|(name, n)| (name.to_string(), n as u64)).collect();
        let mut mujoco = mj::WarningCounts::default();
        let mut diverged = 0;
        let mut of_envs = vec![(mj::WarningCounts::default(), false); self.sim.num_envs()];
        // The forward pass of the current state may warn, too.
        self.sim.simulation.batch.read_all(Stage::Forward, &mut of_envs, |_, env, of_env| {
            of_env[0] = (*env.warnings(), *env.status() != EnvStatus::Running);
        });
        for (warnings, is_diverged) in &of_envs {
            mujoco.add(warnings);
            diverged += u64::from(*is_diverged);
        }
        for (warning, n) in mj::Warning::ALL.iter().zip(mujoco.0) {
            if n > 0 {
                counts.insert(warning.name().into(), n);
            }
        }
        if diverged > 0 {
            counts.insert("environment-diverged".into(), diverged);
        }
        counts
    }

    /// Counts of MuJoCo's warnings in one environment, by name. Warnings that did not occur are omitted.
    ///
    /// # Errors
    /// The environment does not exist.
    pub fn env_counts(&self, env: EnvId) -> Result<BTreeMap<&'static str, u64>> {
        env_mask(Some(&[env]), self.sim.num_envs())?;
        let counts = self.sim.simulation.batch.read(env.0, |env| *env.warnings());
        Ok(mj::Warning::ALL.iter().map(|w| (w.name(), counts.get(*w))).filter(|(_, n)| *n > 0).collect())
    }

    /// Number of times buffers of contacts, constraints or the solver's stack were doubled. Every thread has buffers of
    /// its own, so the number depends on the number of threads and varies between runs; results of steps do not.
    pub fn buffer_growths(&self) -> u64 {
        self.sim.simulation.batch.buffer_growths()
    }
}

//! Snapshots: states of environments, to restore, to continue elsewhere, and to save in files.

mod bytes;
mod error;
mod file;
mod layout;
mod properties;

pub use error::SnapshotError;
pub(crate) use layout::StateLayout;
pub(crate) use properties::SavedProperties;

use crate::env::{EnvState, Stage};
use crate::error::Result;
use crate::ids::{EnvId, env_list};
use crate::manager::SimulationManager;
use crate::simulation::Simulation;
use std::sync::Arc;

/// States of environments, cheap to clone.
///
/// A snapshot holds everything that determines how an environment continues: time, positions with quaternions before
/// normalization, velocities, activations, and the solver's warm start. It holds user inputs: controls, applied forces,
/// poses of mocap bodies, active welds with their relative poses, active flags of equalities (MuJoCo 4), and wrenches
/// and gravity compensation of links. Of drives it holds targets, gains and limits as set, the last efforts, and the
/// memory of explicit models, such as delayed targets. It also holds the count of steps, and the divergence with its
/// reason. An environment with the same properties continues from it bit-identically, in any manager that was built by
/// the same program with the same MuJoCo version, for any number of threads.
///
/// It also holds the [properties](crate::EnvProperties) of each environment, by name: masses, friction, sizes,
/// randomized gains, and the number of randomizations. They belong to the environment, not to its state:
/// [`restore`](SimulationManager::restore) keeps the properties of the target environment, so that every randomization
/// can be followed by a reset to the same start. (For a drive with a randomized gain, the setting before the
/// randomization is restored.) [`EnvPropertiesMut::restore`](crate::EnvPropertiesMut::restore) restores properties too.
///
/// It does not hold:
///
/// * Sensors. Those of restored environments restart as after a reset: they show the restored state at once, histories
///   are empty, and their periods count from there. A sensor may have a user's own type with unknown memory, and
///   measurements of one run would not belong to the other.
/// * The model that all environments share. A snapshot of a scene with another time step, number of substeps,
///   integrator or friction cone is rejected.
/// * Statistics: counts of warnings and of grown buffers.
#[derive(Clone, Debug)]
pub struct Snapshot {
    layout: Arc<StateLayout>,
    entries: Arc<[EnvEntry]>,
}

/// Saved state and properties of one environment.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct EnvEntry {
    /// Index of the environment that the state was taken from.
    pub(crate) env: usize,
    pub(crate) state: EnvState,
    /// Own properties of the environment.
    pub(crate) overrides: Arc<SavedProperties>,
}

impl Snapshot {
    pub(crate) fn new(simulation: &Simulation, entries: Vec<EnvEntry>) -> Self {
        Self { layout: Arc::clone(&simulation.layout), entries: entries.into() }
    }

    /// Number of environments in the snapshot.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// True for a snapshot without environments.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Environments that the snapshot was taken from, in the order given then.
    pub fn env_ids(&self) -> Vec<EnvId> {
        self.entries.iter().map(|entry| EnvId(entry.env)).collect()
    }

    /// Simulation time of each state \[s\].
    pub fn time(&self) -> Vec<f64> {
        self.entries.iter().map(|entry| entry.state.motion.values().first().copied().unwrap_or(0.0)).collect()
    }

    /// Index of the state for each of `requested` environments, after a check that the snapshot is of this scene; a
    /// single state applies to all.
    pub(crate) fn states_for(&self, requested: usize, simulation: &Simulation) -> Result<Vec<usize>> {
        if let Some(difference) = self.layout.difference(&simulation.layout) {
            return Err(SnapshotError::OtherScene { difference }.into());
        }
        let like = simulation.batch.read_at(0, Stage::Raw, |env| env.save_state());
        if !self.entries.iter().all(|entry| entry.state.has_same_lengths(&like)) {
            let difference = "its states have different sizes".into();
            return Err(SnapshotError::OtherScene { difference }.into());
        }
        match self.entries.len() {
            held if held == requested => Ok((0..held).collect()),
            1 => Ok(vec![0; requested]),
            saved => Err(SnapshotError::EnvCount { saved, requested }.into()),
        }
    }

    pub(crate) fn entries(&self) -> &Arc<[EnvEntry]> {
        &self.entries
    }
}

impl SimulationManager {
    /// Takes a snapshot of the current state of environments, in the given order; `None` for all environments.
    /// [`Snapshot`] describes its content.
    ///
    /// # Errors
    /// An environment does not exist.
    pub fn snapshot(&self, env_ids: Option<&[EnvId]>) -> Result<Snapshot> {
        let envs = env_list(env_ids, self.num_envs())?;
        let entry = |env| {
            let state = self.simulation.batch.read_at(env, Stage::Raw, |env| env.save_state());
            EnvEntry { env, state, overrides: self.simulation.own_properties(env, self.randomization_count[env]) }
        };
        Ok(Snapshot::new(&self.simulation, envs.into_iter().map(entry).collect()))
    }

    /// Restores environments from a snapshot: the k-th of `env_ids` from the k-th state, or all of them from a single
    /// state. If `env_ids` is `None`, each state is restored to the environment that it was taken from. For a repeated
    /// environment, the last state counts. Properties of the environments stay. A forward pass follows, and the sensors
    /// of these environments restart, as after a reset.
    ///
    /// # Errors
    /// An environment does not exist, the snapshot is of another scene, or it holds another number of states; then
    /// nothing is restored.
    pub fn restore(&mut self, snapshot: &Snapshot, env_ids: Option<&[EnvId]>) -> Result<()> {
        let sources = self.sources(snapshot, env_ids)?;
        let chosen: Vec<usize> = (0..sources.len()).filter(|&env| sources[env].is_some()).collect();
        self.simulation.batch.run_in(&chosen, |i, env| {
            if let Some(source) = sources[i] {
                env.load_state(&snapshot.entries()[source].state);
            }
        });
        self.sensors.mark_written(&chosen);
        if !self.sensors.is_empty() {
            self.sensors.reset(&chosen, &mut self.simulation);
        }
        Ok(())
    }

    /// Index of the snapshot entry that each environment is restored from; `None` for an environment that is not
    /// restored.
    fn sources(&self, snapshot: &Snapshot, env_ids: Option<&[EnvId]>) -> Result<Vec<Option<usize>>> {
        let taken = snapshot.env_ids();
        let envs = env_list(Some(env_ids.unwrap_or(&taken)), self.num_envs())?;
        let states = snapshot.states_for(envs.len(), &self.simulation)?;
        let mut sources = vec![None; self.num_envs()];
        envs.iter().zip(states).for_each(|(&env, state)| sources[env] = Some(state));
        Ok(sources)
    }
}

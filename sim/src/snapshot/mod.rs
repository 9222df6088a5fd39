//! Snapshots: states of environments, to go back to, to go on from elsewhere, and to keep in a file.

mod bytes;
mod error;
mod file;
mod layout;
mod own;

pub use error::SnapshotError;
pub(crate) use layout::Layout;
pub(crate) use own::OwnProperties;

use crate::env::EnvState;
use crate::error::Result;
use crate::ids::{EnvId, env_list};
use crate::manager::SimulationManager;
use crate::simulation::Simulation;
use std::sync::Arc;

/// States of environments. Cheap to clone.
///
/// A snapshot holds everything that decides how an environment goes on: time, positions with quaternions as they were
/// before they were normalised, velocities, activations, the solver's warm start, what users set (controls, applied forces,
/// bodies moved by hand, welds that hold and how, active equalities), targets, gains, limits, efforts and delays of drives as they were set, wrenches
/// on links, the count of steps, and whether and why it has diverged. Going on from it is bit-identical in any environment
/// with the same properties, of any manager that was built by the same program with the same MuJoCo, for any number of
/// threads.
///
/// It also holds the [properties](crate::EnvProperties) of each environment, by name: masses, friction, sizes, gains that were
/// drawn, and how often it was drawn for. They belong to the environment, not to its state:
/// [`restore`](SimulationManager::restore) leaves those of the environment it goes to alone (of a drive whose gain is drawn,
/// what was set before is restored), as who resets to the same start after every draw wants it.
/// [`EnvPropertiesMut::restore`](crate::EnvPropertiesMut::restore) restores them too.
///
/// It does not hold:
///
/// * Sensors. Those of restored environments start again as after a reset: they show the restored state at once, histories
///   are empty, and their periods count from there. A sensor may be a type of the user's own, whose memory is unknown
///   here; and measurements of one run would not belong to the other.
/// * The model that all environments share. A snapshot of a scene with other steps, another integrator or other friction
///   cones is refused, as that of another scene.
/// * What happened on the way: counts of warnings and of buffers that grew.
#[derive(Clone, Debug)]
pub struct Snapshot {
    layout: Arc<Layout>,
    entries: Arc<[Entry]>,
}

/// The state of one environment.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Entry {
    /// Where it was taken.
    pub(crate) env: usize,
    pub(crate) state: EnvState,
    /// What the environment had for itself.
    pub(crate) own: Arc<OwnProperties>,
}

impl Snapshot {
    pub(crate) fn new(simulation: &Simulation, entries: Vec<Entry>) -> Self {
        Self { layout: Arc::clone(&simulation.layout), entries: entries.into() }
    }

    /// Number of environments in it.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The environments it was taken of, in the order given then.
    pub fn env_ids(&self) -> Vec<EnvId> {
        self.entries.iter().map(|entry| EnvId(entry.env)).collect()
    }

    /// Simulation time of each state \[s\].
    pub fn time(&self) -> Vec<f64> {
        self.entries.iter().map(|entry| entry.state.motion.values().first().copied().unwrap_or(0.0)).collect()
    }

    /// The state for each of `wanted` environments, after checking that it is of this scene; a single one is for all.
    pub(crate) fn states_for(&self, wanted: usize, simulation: &Simulation) -> Result<Vec<usize>> {
        if let Some(difference) = self.layout.difference(&simulation.layout) {
            return Err(SnapshotError::OtherScene { difference }.into());
        }
        let like = simulation.batch.read(0, |env| env.remember());
        if !self.entries.iter().all(|entry| entry.state.fits(&like)) {
            let difference = "its states have other numbers of numbers".into();
            return Err(SnapshotError::OtherScene { difference }.into());
        }
        match self.entries.len() {
            held if held == wanted => Ok((0..held).collect()),
            1 => Ok(vec![0; wanted]),
            held => Err(SnapshotError::Count { held, wanted }.into()),
        }
    }

    pub(crate) fn entries(&self) -> &Arc<[Entry]> {
        &self.entries
    }
}

impl SimulationManager {
    /// The present state of environments, in the order given; of all where `env_ids` is `None`. What it holds and what not
    /// is written at [`Snapshot`].
    ///
    /// # Errors
    /// An environment does not exist.
    pub fn snapshot(&self, env_ids: Option<&[EnvId]>) -> Result<Snapshot> {
        let envs = env_list(env_ids, self.num_envs())?;
        let entry = |env| {
            let state = self.simulation.batch.read(env, |env| env.remember());
            Entry { env, state, own: self.simulation.own_properties(env, self.draws[env]) }
        };
        Ok(Snapshot::new(&self.simulation, envs.into_iter().map(entry).collect()))
    }

    /// Puts environments into states of a snapshot: the k-th of `env_ids` into the k-th state, or all of them into a single
    /// one; each where it was taken where `env_ids` is `None`. Of an environment that is named twice the last state counts.
    /// A forward pass follows, and sensors of these environments start again, as after a reset.
    ///
    /// # Errors
    /// An environment does not exist, the snapshot is of another scene, or it holds another number of states; then nothing
    /// is restored.
    pub fn restore(&mut self, snapshot: &Snapshot, env_ids: Option<&[EnvId]>) -> Result<()> {
        let sources = self.sources(snapshot, env_ids)?;
        let chosen: Vec<usize> = (0..sources.len()).filter(|&env| sources[env].is_some()).collect();
        self.simulation.batch.run(|i, env| {
            if let Some(source) = sources[i] {
                env.recall(&snapshot.entries()[source].state);
            }
        });
        self.sensors.note_written(&chosen);
        if !self.sensors.is_empty() {
            self.sensors.reset(&chosen, &mut self.simulation);
        }
        Ok(())
    }

    /// Which entry of the snapshot each environment goes on from, if any.
    fn sources(&self, snapshot: &Snapshot, env_ids: Option<&[EnvId]>) -> Result<Vec<Option<usize>>> {
        let taken = snapshot.env_ids();
        let envs = env_list(Some(env_ids.unwrap_or(&taken)), self.num_envs())?;
        let states = snapshot.states_for(envs.len(), &self.simulation)?;
        let mut sources = vec![None; self.num_envs()];
        envs.iter().zip(states).for_each(|(&env, state)| sources[env] = Some(state));
        Ok(sources)
    }
}

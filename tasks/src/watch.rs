//! Resets that a task has not asked for: viewers reset environments, and programs do.

use kinetoscope_sim::{Moment, Observer, SimulationManager};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Notes which environments were reset.
#[derive(Clone, Debug)]
pub(crate) struct Watch(Arc<[AtomicBool]>);

impl Watch {
    /// Of so many environments.
    pub(crate) fn new(num_envs: usize) -> Self {
        Self((0..num_envs).map(|_| AtomicBool::new(false)).collect())
    }

    /// Whether an environment was reset since this was cleared.
    pub(crate) fn was_reset(&self, env: usize) -> bool {
        self.0[env].load(Ordering::Relaxed)
    }

    /// Forgets the resets of an environment.
    pub(crate) fn clear(&self, env: usize) {
        self.0[env].store(false, Ordering::Relaxed);
    }
}

impl Observer for Watch {
    fn due_in(&self, _: &SimulationManager) -> u64 {
        u64::MAX
    }

    fn observe(&mut self, _: &mut SimulationManager, moment: &Moment) {
        if let Moment::Reset { env_ids } = moment {
            let known = env_ids.iter().filter_map(|env| self.0.get(env.0));
            known.for_each(|reset| reset.store(true, Ordering::Relaxed));
        }
    }
}

//! The observer of a task. It notes resets that the task has not asked for, by viewers and by programs, and says that the
//! results of steps are published.

use kinetoscope_sim::{Moment, Observer, SimulationManager, StepResult};
use std::any::TypeId;
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

    fn publishes(&self, event: TypeId) -> bool {
        event == TypeId::of::<StepResult>()
    }
}

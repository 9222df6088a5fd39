//! The observer of a task. It records resets that the task did not request, such as those by viewers, and declares that
//! the task publishes [`StepResult`].

use kinetoscope_sim::{Observer, SimEvent, SimulationManager, StepResult};
use std::any::TypeId;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Records which environments were reset.
#[derive(Clone, Debug)]
pub(crate) struct ResetMonitor(Arc<[AtomicBool]>);

impl ResetMonitor {
    /// Creates the monitor of `num_envs` environments.
    pub(crate) fn new(num_envs: usize) -> Self {
        Self((0..num_envs).map(|_| AtomicBool::new(false)).collect())
    }

    /// True if the environment was reset since the last call of [`clear`](Self::clear).
    pub(crate) fn was_reset(&self, env: usize) -> bool {
        self.0[env].load(Ordering::Relaxed)
    }

    /// Clears the reset flag of an environment.
    pub(crate) fn clear(&self, env: usize) {
        self.0[env].store(false, Ordering::Relaxed);
    }
}

impl Observer for ResetMonitor {
    fn due_in(&self, _: &SimulationManager) -> u64 {
        u64::MAX
    }

    fn on_event(&mut self, _: &mut SimulationManager, moment: &SimEvent) {
        if let SimEvent::Reset { env_ids } = moment {
            let known = env_ids.iter().filter_map(|env| self.0.get(env.0));
            known.for_each(|reset| reset.store(true, Ordering::Relaxed));
        }
    }

    fn publishes(&self, event: TypeId) -> bool {
        event == TypeId::of::<StepResult>()
    }
}

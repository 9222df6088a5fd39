//! Truncation after a number of steps.

use crate::termination::TerminationTerm;
use ndarray::Array1;

/// Truncates an episode after `steps` steps of the task (0 acts as 1), in addition to
/// [`EnvCfg::episode_steps`](crate::EnvCfg::episode_steps) and under a name of its own.
pub fn time_out(name: &str, steps: u64) -> TerminationTerm {
    let ends = move |now: &crate::TermContext<'_>| {
        Ok(now.episode_steps().iter().map(|done| *done >= steps).collect::<Array1<bool>>())
    };
    TerminationTerm::new(name, ends).truncating()
}

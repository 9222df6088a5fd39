//! Episodes of a length.

use crate::termination::TerminationTerm;
use ndarray::Array1;

/// Breaks an episode off after so many steps of the task (0: after the first), beside
/// [`EnvCfg::episode_steps`](crate::EnvCfg::episode_steps): under a name of its own.
pub fn time_out(name: &str, steps: u64) -> TerminationTerm {
    let ends = move |now: &crate::Now<'_>| Ok(now.episode_steps().iter().map(|done| *done >= steps).collect::<Array1<bool>>());
    TerminationTerm::new(name, ends).truncating()
}

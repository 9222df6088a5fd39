//! Termination terms: reasons for episodes to end.

use crate::context::TermContext;
use crate::error::{Result, TermKind, TermResult};
use ndarray::Array1;
use std::fmt;

type Condition = Box<dyn Fn(&TermContext<'_>) -> TermResult<Array1<bool>> + Send>;

/// A reason for episodes to end.
///
/// Three reasons need no term: a diverged simulation, a reset from outside the task, and the limit of
/// [`EnvCfg::episode_steps`](crate::EnvCfg::episode_steps).
pub struct TerminationTerm {
    pub(crate) name: String,
    /// True if it truncates episodes instead of terminating them.
    pub(crate) truncates: bool,
    condition: Condition,
}

impl TerminationTerm {
    /// Creates a term that terminates the episodes of all environments for which `ends` returns true, shape (N,). A
    /// terminated episode reached a goal or failed, so no further reward is possible.
    pub fn new(
        name: impl Into<String>,
        ends: impl Fn(&TermContext<'_>) -> TermResult<Array1<bool>> + Send + 'static,
    ) -> Self {
        Self { name: name.into(), truncates: false, condition: Box::new(ends) }
    }

    /// Makes the term truncate episodes instead of terminating them: the task could continue, but the episode is cut
    /// off. Learning algorithms then bootstrap the value of the final observation.
    #[must_use]
    pub fn truncating(self) -> Self {
        Self { truncates: true, ..self }
    }

    /// Evaluates the term for all environments, shape (N,).
    pub(crate) fn evaluate(&self, now: &TermContext<'_>) -> Result<Array1<bool>> {
        now.compute_per_env(TermKind::Termination, &self.name, || (self.condition)(now))
    }
}

impl fmt::Debug for TerminationTerm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = f.debug_struct("TerminationTerm");
        out.field("name", &self.name).field("truncates", &self.truncates).finish_non_exhaustive()
    }
}

//! When episodes end.

use crate::error::{Result, TermKind, TermResult};
use crate::now::Now;
use ndarray::Array1;
use std::fmt;

type Ends = Box<dyn Fn(&Now<'_>) -> TermResult<Array1<bool>> + Send>;

/// A reason for episodes to end. That a step could not be done in an environment is always one, and so is the limit of
/// [`EnvCfg::episode_steps`](crate::EnvCfg::episode_steps): neither needs a term.
pub struct TerminationTerm {
    pub(crate) name: String,
    /// Whether it truncates episodes instead of terminating them.
    pub(crate) truncates: bool,
    ends: Ends,
}

impl TerminationTerm {
    /// Terminates the episodes of those environments for which `ends` gives true, shape (N,): a goal or a failure, after
    /// which nothing more could be earned.
    pub fn new(name: impl Into<String>, ends: impl Fn(&Now<'_>) -> TermResult<Array1<bool>> + Send + 'static) -> Self {
        Self { name: name.into(), truncates: false, ends: Box::new(ends) }
    }

    /// Truncates episodes instead: the task would go on, but is not looked at any longer. Agents that estimate what is still
    /// to be earned do so from the final observation then.
    #[must_use]
    pub fn truncating(self) -> Self {
        Self { truncates: true, ..self }
    }

    /// The environments that end.
    pub(crate) fn ends(&self, now: &Now<'_>) -> Result<Array1<bool>> {
        now.for_each_env(TermKind::Termination, &self.name, (self.ends)(now))
    }
}

impl fmt::Debug for TerminationTerm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = f.debug_struct("TerminationTerm");
        out.field("name", &self.name).field("truncates", &self.truncates).finish_non_exhaustive()
    }
}

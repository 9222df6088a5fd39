//! Environments that diverged.

use crate::ids::EnvId;
use std::fmt;

/// An environment in which a step could not be done. It stands in its last good state until it is reset. Its `Display` is
/// `step 12: bad acceleration`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DivergedEnv {
    /// The environment.
    pub env: EnvId,
    /// Steps that it did before.
    pub step: u64,
    /// Reason, in words.
    pub reason: String,
}

impl fmt::Display for DivergedEnv {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "step {}: {}", self.step, self.reason)
    }
}

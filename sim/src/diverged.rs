//! Environments that diverged.

use crate::ids::EnvId;
use std::fmt;

/// An environment in which a step failed or a written state was rejected. It stays in its last valid state until it is
/// reset. `Display` gives `step 12: bad acceleration`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DivergedEnv {
    /// Environment that diverged.
    pub env: EnvId,
    /// Number of completed MuJoCo steps since the last reset.
    pub step: u64,
    /// Description of the failure.
    pub reason: String,
}

impl fmt::Display for DivergedEnv {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "step {}: {}", self.step, self.reason)
    }
}

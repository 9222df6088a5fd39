//! Errors of batches.

use kinetoscope_mujoco::EngineError;

/// An error of the number of environments or threads, from
/// [`SimulationManager::new`](crate::SimulationManager::new).
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BatchError {
    /// `num_envs` is zero.
    #[error("num_envs is 0; a simulation needs at least 1 environment")]
    NoEnvironments,
    /// `threads` is zero.
    #[error("threads is 0; use at least 1, or leave it out to use every core")]
    NoThreads,
    /// An environment could not be allocated.
    #[error("environment {index}: {error}")]
    Environment {
        /// Index of the environment in the batch.
        index: usize,
        /// Error of the engine.
        #[source]
        error: EngineError,
    },
    /// The operating system refuses to start a thread.
    #[error("cannot start a worker thread: {0}")]
    Thread(String),
}

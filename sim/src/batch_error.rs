//! Errors of batches.

use kinetoscope_mujoco::EngineError;

/// An error of creating the environments, from [`SimulationManager::new`](crate::SimulationManager::new) and from each
/// method that adds an entity.
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
    /// The model has a feature with which a step depends on more than the state that environments keep.
    #[error("the model has {0}, which MuJoCo keeps in its working memory; environments of a batch share that memory")]
    PersistentFeature(&'static str),
    /// The memory for the states of all environments is not available.
    #[error("{num_envs} environments need {} MiB of memory, which is not available; use fewer", bytes >> 20)]
    OutOfMemory {
        /// Number of environments.
        num_envs: usize,
        /// Needed memory \[bytes\].
        bytes: usize,
    },
    /// The operating system refuses to start a thread.
    #[error("cannot start a worker thread: {0}")]
    Thread(String),
}

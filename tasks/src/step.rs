//! The result of a step.

use kinetoscope_sim::EnvId;
use ndarray::{Array1, Array2};
use std::fmt;

/// Result of a step of all environments of a [`VectorEnv`](crate::VectorEnv).
#[derive(Clone, Debug, PartialEq)]
pub struct Step<I = StepInfo> {
    /// Present observations, shape (N, columns of [`observation_space`](crate::VectorEnv::observation_space)). In an
    /// environment whose episode ended in this step, the first observation of the next episode if the mode is
    /// [`AutoresetMode::SameStep`](crate::AutoresetMode::SameStep), else the last one of the ended episode.
    pub observations: Array2<f64>,
    /// Observations that the actions led to, same shape. In an environment whose episode ended, its last observation;
    /// elsewhere equal to `observations`. They differ from `observations` in the mode
    /// [`AutoresetMode::SameStep`](crate::AutoresetMode::SameStep) only.
    pub final_observations: Array2<f64>,
    /// Rewards of this step, shape (N,). In an environment whose episode ended, the last reward of that episode.
    pub rewards: Array1<f64>,
    /// True if the episode reached a terminal state in this step, shape (N,): no further reward is possible. In an
    /// [`Env`](crate::Env), a termination term or a diverged simulation sets it.
    pub terminated: Array1<bool>,
    /// True if the episode was cut off in this step, shape (N,). In an [`Env`](crate::Env), the limit of steps, a
    /// truncating term, or a reset from outside the task sets it. `terminated` may be true as well.
    pub truncated: Array1<bool>,
    /// Additional results of the implementation.
    pub info: I,
}

/// Weighted reward terms and ended episodes of a step of an [`Env`](crate::Env). Final observations are in [`Step`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepInfo {
    /// Weighted rewards of each term, shape (N, reward terms), in the order of
    /// [`Env::reward_names`](crate::Env::reward_names). The sum of a row is the reward of that environment.
    pub reward_terms: Array2<f64>,
    /// The episodes that ended in this step, in the order of environments: Gymnasium's `final_info`.
    pub ended: Vec<EndedEpisode>,
}

/// An episode that ended.
#[derive(Clone, Debug, PartialEq)]
pub struct EndedEpisode {
    /// Environment whose episode ended.
    pub env: EnvId,
    /// Reason for the end.
    pub reason: EndReason,
    /// Number of task steps of the episode.
    pub steps: u64,
    /// Sum of the weighted rewards of each term over the episode, not multiplied by the time step, in the order of
    /// [`Env::reward_names`](crate::Env::reward_names).
    pub reward_sums: Vec<f64>,
}

impl EndedEpisode {
    /// Sum of all rewards of the episode.
    pub fn total_reward(&self) -> f64 {
        self.reward_sums.iter().sum()
    }
}

/// Reason for the end of an episode.
///
/// If there are several, a divergence comes first, then a reset, then the terms in the order in which they were added,
/// then the time limit.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum EndReason {
    /// The simulation diverged, with a description such as `step 12: bad acceleration`. The environment stayed in its
    /// last good state until its reset.
    Diverged(String),
    /// The environment was reset from outside the task: by a viewer, or by the program through
    /// [`Env::sim_mut`](crate::Env::sim_mut). The final observation and reward are those of the state after that reset
    /// and the physics steps that followed.
    Reset,
    /// A termination term, by its name.
    Term(String),
    /// The limit of [`EnvCfg::episode_steps`](crate::EnvCfg::episode_steps).
    TimeLimit,
}

impl fmt::Display for EndReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Diverged(why) => write!(f, "diverged: {why}"),
            Self::Term(name) => f.write_str(name),
            Self::TimeLimit => f.write_str("time limit"),
            Self::Reset => f.write_str("reset from outside the task"),
        }
    }
}

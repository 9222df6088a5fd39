//! What comes of a step.

use kinetoscope_sim::EnvId;
use ndarray::{Array1, Array2};
use std::fmt;

/// What comes of a step of all environments of a [`VectorEnv`](crate::VectorEnv).
#[derive(Clone, Debug, PartialEq)]
pub struct Step<I = Info> {
    /// What is seen now, shape (N, columns of [`observation_space`](crate::VectorEnv::observation_space)): where an episode
    /// ended, the first observation of the next one.
    pub observations: Array2<f64>,
    /// What the actions led to, shaped as the observations: where an episode ended, its last observation, elsewhere the same
    /// numbers as there.
    pub final_observations: Array2<f64>,
    /// Rewards, shape (N,).
    pub rewards: Array1<f64>,
    /// Whether the episode ended by itself, shape (N,): after that nothing more could be earned. Of an [`Env`](crate::Env), by a
    /// termination term or a step that could not be done.
    pub terminated: Array1<bool>,
    /// Whether the episode was broken off, shape (N,). Of an [`Env`](crate::Env), by the limit of steps, a term that truncates, or
    /// a reset behind its back.
    pub truncated: Array1<bool>,
    /// What else the environments tell.
    pub info: I,
}

/// What a step of an [`Env`](crate::Env) tells besides.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Info {
    /// Weighted rewards of each term, shape (N, [`Env::reward_names`](crate::Env::reward_names)); their sums are the rewards.
    pub reward_terms: Array2<f64>,
    /// The episodes that ended, by environment.
    pub ended: Vec<Ended>,
}

/// An episode that ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Ended {
    /// Where.
    pub env: EnvId,
    /// Why.
    pub reason: EndReason,
    /// Steps it had.
    pub steps: u64,
    /// Sum of its weighted rewards by term, in the order of [`Env::reward_names`](crate::Env::reward_names).
    pub reward_sums: Vec<f64>,
}

impl Ended {
    /// Sum of all its rewards.
    pub fn total(&self) -> f64 {
        self.reward_sums.iter().sum()
    }
}

/// Why an episode ended. Where there are several reasons, the first of this list, and of the terms the one that was added
/// first.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EndReason {
    /// A step could not be done: the environment stood in its last good state, and was revived.
    Diverged(String),
    /// Somebody else reset the environment: a viewer, or the program by [`Env::sim_mut`](crate::Env::sim_mut). What is rewarded and
    /// observed last is of the state after that.
    Reset,
    /// A termination term, by name.
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
            Self::Reset => f.write_str("reset by somebody else"),
        }
    }
}

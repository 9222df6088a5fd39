//! Random numbers of tasks.

use kinetoscope_scene::KeyedRng;
use kinetoscope_sim::EnvId;

/// A random number generator for one environment, one episode and one term.
///
/// Its numbers depend only on the seed of the episode, the global index of the environment, the number of the episode
/// since that seed was set, and the kind and name of the term; for interval events and commands that are drawn again,
/// also on the step of the episode.
#[derive(Clone, Debug)]
pub struct EpisodeRng {
    env: EnvId,
    key: EpisodeKey,
    rng: KeyedRng,
}

/// Key of the random numbers of one episode in one environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct EpisodeKey {
    /// Seed of the episodes.
    pub(crate) seed: u64,
    /// Global index of the environment.
    pub(crate) global_env: usize,
    /// Number of the episode since the seed was given, from 0.
    pub(crate) episode: u64,
}

impl EpisodeKey {
    /// Returns the generator of a stream with the name `what`.
    pub(crate) fn rng(&self, what: &str) -> KeyedRng {
        KeyedRng::keyed(self.seed, self.global_env as u64, &format!("env/{what}/{}", self.episode))
    }

    /// Returns the generator with the name `what` for terms, in environment `env` of the manager.
    pub(crate) fn episode_rng(self, env: usize, what: &str) -> EpisodeRng {
        EpisodeRng { env: EnvId(env), key: self, rng: self.rng(what) }
    }
}

impl EpisodeRng {
    /// Index of the environment in its manager.
    pub fn env(&self) -> EnvId {
        self.env
    }

    /// Global index of the environment, counted over all processes of a distributed simulation.
    pub fn global_env(&self) -> usize {
        self.key.global_env
    }

    /// Seed of the episode: the last one given to [`Env::reset`](crate::Env::reset) for this environment, or the
    /// simulation's.
    pub fn seed(&self) -> u64 {
        self.key.seed
    }

    /// Number of the episode since the seed was set, from 0.
    pub fn episode(&self) -> u64 {
        self.key.episode
    }

    /// Returns a uniform number in \[0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.rng.uniform()
    }

    /// Returns a uniform number from `low` to `high`.
    pub fn uniform_range(&mut self, low: f64, high: f64) -> f64 {
        self.rng.uniform_range(low, high)
    }

    /// Returns a number of the standard normal distribution (mean 0, standard deviation 1).
    pub fn normal(&mut self) -> f64 {
        self.rng.normal()
    }
}

/// Returns the environments of the generators that an event gets.
pub fn env_ids(rngs: &[EpisodeRng]) -> Vec<EnvId> {
    rngs.iter().map(EpisodeRng::env).collect()
}

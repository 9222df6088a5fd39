//! Random numbers of tasks.

use kinetoscope_scene::Random;
use kinetoscope_sim::EnvId;

/// A random number generator for one environment, one episode and one term.
///
/// Its numbers depend only on the seed of the episode, the global index of the environment, the number of the episode
/// since that seed was set, and the name of the term.
#[derive(Clone, Debug)]
pub struct Dice {
    env: EnvId,
    key: Key,
    random: Random,
}

/// Key of the random numbers of one episode in one environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Key {
    /// Seed of the episodes.
    pub(crate) seed: u64,
    /// Global index of the environment.
    pub(crate) global: usize,
    /// Number of the episode since the seed was given, from 0.
    pub(crate) episode: u64,
}

impl Key {
    /// Returns the generator of a stream with the name `what`.
    pub(crate) fn random(&self, what: &str) -> Random {
        Random::keyed(self.seed, self.global as u64, &format!("env/{what}/{}", self.episode))
    }

    /// Returns the generator with the name `what` for terms, in environment `env` of the manager.
    pub(crate) fn dice(self, env: usize, what: &str) -> Dice {
        Dice { env: EnvId(env), key: self, random: self.random(what) }
    }
}

impl Dice {
    /// Index of the environment in its manager.
    pub fn env(&self) -> EnvId {
        self.env
    }

    /// Global index of the environment, counted over all processes of a distributed simulation.
    pub fn global_env(&self) -> usize {
        self.key.global
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
        self.random.uniform()
    }

    /// Returns a uniform number from `low` to `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.random.between(low, high)
    }

    /// Returns a number of the standard normal distribution (mean 0, standard deviation 1).
    pub fn normal(&mut self) -> f64 {
        self.random.normal()
    }
}

/// Returns the environments of the generators that an event gets.
pub fn env_ids(dice: &[Dice]) -> Vec<EnvId> {
    dice.iter().map(Dice::env).collect()
}

//! Random numbers of a task.

use kinetoscope_scene::Random;
use kinetoscope_sim::EnvId;

/// Random numbers of one environment in one episode, for one term.
///
/// They depend on the seed of the episode, the global index of the environment, the number of the episode since that seed was
/// given, and what the term is called: on nothing else.
#[derive(Clone, Debug)]
pub struct Dice {
    env: EnvId,
    key: Key,
    random: Random,
}

/// Whose episode it is.
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
    /// The generator of what is called `what`.
    pub(crate) fn random(&self, what: &str) -> Random {
        Random::keyed(self.seed, self.global as u64, &format!("env/{what}/{}", self.episode))
    }

    /// The dice of what is called `what`, in the environment that has the number `env` in its manager.
    pub(crate) fn dice(self, env: usize, what: &str) -> Dice {
        Dice { env: EnvId(env), key: self, random: self.random(what) }
    }
}

impl Dice {
    /// The environment, as its manager counts.
    pub fn env(&self) -> EnvId {
        self.env
    }

    /// Global index of the environment: over all processes that simulate together.
    pub fn global_env(&self) -> usize {
        self.key.global
    }

    /// Seed of the episode: what [`Env::reset`](crate::Env::reset) was given last for the environment.
    pub fn seed(&self) -> u64 {
        self.key.seed
    }

    /// Number of the episode since the seed was given, from 0.
    pub fn episode(&self) -> u64 {
        self.key.episode
    }

    /// Uniform in 0 (included) to 1 (excluded).
    pub fn uniform(&mut self) -> f64 {
        self.random.uniform()
    }

    /// Uniform from `low` to `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.random.between(low, high)
    }

    /// Of the normal distribution with mean 0 and standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        self.random.normal()
    }
}

/// The environments that dice are for.
pub fn env_ids(dice: &[Dice]) -> Vec<EnvId> {
    dice.iter().map(Dice::env).collect()
}

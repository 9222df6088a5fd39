//! Random numbers that depend on what they are for, and on nothing else.
//!
//! Every use has a generator of its own, keyed by the seed of the simulation, the global index of the environment and a
//! name. Threads, the number of environments and what else is random do not change what comes out.

use rand_distr::{Distribution, StandardNormal, StandardUniform};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::SeedableRng;
use sha2::{Digest, Sha256};

/// A generator of random numbers: PCG XSL RR 128/64.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Random(Pcg64);

impl Random {
    /// The generator of the thing called `name` in the environment of global index `env`. Its state is the SHA-256 sum of
    /// all three, so that keys that are alike give numbers that are not.
    pub fn keyed(seed: u64, env: u64, name: &str) -> Self {
        let mut key = Sha256::new();
        key.update(seed.to_le_bytes());
        key.update(env.to_le_bytes());
        key.update(name.as_bytes());
        Self(Pcg64::from_seed(key.finalize().into()))
    }

    /// Uniform in 0 (included) to 1 (excluded).
    pub fn uniform(&mut self) -> f64 {
        StandardUniform.sample(&mut self.0)
    }

    /// Of the normal distribution with mean 0 and standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(seed: u64, env: u64, name: &str) -> [u64; 4] {
        let mut random = Random::keyed(seed, env, name);
        std::array::from_fn(|_| random.uniform().to_bits())
    }

    #[test]
    fn keys() {
        assert_eq!(first(1, 2, "imu"), first(1, 2, "imu"));
        for other in [first(2, 2, "imu"), first(1, 3, "imu"), first(1, 2, "imv"), first(2, 1, "imu")] {
            assert_ne!(first(1, 2, "imu"), other);
        }
    }
}

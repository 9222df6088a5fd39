//! Random numbers that depend only on their use.
//!
//! Every use has its own generator, keyed by the seed of the simulation, the global index of the environment and a
//! name. Its numbers do not depend on threads, the number of environments or other random quantities. [`KeyedRng`]
//! generates a sequence of numbers; [`Philox`] computes the numbers at any counter.

mod philox;

pub use philox::Philox;
use rand_distr::{Distribution, StandardNormal, StandardUniform};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::SeedableRng;
use sha2::{Digest, Sha256};

/// A generator of random numbers: PCG XSL RR 128/64.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyedRng(Pcg64);

impl KeyedRng {
    /// Creates the generator of the use `name` in the environment with global index `env`.
    ///
    /// Its state is the SHA-256 sum of all three arguments, so that similar keys give independent numbers.
    pub fn keyed(seed: u64, env: u64, name: &str) -> Self {
        let mut key = Sha256::new();
        key.update(seed.to_le_bytes());
        key.update(env.to_le_bytes());
        key.update(name.as_bytes());
        Self(Pcg64::from_seed(key.finalize().into()))
    }

    /// Uniform number in 0 (included) to 1 (excluded).
    pub fn uniform(&mut self) -> f64 {
        StandardUniform.sample(&mut self.0)
    }

    /// Uniform number from `low` (included) to `high` (excluded, except by rounding).
    pub fn uniform_range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Normal number with mean 0 and standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(seed: u64, env: u64, name: &str) -> [u64; 4] {
        let mut random = KeyedRng::keyed(seed, env, name);
        std::array::from_fn(|_| random.uniform().to_bits())
    }

    #[test]
    fn keys() {
        assert_eq!(first(1, 2, "imu"), first(1, 2, "imu"));
        for other in [first(2, 2, "imu"), first(1, 3, "imu"), first(1, 2, "imv"), first(2, 1, "imu")] {
            assert_ne!(first(1, 2, "imu"), other);
        }
    }

    /// Means of n numbers scatter by sigma / sqrt(n), variances of normal ones by sqrt(2 / n), those of uniform ones by
    /// sqrt(1/180 / n). Limits of six times that fail once in 5e8 seeds, and the seeds here are fixed.
    #[test]
    fn moments() {
        let n = 100_000;
        let moments = |mut next: Box<dyn FnMut() -> f64>| {
            let values: Vec<f64> = (0..n).map(|_| next()).collect();
            let mean = values.iter().sum::<f64>() / f64::from(n);
            (mean, values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / f64::from(n))
        };
        let root = f64::from(n).sqrt();
        let mut random = KeyedRng::keyed(7, 0, "normal");
        let (mean, variance) = moments(Box::new(move || random.normal()));
        assert!(mean.abs() < 6.0 / root && (variance - 1.0).abs() < 6.0 * 2.0_f64.sqrt() / root, "{mean} {variance}");
        let mut random = KeyedRng::keyed(7, 0, "uniform");
        let (mean, variance) = moments(Box::new(move || random.uniform()));
        assert!((mean - 0.5).abs() < 6.0 * (1.0_f64 / 12.0).sqrt() / root, "{mean}");
        assert!((variance - 1.0 / 12.0).abs() < 6.0 * (1.0_f64 / 180.0).sqrt() / root, "{variance}");
    }

    /// Neighboring environments are independent: the correlation of n independent pairs scatters by 1 / sqrt(n).
    #[test]
    fn correlation() {
        let n = 100_000;
        let (mut a, mut b) = (KeyedRng::keyed(0, 0, "x"), KeyedRng::keyed(0, 1, "x"));
        let sum: f64 = (0..n).map(|_| a.normal() * b.normal()).sum();
        assert!((sum / f64::from(n)).abs() < 6.0 / f64::from(n).sqrt(), "{sum}");
    }
}

//! A counter-based generator: a number depends on its key and its counter only. Numbers may therefore be computed on
//! any thread and in any order.

use super::KeyedRng;
use std::f64::consts::TAU;

/// Philox 4x32-10: a cipher-like function of a key and a counter of 128 bits. Source: Salmon, Moraes, Dror and Shaw
/// 2011, "Parallel random numbers: as easy as 1, 2, 3".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Philox([u32; 2]);

impl Philox {
    /// Creates the generator of the use `name` in the environment with global index `env`, keyed as [`KeyedRng::keyed`].
    pub fn keyed(seed: u64, env: u64, name: &str) -> Self {
        let mut random = KeyedRng::keyed(seed, env, name);
        Self([(); 2].map(|()| (random.uniform() * 2f64.powi(32)) as u32))
    }

    /// 128 random bits for the counter `at`. The same key and counter give the same bits.
    #[inline]
    pub fn bits(self, at: [u32; 4]) -> [u32; 4] {
        let multiply = |a: u32, b: u32| {
            let product = u64::from(a) * u64::from(b);
            ((product >> 32) as u32, product as u32)
        };
        let (mut c, mut key) = (at, self.0);
        for _ in 0..10 {
            let (high_0, low_0) = multiply(0xD251_1F53, c[0]);
            let (high_1, low_1) = multiply(0xCD9E_8D57, c[2]);
            c = [high_1 ^ c[1] ^ key[0], low_1, high_0 ^ c[3] ^ key[1], low_0];
            key = [key[0].wrapping_add(0x9E37_79B9), key[1].wrapping_add(0xBB67_AE85)];
        }
        c
    }

    /// Four uniform numbers in 0 to 1, both excluded.
    #[inline]
    pub fn uniforms(self, at: [u32; 4]) -> [f64; 4] {
        self.bits(at).map(|bits| (f64::from(bits) + 0.5) * 2f64.powi(-32))
    }

    /// Four normal numbers with mean 0 and standard deviation 1, by the transform of Box and Muller (1958). With 32
    /// bits each, their magnitudes are below 6.8.
    #[inline]
    pub fn normals(self, at: [u32; 4]) -> [f64; 4] {
        let [a, b, c, d] = self.uniforms(at);
        let pair = |a: f64, b: f64| {
            let (radius, (sin, cos)) = ((-2.0 * a.ln()).sqrt(), (TAU * b).sin_cos());
            [radius * cos, radius * sin]
        };
        let ([a, b], [c, d]) = (pair(a, b), pair(c, d));
        [a, b, c, d]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known answers of Random123, the library of the authors.
    #[test]
    fn known_answers() {
        let zero = Philox([0, 0]).bits([0; 4]);
        assert_eq!(zero, [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        let ones = Philox([u32::MAX; 2]).bits([u32::MAX; 4]);
        assert_eq!(ones, [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]);
        let pi = Philox([0xa409_3822, 0x299f_31d0]).bits([0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344]);
        assert_eq!(pi, [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]);
    }

    /// Means of n independent numbers scatter by sigma / sqrt(n), variances of normal ones by sqrt(2 / n), of uniform
    /// ones by sqrt(1 / 180 / n), fourth moments of normal ones by sqrt(96 / n), correlations by 1 / sqrt(n). Limits of
    /// six times that fail once in 5e8 seeds, and the seeds here are fixed.
    #[test]
    fn moments() {
        let rng = Philox::keyed(3, 1, "camera");
        let n = 200_000.0;
        let normals: Vec<f64> = (0..50_000).flat_map(|k| rng.normals([k, 0, 7, 1])).collect();
        let moment = |numbers: &[f64], power: i32| numbers.iter().map(|x| x.powi(power)).sum::<f64>() / n;
        let root = f64::sqrt(n);
        for (power, expected, variance) in [(1, 0.0, 1f64), (2, 1.0, 2.0), (4, 3.0, 96.0)] {
            assert!((moment(&normals, power) - expected).abs() < 6.0 * variance.sqrt() / root, "moment {power}");
        }
        let uniforms: Vec<f64> = (0..50_000).flat_map(|k| rng.uniforms([0, k, 7, 1])).collect();
        assert!((moment(&uniforms, 1) - 0.5).abs() < 6.0 * (1.0 / 12.0_f64).sqrt() / root);
        let second: f64 = uniforms.iter().map(|x| (x - 0.5).powi(2)).sum::<f64>() / n;
        assert!((second - 1.0 / 12.0).abs() < 6.0 * (1.0 / 180.0_f64).sqrt() / root);
        // Correlations with adjacent numbers, the next counter on every axis, and other keys.
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / n;
        let near = product(&normals, &normals[1..]);
        assert!(near.abs() < 6.0 / root, "{near}");
        let [a, b, c] = [Philox::keyed(4, 1, "camera"), Philox::keyed(3, 2, "camera"), Philox::keyed(3, 1, "camerb")];
        let places = [[0, 1, 7, 1], [0, 0, 8, 1], [0, 0, 7, 2], [1, 0, 7, 1]].map(|place| (&rng, place));
        for (key, [x, y, z, w]) in places.into_iter().chain([&a, &b, &c].map(|key| (key, [0, 0, 7, 1]))) {
            let others: Vec<f64> = (0..50_000).flat_map(|k| key.normals([x + k, y, z, w])).collect();
            assert!(product(&normals, &others).abs() < 6.0 / root, "{key:?} {:?}", [x, y, z, w]);
        }
        assert!((product(&normals, &normals) - 1.0).abs() < 0.05, "control: correlation with itself");
    }
}

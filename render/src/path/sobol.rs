//! Low-discrepancy random numbers: Sobol's first two dimensions with Owen scrambling, independent for each pixel and
//! each pair of dimensions.
//!
//! Sources: Sobol, 1967; Owen, Randomly permuted (t,m,s)-nets, 1995; Laine and Karras, Stratified sampling for
//! stochastic transparency, 2011, section 4.1; Burley, Practical hash-based Owen scrambling, JCGT 9(4), 2020.

/// Random sequence of a pixel, or of a surface point in shadow rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SobolSequence {
    seed: u32,
}

/// One sample of a sequence.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SobolSample {
    seed: u32,
    index: u32,
}

/// Mixes bits so that all output bits depend on all input bits. Source: Wellons, hash-prospector, "lowbias32".
fn mix(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x21f0_aaad);
    x ^= x >> 15;
    x = x.wrapping_mul(0xd35a_2d97);
    x ^ (x >> 15)
}

fn combine(seed: u32, x: u32) -> u32 {
    mix(seed ^ mix(x.wrapping_add(0x9e37_79b9)))
}

/// Hash-based Owen scrambling: flips each bit depending on `seed` and on the bits above it.
fn scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits();
    x = x.wrapping_add(seed);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^= x.wrapping_mul(0x8d22_f6e6);
    x.reverse_bits()
}

/// The second dimension of the point whose first dimension has these bits: the product with Pascal's triangle modulo 2,
/// whose halves are triangles again. Source: Ahmed, An implementation algorithm of 2D Sobol sequence fast, elegant, and
/// compact, EGSR 2024.
fn sobol_second(mut first: u32) -> u32 {
    first ^= first << 16;
    first ^= (first & 0x00ff_00ff) << 8;
    first ^= (first & 0x0f0f_0f0f) << 4;
    first ^= (first & 0x3333_3333) << 2;
    first ^ (first & 0x5555_5555) << 1
}

impl SobolSequence {
    /// Creates the sequence of a key: the pixel and the seed of the image, or the bits of the coordinates of a surface
    /// point.
    pub(crate) fn new([x, y]: [usize; 2], seed: u32) -> Self {
        Self { seed: combine(combine(mix(seed), x as u32), y as u32) }
    }

    pub(crate) fn sample(self, index: u32) -> SobolSample {
        SobolSample { seed: self.seed, index }
    }
}

impl SobolSample {
    /// Two random numbers in 0..1. Stratification: if the square is divided into 2^a columns and 2^(k-a) rows, each box
    /// contains exactly one of the first 2^k samples. Samples with different `dimension` are independent.
    pub(crate) fn sample_2d(self, dimension: u32) -> [f64; 2] {
        let seed = combine(self.seed, dimension);
        let first = scramble(self.index, seed).reverse_bits();
        let unit = |x: u32| f64::from(x) / 4_294_967_296.0;
        [unit(scramble(first, mix(seed ^ 0x68bc_21eb))), unit(scramble(sobol_second(first), mix(seed ^ 0x02e5_be93)))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with the textbook's sum: every bit of the index adds a direction number, each the one before times 1 +
    /// x.
    #[test]
    fn second_dimension() {
        for k in 0..100_000u32 {
            let index = if k < 1000 { k } else { mix(k) };
            let (mut rest, mut sum, mut direction) = (index, 0, 1u32 << 31);
            while rest != 0 {
                sum ^= if rest & 1 == 1 { direction } else { 0 };
                (rest, direction) = (rest >> 1, direction ^ direction >> 1);
            }
            assert_eq!(sobol_second(index.reverse_bits()), sum, "{index}");
        }
    }

    /// The net property: one sample in every box of equal area, however the square is halved.
    #[test]
    fn net() {
        for (pixel, dimension) in [([0, 0], 0), ([3, 7], 1), ([639, 479], 12)] {
            for k in [1u32, 4, 8] {
                let count = 1usize << k;
                let all: Vec<_> =
                    (0..count).map(|i| SobolSequence::new(pixel, 5).sample(i as u32).sample_2d(dimension)).collect();
                for wide in 0..=k {
                    let (columns, rows) = (1usize << wide, 1usize << (k - wide));
                    let mut seen = vec![0; count];
                    for [x, y] in &all {
                        seen[(y * rows as f64) as usize * columns + (x * columns as f64) as usize] += 1;
                    }
                    assert!(seen.iter().all(|&n| n == 1), "{count} samples in {columns} x {rows} boxes");
                }
            }
        }
        // A control: numbers of a plain generator do not have it.
        let mut state = 1u32;
        let mut seen = [0; 256];
        for _ in 0..256 {
            state = mix(state);
            seen[(state >> 24) as usize] += 1;
        }
        assert!(seen.iter().any(|&n| n != 1));
    }

    /// Means over pixels are those of uniform numbers: sums of n numbers in 0..1 have a standard deviation of sqrt(n /
    /// 12).
    #[test]
    fn independence() {
        let n = 4096usize;
        let five = 5.0 / (12.0 * n as f64).sqrt();
        let pick =
            |k: usize, dimension, seed| SobolSequence::new([k % 64, k / 64], seed).sample(0).sample_2d(dimension);
        let mean = |f: &dyn Fn(usize) -> f64| (0..n).map(f).sum::<f64>() / n as f64;
        assert!((0..2).all(|axis| (mean(&|k| pick(k, 3, 0)[axis]) - 0.5).abs() < five));
        // Products of two independent numbers: mean 1/4, variance 7/144.
        let five = 5.0 * (7.0 / 144.0 / n as f64).sqrt();
        for (a, b) in [((3, 0), (4, 0)), ((3, 0), (3, 1))] {
            let product = mean(&|k| pick(k, a.0, a.1)[0] * pick(k, b.0, b.1)[0]);
            assert!((product - 0.25).abs() < five, "{product}");
        }
        assert!((mean(&|k| pick(k, 3, 0)[0] * pick(k + 1, 3, 0)[0]) - 0.25).abs() < five);
        // A control: the square of a number has the mean 1/3.
        assert!((mean(&|k| pick(k, 3, 0)[0].powi(2)) - 0.25).abs() > five);
    }
}

//! Evaluation of measured series: the slope of a line with its confidence interval, and growth of counts.

use std::fmt;

/// Number of blocks of a series. Memory of neighboring samples is correlated, which the residuals of single samples hide.
/// Means of a twelfth of the series are nearly independent.
const BLOCKS: usize = 12;
/// Quantile 0.975 of Student's t-distribution with `BLOCKS - 2` degrees of freedom.
const T_975: f64 = 2.228;
/// Fewest samples for a fit: two in each block.
pub(crate) const FEWEST_SAMPLES: usize = 2 * BLOCKS;

/// Slope of a fitted line and its uncertainty, in units of y per unit of x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Slope {
    pub(crate) value: f64,
    /// Standard error of the value.
    pub(crate) standard_error: f64,
}

/// Result of the comparison of a slope with a limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// The whole confidence interval is below the limit.
    Flat,
    /// The whole confidence interval is at the limit or above.
    Growing,
    /// The limit is inside the confidence interval.
    Undecided,
}

impl Slope {
    /// Fits a line to the means of [`BLOCKS`] blocks of equal numbers of samples (x, y) by least squares. `None` with
    /// fewer than [`FEWEST_SAMPLES`] samples.
    pub(crate) fn fit(samples: &[[f64; 2]]) -> Option<Self> {
        if samples.len() < FEWEST_SAMPLES {
            return None;
        }
        let bound = |block: usize| block * samples.len() / BLOCKS;
        let means: Vec<[f64; 2]> = (0..BLOCKS).map(|block| mean(&samples[bound(block)..bound(block + 1)])).collect();
        let [x_mean, y_mean] = mean(&means);
        let sxx: f64 = means.iter().map(|[x, _]| (x - x_mean).powi(2)).sum();
        let sxy: f64 = means.iter().map(|[x, y]| (x - x_mean) * (y - y_mean)).sum();
        let value = sxy / sxx;
        let residual = |[x, y]: &[f64; 2]| (y - y_mean - value * (x - x_mean)).powi(2);
        let variance = means.iter().map(residual).sum::<f64>() / (BLOCKS - 2) as f64;
        Some(Self { value, standard_error: (variance / sxx).sqrt() })
    }

    /// Half of the width of the confidence interval, at a confidence of 95 %.
    pub(crate) fn margin(&self) -> f64 {
        T_975 * self.standard_error
    }

    /// Compares the slope with a limit. The slope of a flat series is called growing in 2.5 % of all runs at most.
    pub(crate) fn compare(&self, limit: f64) -> Verdict {
        match (self.value - self.margin(), self.value + self.margin()) {
            (low, _) if low >= limit => Verdict::Growing,
            (_, high) if high < limit => Verdict::Flat,
            _ => Verdict::Undecided,
        }
    }

    /// Smallest slope that a run with this uncertainty calls growing in 97.5 % of all runs.
    pub(crate) fn smallest_found(&self, limit: f64) -> f64 {
        limit + 2.0 * self.margin()
    }
}

impl fmt::Display for Slope {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} ± {:.3} (standard error {:.3})", self.value, self.margin(), self.standard_error)
    }
}

fn mean(samples: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|k| samples.iter().map(|sample| sample[k]).sum::<f64>() / samples.len() as f64)
}

/// Growth of a count: its minimum in the last quarter above its minimum in the first quarter. A leak raises the minimum;
/// objects that end a moment later only raise single samples. 0 without growth.
pub(crate) fn growth(counts: &[usize]) -> usize {
    let quarter = counts.len().div_ceil(4);
    let least = |part: &[usize]| part.iter().copied().min().unwrap_or(0);
    least(&counts[counts.len() - quarter..]).saturating_sub(least(&counts[..quarter]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform noise in -1..1 (xorshift64*), identical in every run.
    struct Noise(u64);

    impl Noise {
        fn next(&mut self) -> f64 {
            self.0 ^= self.0 >> 12;
            self.0 ^= self.0 << 25;
            self.0 ^= self.0 >> 27;
            (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    /// An hour of samples, one per second: growth \[MB/h\] and uncorrelated noise of this amplitude \[MB\].
    fn hour(growth: f64, amplitude: f64, seed: u64) -> Vec<[f64; 2]> {
        let mut noise = Noise(seed);
        (0..3600).map(|k| f64::from(k) / 3600.0).map(|x| [x, 200.0 + growth * x + amplitude * noise.next()]).collect()
    }

    #[test]
    fn exact_line() {
        let samples: Vec<_> = (0..50).map(|k| [f64::from(k), 3.0 - 0.25 * f64::from(k)]).collect();
        let slope = Slope::fit(&samples).unwrap();
        assert!((slope.value + 0.25).abs() < 1e-12 && slope.standard_error < 1e-12, "{slope}");
        assert_eq!(Slope::fit(&samples[..FEWEST_SAMPLES - 1]), None);
        assert!(Slope::fit(&samples[..FEWEST_SAMPLES]).is_some());
    }

    /// Reference: the standard error of a slope, for means of blocks, is that of all samples if they are uncorrelated:
    /// sigma / sqrt(n var(x)), with sigma = amplitude / sqrt(3) and var(x) = 1/12.
    #[test]
    fn standard_error() {
        let expected = 2.0 / 3.0_f64.sqrt() / (3600.0_f64 / 12.0).sqrt();
        let mut errors: Vec<f64> =
            (1..=200).map(|seed| Slope::fit(&hour(0.0, 2.0, seed)).unwrap().standard_error).collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        // The estimate of a single run varies by 1 / sqrt(2 * 10); the mean of 200 by 1.6 %.
        assert!((mean / expected - 1.0).abs() < 0.06, "{mean} instead of {expected}");
        errors.sort_by(f64::total_cmp);
        assert!(errors[0] > 0.3 * expected && errors[199] < 2.0 * expected, "{errors:?}");
    }

    #[test]
    fn verdicts() {
        for (growth, amplitude, expected) in [
            (0.0, 1.0, Verdict::Flat),
            (0.5, 1.0, Verdict::Flat),
            (-3.0, 1.0, Verdict::Flat),
            (2.0, 1.0, Verdict::Growing),
            (50.0, 20.0, Verdict::Growing),
            // Noise of 20 MB has a standard error of 0.67 MB/h: the limit is inside the interval.
            (1.0, 20.0, Verdict::Undecided),
            (0.0, 60.0, Verdict::Undecided),
            (3.0, 100.0, Verdict::Undecided),
        ] {
            let slope = Slope::fit(&hour(growth, amplitude, 7)).unwrap();
            assert_eq!(slope.compare(1.0), expected, "{growth} MB/h, noise {amplitude} MB: {slope}");
        }
    }

    /// False alarms are at most 2.5 %, and leaks of the announced size are found in 97.5 % of all runs.
    #[test]
    fn error_rates() {
        let runs = |growth: f64| -> Vec<Slope> {
            (1..=400).map(|seed| Slope::fit(&hour(growth, 30.0, seed)).unwrap()).collect()
        };
        let growing = |slopes: &[Slope]| slopes.iter().filter(|slope| slope.compare(1.0) == Verdict::Growing).count();
        // Growth of exactly the limit: 10 of 400 are expected, with a standard deviation of 3.
        let at_the_limit = growing(&runs(1.0));
        assert!((1..=20).contains(&at_the_limit), "{at_the_limit}");
        // The margin is a random number, too; here, its mean.
        let margin = runs(1.0).iter().map(Slope::margin).sum::<f64>() / 400.0;
        let found = growing(&runs(1.0 + 2.0 * margin));
        assert!(found >= 380, "{found} of 400");
        let announced = Slope { value: 0.0, standard_error: margin / T_975 }.smallest_found(1.0);
        assert!((announced - 1.0 - 2.0 * margin).abs() < 1e-9);
    }

    /// A random walk, as memory of an allocator may have, is rarely called growing.
    #[test]
    fn correlated_samples() {
        let walk = |seed: u64| {
            let mut noise = Noise(seed);
            let mut level = 200.0;
            (0..3600)
                .map(|k| {
                    // Returns to its mean within about 100 samples.
                    level += 0.3 * noise.next() - 0.01 * (level - 200.0);
                    [f64::from(k) / 3600.0, level]
                })
                .collect::<Vec<_>>()
        };
        let alarms = (1..=200).filter(|&seed| Slope::fit(&walk(seed)).unwrap().compare(1.0) == Verdict::Growing);
        assert!(alarms.count() <= 10);
    }

    #[test]
    fn growth_of_counts() {
        for (counts, expected) in [
            (&[][..], 0),
            (&[5], 0),
            (&[5, 9, 5, 7, 5, 5, 8, 5], 0),
            // Single samples that are larger are no growth.
            (&[5, 5, 5, 5, 5, 5, 5, 6], 0),
            (&[5, 5, 5, 6, 6, 6, 6, 6], 1),
            (&[5, 6, 7, 8, 9, 10, 11, 12], 6),
            (&[9, 9, 8, 7, 6, 5, 5, 5], 0),
        ] {
            assert_eq!(growth(counts), expected, "{counts:?}");
        }
    }
}

//! Minimum, maximum, mean and standard deviation of the features of a dataset, for normalization.
//!
//! Numbers that are not finite are excluded, because they would invalidate the statistics of all others. A statistic
//! without any finite number is `null`, since JSON has no NaN. The frames keep the measured values.

use serde_json::{Value, json};

/// Statistics of a feature: of each of its numbers over all frames.
pub(super) struct Statistics {
    moments: Vec<Moments>,
    frames: u64,
    is_image: bool,
}

/// Moments of a set of numbers: count, mean, sum of squared deviations, minimum and maximum. Sets are merged as in
/// Chan, Golub and LeVeque (1983).
#[derive(Clone, Copy)]
pub(super) struct Moments {
    count: f64,
    mean: f64,
    squared_deviations: f64,
    range: [f64; 2],
}

/// Statistics of one image: of red, green and blue, each from 0 to 1.
pub(super) struct ImageStatistics([Moments; 3]);

impl Moments {
    const NONE: Self =
        Self { count: 0.0, mean: 0.0, squared_deviations: 0.0, range: [f64::INFINITY, f64::NEG_INFINITY] };

    fn merge(&mut self, other: &Self) {
        let (count, apart) = (self.count + other.count, other.mean - self.mean);
        if other.count > 0.0 {
            self.mean += apart * other.count / count;
            self.squared_deviations += other.squared_deviations + apart * apart * self.count * other.count / count;
            self.count = count;
            self.range = [self.range[0].min(other.range[0]), self.range[1].max(other.range[1])];
        }
    }

    fn one(number: f64) -> Self {
        Self { count: 1.0, mean: number, squared_deviations: 0.0, range: [number; 2] }
    }
}

impl ImageStatistics {
    pub(super) fn new(rgba: &[u8]) -> Self {
        let mut all = [Moments::NONE; 3];
        for (channel, moments) in all.iter_mut().enumerate() {
            let values = || rgba.as_chunks::<4>().0.iter().map(|pixel| u64::from(pixel[channel]));
            let count = values().count() as f64;
            // Integer sums are exact.
            let (sum, squares) = values().fold((0, 0), |(sum, squares), x| (sum + x, squares + x * x));
            if let (Some(least), Some(largest)) = (values().min(), values().max()) {
                let mean = sum as f64 / count;
                let about = (squares as f64 - mean * sum as f64).max(0.0) / (255.0 * 255.0);
                let range = [least, largest].map(|end| end as f64 / 255.0);
                *moments = Moments { count, mean: mean / 255.0, squared_deviations: about, range };
            }
        }
        Self(all)
    }
}

impl Statistics {
    pub(super) fn new(width: usize) -> Self {
        Self { moments: vec![Moments::NONE; width], frames: 0, is_image: false }
    }

    pub(super) fn add(&mut self, values: &[f32]) {
        self.frames += 1;
        for (moments, value) in self.moments.iter_mut().zip(values).filter(|(_, value)| value.is_finite()) {
            moments.merge(&Moments::one((*value).into()));
        }
    }

    pub(super) fn add_image(&mut self, of: &ImageStatistics) {
        (self.frames, self.is_image) = (self.frames + 1, true);
        self.moments.iter_mut().zip(&of.0).for_each(|(all, moments)| all.merge(moments));
    }

    /// Converts to the form in `meta/stats.json`. Statistics of images have shape (3, 1, 1).
    pub(super) fn to_json(&self) -> Value {
        let of = |one: fn(&Moments) -> f64| -> Value {
            let values = self.moments.iter().map(|moments| if moments.count > 0.0 { one(moments) } else { f64::NAN });
            if self.is_image { values.map(|x| json!([[x]])).collect() } else { values.map(|x| json!(x)).collect() }
        };
        json!({
            "min": of(|m| m.range[0]),
            "max": of(|m| m.range[1]),
            "mean": of(|m| m.mean),
            "std": of(|m| (m.squared_deviations / m.count).sqrt()),
            "count": [self.frames],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Root cause: one number that was not finite made mean and deviation of all frames `null`.
    #[test]
    fn not_finite() {
        let mut all = Statistics::new(3);
        for row in [[1.0, f32::NAN, 5.0], [f32::INFINITY, f32::NAN, 7.0], [3.0, f32::NEG_INFINITY, 9.0]] {
            all.add(&row);
        }
        // By hand: of 1 and 3; of no number; of 5, 7 and 9, whose variance is 8 / 3.
        let told = all.to_json();
        assert_eq!(told["min"], json!([1.0, null, 5.0]));
        assert_eq!(told["max"], json!([3.0, null, 9.0]));
        assert_eq!(told["mean"], json!([2.0, null, 7.0]));
        assert_eq!(told["count"], json!([3]));
        let deviation = |k: usize| told["std"][k].as_f64().unwrap_or(f64::NAN);
        // A few rounding errors of numbers below 10.
        assert!((deviation(0) - 1.0).abs() < 1e-14 && (deviation(2) - (8.0_f64 / 3.0).sqrt()).abs() < 1e-14, "{told}");
        assert!(told["std"][1].is_null(), "{told}");
    }
}

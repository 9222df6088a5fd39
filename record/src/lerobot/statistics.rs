//! Least, largest, mean and deviation of what is in a dataset: learning scales by them.

use serde_json::{Value, json};

/// Of a feature, for each of its numbers, over all frames.
pub(super) struct Statistics {
    of: Vec<Moments>,
    frames: u64,
    picture: bool,
}

/// Of numbers that come in groups: how many, their mean and the sum of squares about it, as Chan, Golub and LeVeque (1983) join
/// them; and the ends.
#[derive(Clone, Copy)]
pub(super) struct Moments {
    count: f64,
    mean: f64,
    squares: f64,
    ends: [f64; 2],
}

/// Of one picture, for red, green and blue, each from 0 to 1.
pub(super) struct OfPicture([Moments; 3]);

impl Moments {
    const NONE: Self = Self { count: 0.0, mean: 0.0, squares: 0.0, ends: [f64::INFINITY, f64::NEG_INFINITY] };

    fn join(&mut self, other: &Self) {
        let (count, apart) = (self.count + other.count, other.mean - self.mean);
        if other.count > 0.0 {
            self.mean += apart * other.count / count;
            self.squares += other.squares + apart * apart * self.count * other.count / count;
            self.count = count;
            self.ends = [self.ends[0].min(other.ends[0]), self.ends[1].max(other.ends[1])];
        }
    }

    fn one(number: f64) -> Self {
        Self { count: 1.0, mean: number, squares: 0.0, ends: [number; 2] }
    }
}

impl OfPicture {
    pub(super) fn new(rgba: &[u8]) -> Self {
        let mut all = [Moments::NONE; 3];
        for (channel, moments) in all.iter_mut().enumerate() {
            let values = || rgba.as_chunks::<4>().0.iter().map(|pixel| u64::from(pixel[channel]));
            let count = values().count() as f64;
            // Whole numbers: nothing is rounded.
            let (sum, squares) = values().fold((0, 0), |(sum, squares), x| (sum + x, squares + x * x));
            if let (Some(least), Some(largest)) = (values().min(), values().max()) {
                let mean = sum as f64 / count;
                let about = (squares as f64 - mean * sum as f64).max(0.0) / (255.0 * 255.0);
                let ends = [least, largest].map(|end| end as f64 / 255.0);
                *moments = Moments { count, mean: mean / 255.0, squares: about, ends };
            }
        }
        Self(all)
    }
}

impl Statistics {
    pub(super) fn new(width: usize) -> Self {
        Self { of: vec![Moments::NONE; width], frames: 0, picture: false }
    }

    pub(super) fn add(&mut self, values: &[f32]) {
        self.frames += 1;
        self.of.iter_mut().zip(values).for_each(|(moments, value)| moments.join(&Moments::one((*value).into())));
    }

    pub(super) fn add_picture(&mut self, of: &OfPicture) {
        (self.frames, self.picture) = (self.frames + 1, true);
        self.of.iter_mut().zip(&of.0).for_each(|(all, moments)| all.join(moments));
    }

    /// As `meta/stats.json` has it; pictures have shape (3, 1, 1).
    pub(super) fn told(&self) -> Value {
        let of = |one: fn(&Moments) -> f64| -> Value {
            let values = self.of.iter().map(one);
            if self.picture { values.map(|x| json!([[x]])).collect() } else { values.map(|x| json!(x)).collect() }
        };
        json!({
            "min": of(|m| m.ends[0]),
            "max": of(|m| m.ends[1]),
            "mean": of(|m| m.mean),
            "std": of(|m| (m.squares / m.count.max(1.0)).sqrt()),
            "count": [self.frames],
        })
    }
}

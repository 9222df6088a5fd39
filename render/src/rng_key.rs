//! Counter-based random numbers of camera images.

use kinetoscope_scene::Philox;

/// Key of the random numbers of one image of a camera in one environment. Every random number of the image is a
/// function of this key and the position in the image. Threads, lazy rendering and the order of reads therefore do not
/// change the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RngKey {
    philox: Philox,
    /// Number of images so far, including those of resets and refreshes and dropped ones.
    image_count: u64,
    /// Image number of the last reset.
    epoch: u64,
    /// Number of images due since the last reset.
    due_images: u32,
}

/// Random stream, one for each purpose. The random numbers of different streams are independent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RngStream(u8);

impl RngStream {
    /// Dropout of an image.
    pub const DROPOUT: Self = Self(0);
    /// Shot noise of color channels with a mean of 50 electrons or more: normal numbers.
    pub const SHOT: Self = Self(1);
    /// Shot noise of dark color channels (a mean below 50 electrons): uniform numbers that select quantiles of Poisson
    /// distributions.
    pub const SHOT_LOW_LIGHT: Self = Self(4);
    /// Read noise.
    pub const READ: Self = Self(2);
    /// Depth noise.
    pub const DEPTH: Self = Self(3);
    /// Noise of path tracing.
    pub const PATHS: Self = Self(5);

    /// White noise of a channel, new for each image; `channel` is 0 to 15.
    pub const fn white(channel: u8) -> Self {
        Self(16 + channel)
    }

    /// Biases of a channel, drawn at a reset; `channel` is 0 to 15.
    pub const fn bias(channel: u8) -> Self {
        Self(32 + channel)
    }

    /// Random-walk steps of the biases of a channel; `channel` is 0 to 15.
    pub const fn random_walk(channel: u8) -> Self {
        Self(48 + channel)
    }
}

/// Philox counter, which yields four numbers.
fn counter(stream: RngStream, block: u32, number: u64, time: u32) -> [u32; 4] {
    // A camera would have to take images for 2000 years at 1 MHz to need more than 56 bits.
    [block, time, number as u32, (((number >> 32) as u32) << 8) | u32::from(stream.0)]
}

impl RngKey {
    /// The key before the first image of the sensor called `name`, in the environment of global index `env`.
    pub fn new(seed: u64, env: u64, name: &str) -> Self {
        Self { philox: Philox::keyed(seed, env, name), image_count: 0, epoch: 0, due_images: 0 }
    }

    /// Advances to the next scheduled image.
    pub fn advance_scheduled(&mut self) {
        self.image_count += 1;
        self.due_images = self.due_images.saturating_add(1);
    }

    /// Advances to an unscheduled image, after a write to the state.
    pub fn advance_unscheduled(&mut self) {
        self.image_count += 1;
    }

    /// Advances to the first image after a reset.
    pub fn reset(&mut self) {
        self.image_count += 1;
        (self.epoch, self.due_images) = (self.image_count, 0);
    }

    /// Four uniform random numbers of this image, in 0 to 1, both excluded; `block` selects the group of four.
    #[inline]
    pub fn uniforms(&self, stream: RngStream, block: u32) -> [f64; 4] {
        self.philox.uniforms(counter(stream, block, self.image_count, 0))
    }

    /// 32 random bits of this image.
    pub fn bits(&self, stream: RngStream) -> u32 {
        self.philox.bits(counter(stream, 0, self.image_count, 0))[0]
    }

    /// Four normally distributed random numbers of this image, with mean 0 and variance 1; `block` selects the group of
    /// four.
    #[inline]
    pub fn normals(&self, stream: RngStream, block: u32) -> [f64; 4] {
        self.philox.normals(counter(stream, block, self.image_count, 0))
    }

    /// Four normally distributed random numbers that stay the same in all images until the next reset.
    pub fn biases(&self, stream: RngStream, block: u32) -> [f64; 4] {
        self.philox.normals(counter(stream, block, self.epoch, 0))
    }

    /// Positions of four random walks, with one step of variance 1 for each image that was due since the reset.
    ///
    /// The positions are computed without the steps before. Between two known times, the position at the middle time is
    /// normal: its mean is the mean of both, its variance a quarter of the time between them (Lévy's construction of
    /// Brownian motion). The known times are powers of two, each as far from the one before as that is from 0. So a
    /// position takes twice as many normal numbers as the time has binary digits.
    pub fn random_walks(&self, stream: RngStream, block: u32) -> [f64; 4] {
        let Some(digits) = self.due_images.checked_ilog2() else { return [0.0; 4] };
        let now = u64::from(self.due_images);
        // Every time is reached once, so it can key its own random numbers.
        let normals = |time: u64| self.philox.normals(counter(stream, block, self.epoch, time as u32));
        let step = |from: [f64; 4], variance: f64, time: u64| {
            let (normals, sigma) = (normals(time), variance.sqrt());
            std::array::from_fn(|k| from[k] + sigma * normals[k])
        };
        let (mut since, mut low) = (1, step([0.0; 4], 1.0, 1));
        for _ in 0..digits {
            low = step(low, since as f64, 2 * since);
            since *= 2;
        }
        if since == now {
            return low;
        }
        let (mut until, mut high) = (2 * since, step(low, since as f64, 2 * since));
        while since < now {
            let middle = (since + until) / 2;
            let mean = std::array::from_fn(|k| 0.5 * (low[k] + high[k]));
            let there = step(mean, 0.25 * (until - since) as f64, middle);
            if now < middle {
                (until, high) = (middle, there);
            } else {
                (since, low) = (middle, there);
            }
        }
        low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Covariance of random walks: positions at times s and t have the covariance min(s, t). The mean of the product of
    /// two normal numbers has the standard deviation sqrt((s t + min²) / n); the bound is six times that.
    #[test]
    fn covariance() {
        let times = [1, 2, 3, 5, 8, 100, 777];
        let n = 20_000;
        let places = |due_images: u32| -> Vec<f64> {
            let key = RngKey { due_images, epoch: 5, ..RngKey::new(1, 2, "eye") };
            (0..n / 4).flat_map(|block| key.random_walks(RngStream::random_walk(1), block)).collect()
        };
        let walks: Vec<Vec<f64>> = times.iter().map(|&time| places(time)).collect();
        for (s, at_s) in times.iter().zip(&walks) {
            for (t, at_t) in times.iter().zip(&walks) {
                let (s, t, least) = (f64::from(*s), f64::from(*t), f64::from(*s.min(t)));
                let covariance = at_s.iter().zip(at_t).map(|(a, b)| a * b).sum::<f64>() / f64::from(n);
                let bound = 6.0 * ((s * t + least * least) / f64::from(n)).sqrt();
                assert!((covariance - least).abs() < bound, "{s} {t}: {covariance}");
            }
        }
        assert!(places(0).iter().all(|x| *x == 0.0));
        let last =
            RngKey { due_images: u32::MAX, ..RngKey::new(1, 2, "eye") }.random_walks(RngStream::random_walk(0), 0);
        assert!(last.iter().all(|x| x.abs() < 7.0 * 65536.0 && *x != 0.0), "{last:?}");
    }

    /// A value is the previous one plus a step of variance 1.
    #[test]
    fn independent_steps() {
        let n = 40_000.0;
        let step = |age: u32| -> Vec<f64> {
            (0..10_000)
                .flat_map(|block| {
                    let at = |due_images| {
                        RngKey { due_images, ..RngKey::new(9, 0, "eye") }.random_walks(RngStream::random_walk(2), block)
                    };
                    let (before, after) = (at(age - 1), at(age));
                    [0, 1, 2, 3].map(|k| after[k] - before[k])
                })
                .collect()
        };
        let (a, b) = (step(37), step(38));
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / n;
        let bound = 6.0 / f64::sqrt(n);
        assert!(product(&a, &b).abs() < bound, "{}", product(&a, &b));
        assert!((product(&a, &a) - 1.0).abs() < 2f64.sqrt() * bound, "{}", product(&a, &a));
    }
}

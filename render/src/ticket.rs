//! Which image it is: what its random numbers are looked up by.

use kinetoscope_scene::Philox;

/// Which image it is, of all that a camera ever took in an environment. With the place in the image, every random number
/// of the image is a function of this: neither threads nor laziness nor the order of readings change one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ticket {
    dice: Philox,
    /// Images so far, those of resets and refreshes and those that got lost among them.
    number: u64,
    /// The number that the last reset had.
    epoch: u64,
    /// Images that were due since then.
    age: u32,
}

/// What random numbers are for: they are different forevery use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stream(u8);

impl Stream {
    /// Whether a image gets lost.
    pub const DROPOUT: Self = Self(0);
    /// Shot noise.
    pub const SHOT: Self = Self(1);
    /// Where the count of a pixel with few electrons stands in its distribution.
    pub const SHOT_IN_THE_DARK: Self = Self(4);
    /// Read noise.
    pub const READ: Self = Self(2);
    /// Depth noise.
    pub const DEPTH: Self = Self(3);
    /// The noise of paths.
    pub const PATHS: Self = Self(5);

    /// What each image adds to a channel; channels are counted from 0.
    pub const fn white(channel: u8) -> Self {
        Self(16 + channel)
    }

    /// The biases of a channel at a reset.
    pub const fn bias(channel: u8) -> Self {
        Self(32 + channel)
    }

    /// The steps that biases of a channel take.
    pub const fn walk(channel: u8) -> Self {
        Self(48 + channel)
    }
}

/// A place in Philox's space: four numbers each.
fn place(stream: Stream, block: u32, number: u64, time: u32) -> [u32; 4] {
    // A camera would have to take images for 2000 years at 1 MHz to need more than 56 bits.
    [block, time, number as u32, (((number >> 32) as u32) << 8) | u32::from(stream.0)]
}

impl Ticket {
    /// The ticket before the first image of the sensor called `name`, in the environment of global index `env`.
    pub fn first(seed: u64, env: u64, name: &str) -> Self {
        Self { dice: Philox::keyed(seed, env, name), number: 0, epoch: 0, age: 0 }
    }

    /// The next image, which is due.
    pub fn due(&mut self) {
        self.number += 1;
        self.age = self.age.saturating_add(1);
    }

    /// The next image, which nobody waited for: somebody wrote to the state.
    pub fn refresh(&mut self) {
        self.number += 1;
    }

    /// The next image, with which everything begins again.
    pub fn reset(&mut self) {
        self.number += 1;
        (self.epoch, self.age) = (self.number, 0);
    }

    /// Four uniform numbers of this image, in 0 to 1; those of one `block` belong together.
    #[inline]
    pub fn uniforms(&self, stream: Stream, block: u32) -> [f64; 4] {
        self.dice.uniforms(place(stream, block, self.number, 0))
    }

    /// 32 random bits of this image.
    pub fn bits(&self, stream: Stream) -> u32 {
        self.dice.bits(place(stream, 0, self.number, 0))[0]
    }

    /// Four normal numbers of this image.
    #[inline]
    pub fn normals(&self, stream: Stream, block: u32) -> [f64; 4] {
        self.dice.normals(place(stream, block, self.number, 0))
    }

    /// Four normal numbers that are the same in all images until the next reset.
    pub fn biases(&self, stream: Stream, block: u32) -> [f64; 4] {
        self.dice.normals(place(stream, block, self.epoch, 0))
    }

    /// Where four random walks are, each of as many steps of variance 1 as images were due since the reset.
    ///
    /// Their place is looked up, without the steps before. Between two known times, the place in the middle is normal: its mean
    /// is theirs, its variance a quarter of the time between (Lévy's construction of Brownian motion); the known times are powers of two,
    /// each as far from the one before as that is from 0. So twice the number of binary digits of the time are the normal
    /// numbers that a place takes.
    pub fn walks(&self, stream: Stream, block: u32) -> [f64; 4] {
        let Some(digits) = self.age.checked_ilog2() else { return [0.0; 4] };
        let now = u64::from(self.age);
        // Every time is made once, so that it may number its own random numbers.
        let normals = |time: u64| self.dice.normals(place(stream, block, self.epoch, time as u32));
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

    /// The law of a random walk: places at times s and t have the covariance min(s, t). The mean of the product of two normal
    /// numbers scatters by sqrt((s t + min²) / n): six times that.
    #[test]
    fn covariance() {
        let times = [1, 2, 3, 5, 8, 100, 777];
        let n = 20_000;
        let places = |age: u32| -> Vec<f64> {
            let ticket = Ticket { age, epoch: 5, ..Ticket::first(1, 2, "eye") };
            (0..n / 4).flat_map(|block| ticket.walks(Stream::walk(1), block)).collect()
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
        let last = Ticket { age: u32::MAX, ..Ticket::first(1, 2, "eye") }.walks(Stream::walk(0), 0);
        assert!(last.iter().all(|x| x.abs() < 7.0 * 65536.0 && *x != 0.0), "{last:?}");
    }

    /// A value is the one before plus a step of variance 1.
    #[test]
    fn independent_steps() {
        let n = 40_000.0;
        let step = |age: u32| -> Vec<f64> {
            (0..10_000)
                .flat_map(|block| {
                    let at = |age| Ticket { age, ..Ticket::first(9, 0, "eye") }.walks(Stream::walk(2), block);
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

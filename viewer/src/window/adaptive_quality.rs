//! Adaptive number of samples per pixel, which keeps the frame rate of moving images.

use std::time::{Duration, Instant};

/// Samples per pixel of images at rest (`FINE`), and of slow images in motion (`COARSE`).
const FINE: u8 = 4;
const COARSE: u8 = 1;
/// Target for the time of rendering and sending an image: 30 frames per second.
const FRAME_TIME_BUDGET: Duration = Duration::from_millis(33);
/// Consecutive slow images after which the sample count drops. A single image may be slow for other reasons.
const MAX_SLOW_FRAMES: u32 = 3;
/// Interval after which moving images are tried again with all samples.
const RETRY_INTERVAL: Duration = Duration::from_secs(5);
/// Time without changes after which an image counts as at rest.
const REST_TIME: Duration = Duration::from_millis(250);

/// Adaptive sampling state of a window.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AdaptiveQuality {
    /// Time of the last change of the image.
    last_change: Option<Instant>,
    /// Number of consecutive slow images with all samples.
    slow_frames: u32,
    /// Time of the last image with all samples.
    last_fine_frame: Option<Instant>,
    /// Samples per pixel of the last image.
    last_samples: Option<u8>,
}

impl AdaptiveQuality {
    /// Returns the number of samples per pixel of the next image. `changed` is true if the image differs from the last
    /// one.
    pub(super) fn samples(&mut self, changed: bool, now: Instant) -> u8 {
        if changed {
            self.last_change = Some(now);
        }
        let rests = self.last_change.is_none_or(|then| now.saturating_duration_since(then) >= REST_TIME);
        let retries = self.last_fine_frame.is_none_or(|then| now.saturating_duration_since(then) >= RETRY_INTERVAL);
        let samples = if self.slow_frames < MAX_SLOW_FRAMES || rests || retries { FINE } else { COARSE };
        if samples == FINE {
            self.last_fine_frame = Some(now);
        }
        samples
    }

    /// Records the duration of rendering and sending an image.
    pub(super) fn record_frame(&mut self, samples: u8, took: Duration) {
        self.last_samples = Some(samples);
        if samples == FINE {
            self.slow_frames = if took > FRAME_TIME_BUDGET { (self.slow_frames + 1).min(MAX_SLOW_FRAMES) } else { 0 };
        }
    }

    /// True if an image at rest has only one sample per pixel.
    pub(super) fn needs_refinement(&self, now: Instant) -> bool {
        let rests = self.last_change.is_none_or(|then| now.saturating_duration_since(then) >= REST_TIME);
        self.last_samples == Some(COARSE) && rests
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LATE: Duration = Duration::from_millis(50);
    const QUICK: Duration = Duration::from_millis(20);

    /// Returns the samples per pixel of each image of a moving scene, 50 ms apart. `fine` has the durations of images
    /// with all samples.
    fn samples(fineness: &mut AdaptiveQuality, start: Instant, fine: &[Duration]) -> Vec<u8> {
        let one = |(k, &took): (u32, &Duration)| {
            let samples = fineness.samples(true, start + k * Duration::from_millis(50));
            fineness.record_frame(samples, if samples == FINE { took } else { took / 3 });
            samples
        };
        (1..).zip(fine).map(one).collect()
    }

    /// A slow image is coarse while it moves and fine when it rests.
    #[test]
    fn moving_and_resting() {
        let start = Instant::now();
        // Fast, except for two in a row: fine all the time.
        let quick = [vec![QUICK; 5], vec![LATE; 2], vec![QUICK; 5]].concat();
        assert_eq!(samples(&mut AdaptiveQuality::default(), start, &quick), [4; 12]);
        let mut late = AdaptiveQuality::default();
        assert_eq!(samples(&mut late, start, &[LATE; 6]), [4, 4, 4, 1, 1, 1]);
        // The motion stops at 300 ms. A quarter of a second later, the image is rendered again, once.
        let at = |milliseconds| start + Duration::from_millis(milliseconds);
        assert!(!late.needs_refinement(at(540)) && late.needs_refinement(at(550)));
        assert_eq!(late.samples(false, at(550)), 4);
        late.record_frame(4, LATE);
        assert!(!late.needs_refinement(at(700)));
        // The motion continues: the duration of fine images is already known.
        assert_eq!(late.samples(true, at(800)), 1);
    }

    #[test]
    fn retries() {
        let (start, mut fineness) = (Instant::now(), AdaptiveQuality::default());
        // The third image is at 150 ms, so the image at 5150 ms is tried, and the next one after the same interval.
        let found = samples(&mut fineness, start, &[LATE; 210]);
        let fine: Vec<usize> = (1..).zip(found).filter(|(_, samples)| *samples == FINE).map(|(k, _)| k).collect();
        assert_eq!(fine, [1, 2, 3, 103, 203]);
        // Rendering has become faster: the next try succeeds, and fine images stay.
        let found = samples(&mut fineness, start + Duration::from_millis(50 * 210), &[QUICK; 100]);
        assert_eq!((found[91], found[92], found[99]), (1, 4, 4));
    }
}

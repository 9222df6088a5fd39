//! How many samples a pixel of a window gets, so that what moves is seen to move.

use std::time::{Duration, Instant};

/// Samples per pixel of what rests, and of what moves where those take too long.
const FINE: u8 = 4;
const COARSE: u8 = 1;
/// Drawing a picture and handing it to the display take no longer than this where they can: 30 in a second.
const BUDGET: Duration = Duration::from_millis(33);
/// Slow pictures in a row before fewer samples are taken: one may be slow for another reason.
const SLOW: u32 = 3;
/// After so long what moves is tried with all samples again.
const RETRY: Duration = Duration::from_secs(5);
/// What has not changed for so long rests.
const REST: Duration = Duration::from_millis(250);

/// What was found out about the pictures of a window.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Fineness {
    /// When what is shown changed last.
    moved: Option<Instant>,
    /// Fine pictures in a row that took too long.
    slow: u32,
    /// When a fine picture was drawn last.
    fine: Option<Instant>,
    /// Samples of the last picture.
    last: Option<u8>,
}

impl Fineness {
    /// Samples per pixel of the next picture; `changed`: it shows something else than the last one.
    pub(super) fn samples(&mut self, changed: bool, now: Instant) -> u8 {
        if changed {
            self.moved = Some(now);
        }
        let rests = self.moved.is_none_or(|then| now.saturating_duration_since(then) >= REST);
        let retries = self.fine.is_none_or(|then| now.saturating_duration_since(then) >= RETRY);
        let samples = if self.slow < SLOW || rests || retries { FINE } else { COARSE };
        if samples == FINE {
            self.fine = Some(now);
        }
        samples
    }

    /// A picture was drawn, and handed to the display.
    pub(super) fn drew(&mut self, samples: u8, took: Duration) {
        self.last = Some(samples);
        if samples == FINE {
            self.slow = if took > BUDGET { (self.slow + 1).min(SLOW) } else { 0 };
        }
    }

    /// Whether what rests is still shown coarsely.
    pub(super) fn wants_better(&self, now: Instant) -> bool {
        let rests = self.moved.is_none_or(|then| now.saturating_duration_since(then) >= REST);
        self.last == Some(COARSE) && rests
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LATE: Duration = Duration::from_millis(50);
    const QUICK: Duration = Duration::from_millis(20);

    /// Samples of each image of something that moves, 50 ms apart; with all samples an image takes as long as given.
    fn samples(fineness: &mut Fineness, start: Instant, fine: &[Duration]) -> Vec<u8> {
        let one = |(k, &took): (u32, &Duration)| {
            let samples = fineness.samples(true, start + k * Duration::from_millis(50));
            fineness.drew(samples, if samples == FINE { took } else { took / 3 });
            samples
        };
        (1..).zip(fine).map(one).collect()
    }

    /// A slow image is coarse while it moves and fine when it rests.
    #[test]
    fn moving_and_resting() {
        let start = Instant::now();
        // Fast enough, but for two in a row: fine all the time.
        let quick = [vec![QUICK; 5], vec![LATE; 2], vec![QUICK; 5]].concat();
        assert_eq!(samples(&mut Fineness::default(), start, &quick), [4; 12]);
        let mut late = Fineness::default();
        assert_eq!(samples(&mut late, start, &[LATE; 6]), [4, 4, 4, 1, 1, 1]);
        // It stops at 300 ms; a quarter of a second later it is drawn again, once.
        let at = |milliseconds| start + Duration::from_millis(milliseconds);
        assert!(!late.wants_better(at(540)) && late.wants_better(at(550)));
        assert_eq!(late.samples(false, at(550)), 4);
        late.drew(4, LATE);
        assert!(!late.wants_better(at(700)));
        // It moves again: how long fine images take is known.
        assert_eq!(late.samples(true, at(800)), 1);
    }

    #[test]
    fn retries() {
        let (start, mut fineness) = (Instant::now(), Fineness::default());
        // The third is at 150 ms, so that one at 5150 ms is tried, and the next one after as long.
        let found = samples(&mut fineness, start, &[LATE; 210]);
        let fine: Vec<usize> = (1..).zip(found).filter(|(_, samples)| *samples == FINE).map(|(k, _)| k).collect();
        assert_eq!(fine, [1, 2, 3, 103, 203]);
        // It has become faster: the next try is the last.
        let found = samples(&mut fineness, start + Duration::from_millis(50 * 210), &[QUICK; 100]);
        assert_eq!((found[91], found[92], found[99]), (1, 4, 4));
    }
}

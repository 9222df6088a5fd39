//! How many samples a pixel of a window gets, so that what moves is seen to move.

use std::time::{Duration, Instant};

/// Samples per pixel of what rests, and of what moves where those take too long.
const FINE: u8 = 4;
const COARSE: u8 = 1;
/// Pictures take no longer than this where they can: 30 in a second.
const BUDGET: Duration = Duration::from_millis(33);
/// Part of the budget that fine pictures must fit in to be drawn again, so that it does not change to and fro.
const ROOM: f64 = 0.8;
/// What has not changed for so long rests.
const REST: Duration = Duration::from_millis(250);

/// What was found out about the pictures of a window.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Fineness {
    /// When what is shown changed last.
    moved: Option<Instant>,
    /// How long the last fine picture took.
    fine: Option<Duration>,
    /// How long the first coarse one after it took.
    coarse: Option<Duration>,
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
        let slow = self.fine.is_some_and(|took| took > BUDGET);
        if slow && !rests { COARSE } else { FINE }
    }

    /// A picture was drawn.
    pub(super) fn drew(&mut self, samples: u8, took: Duration) {
        self.last = Some(samples);
        if samples == FINE {
            (self.fine, self.coarse) = (Some(took), None);
            return;
        }
        let (Some(fine), Some(coarse)) = (self.fine, self.coarse) else {
            self.coarse = Some(took);
            return;
        };
        // What made coarse pictures faster makes fine ones faster.
        let expected = fine.mul_f64(took.as_secs_f64() / coarse.as_secs_f64().max(1e-6));
        if expected < BUDGET.mul_f64(ROOM) {
            (self.fine, self.coarse) = (None, None);
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

    const SLOW: Duration = Duration::from_millis(50);
    const FAST: Duration = Duration::from_millis(20);

    /// Pictures that took so long, 50 ms apart, and the samples of each.
    fn samples(fineness: &mut Fineness, start: Instant, pictures: &[(bool, Duration)]) -> Vec<u8> {
        let mut now = start;
        let mut one = |&(changed, took): &(bool, Duration)| {
            now += Duration::from_millis(50);
            let samples = fineness.samples(changed, now);
            fineness.drew(samples, took);
            samples
        };
        pictures.iter().map(&mut one).collect()
    }

    #[test]
    fn what_moves_slowly_is_coarse_and_what_rests_is_fine() {
        let start = Instant::now();
        // Fast enough: fine all the time.
        assert_eq!(samples(&mut Fineness::default(), start, &[(true, FAST); 20]), [4; 20]);
        let mut slow = Fineness::default();
        assert_eq!(samples(&mut slow, start, &[(true, SLOW), (true, FAST), (true, FAST)]), [4, 1, 1]);
        // It stops at 150 ms; a quarter of a second later it is drawn again, once.
        let at = |milliseconds| start + Duration::from_millis(milliseconds);
        assert!(!slow.wants_better(at(390)) && slow.wants_better(at(400)));
        assert_eq!(slow.samples(false, at(400)), 4);
        slow.drew(4, SLOW);
        assert!(!slow.wants_better(at(500)));
        // It moves again: how long fine pictures take is known.
        assert_eq!(slow.samples(true, at(600)), 1);
    }

    #[test]
    fn fine_pictures_come_back_when_they_fit() {
        let (start, mut fineness) = (Instant::now(), Fineness::default());
        // Coarse pictures become twice as fast: fine ones are expected to take 25 ms.
        let pictures = [(true, SLOW), (true, FAST), (true, FAST / 2), (true, FAST)];
        assert_eq!(samples(&mut fineness, start, &pictures), [4, 1, 1, 4]);
        // A little faster is not enough: 40 ms.
        let pictures = [(true, SLOW), (true, FAST), (true, FAST * 4 / 5), (true, FAST)];
        assert_eq!(samples(&mut Fineness::default(), start, &pictures), [4, 1, 1, 1]);
    }
}

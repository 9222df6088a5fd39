//! How many threads draw a window, so that physics has its time.

use crate::control::Speed;
use crate::stage::Run;
use std::time::{Duration, Instant};

/// Slower than this part of the speed that it should have, physics is held up.
const KEPT: f64 = 0.97;
/// How long it is left alone after that.
const RESPECT: Duration = Duration::from_secs(5);

/// Late measurements in a row before physics is taken to be held up: one of half a second may be late for another reason.
const LATE: u32 = 2;

/// The threads of a window.
#[derive(Clone, Copy, Debug)]
pub(super) struct Desks {
    most: usize,
    /// The last measurement of the speed. That another one came is seen by its value, which is a quotient of nanoseconds.
    measured: Option<f64>,
    /// Late measurements in a row.
    late: u32,
    /// When physics was seen to fall behind last.
    behind: Option<Instant>,
}

impl Desks {
    /// At most so many threads, and at least one.
    pub(super) fn new(threads: usize) -> Self {
        Self { most: threads.max(1), measured: None, late: 0, behind: None }
    }

    /// How many threads draw the next picture. Physics that keeps its pace rests between steps: what is left of the machine's time
    /// is the picture's.
    pub(super) fn now(&mut self, run: &Run, now: Instant) -> usize {
        let rests = run.paused || run.timeline.is_some();
        let measured = run.measured_speed.filter(|_| !rests);
        if measured != self.measured {
            let is_late = matches!((run.speed, measured), (Speed::Times(wanted), Some(speed)) if speed < KEPT * wanted);
            self.late = if is_late { self.late + 1 } else { 0 };
            self.measured = measured;
        }
        if self.late >= LATE {
            self.behind = Some(now);
        }
        let late = self.behind.is_some_and(|then| now.saturating_duration_since(then) < RESPECT);
        let busy = !rests && (run.speed == Speed::Free || late);
        if busy { (self.most / 2).max(1) } else { self.most }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::Timeline;

    #[test]
    fn half_of_the_threads() {
        let start = Instant::now();
        let at = |run: &Run, desks: &mut Desks, seconds: f64| desks.now(run, start + Duration::from_secs_f64(seconds));
        let real = |measured_speed| Run { speed: Speed::REAL, measured_speed, ..Run::default() };
        for (most, half) in [(1, 1), (2, 1), (3, 1), (8, 4)] {
            let mut desks = Desks::new(most);
            assert_eq!(at(&Run::default(), &mut desks, 0.0), half, "as fast as can be");
            assert_eq!(at(&real(None), &mut desks, 0.0), most, "nothing is known yet");
            assert_eq!(at(&real(Some(0.99)), &mut desks, 0.5), most);
            // Late once, however many pictures show it, and then not again.
            assert_eq!([1.0, 1.1, 1.2].map(|s| at(&real(Some(0.8)), &mut desks, s)), [most; 3]);
            assert_eq!(at(&real(Some(1.0)), &mut desks, 1.5), most);
            // It fell behind, and is left alone, also when it has caught up; not where it is held, or a recording.
            assert_eq!(at(&real(Some(0.91)), &mut desks, 1.9), most);
            assert_eq!(at(&real(Some(0.9)), &mut desks, 2.0), half);
            assert_eq!(at(&real(Some(1.0)), &mut desks, 6.9), half);
            assert_eq!(at(&Run { paused: true, ..real(Some(1.0)) }, &mut desks, 6.9), most);
            let timeline = Some(Timeline { now: 0.0, start: 0.0, end: 1.0 });
            assert_eq!(at(&Run { timeline, ..real(Some(1.0)) }, &mut desks, 6.9), most);
            assert_eq!(at(&real(Some(1.0)), &mut desks, 7.1), most);
            // Slow motion is a pace, too.
            let slow = |measured| Run { speed: Speed::Times(0.1), measured_speed: Some(measured), ..Run::default() };
            assert_eq!([at(&slow(0.1), &mut desks, 8.0), at(&slow(0.091), &mut desks, 8.5)], [most; 2]);
            assert_eq!(at(&slow(0.09), &mut desks, 9.0), half);
        }
    }
}

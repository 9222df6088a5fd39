//! Number of rendering threads of a window, limited in favor of physics.

use crate::control::Speed;
use crate::scene_view::RunState;
use std::time::{Duration, Instant};

/// Share of the requested speed below which physics is late.
const MIN_SPEED_RATIO: f64 = 0.97;
/// Time for which half of the threads render after physics was last late.
const HOLD_TIME: Duration = Duration::from_secs(5);

/// Consecutive late measurements after which physics counts as held up. One measurement of half a second may be late
/// for other reasons.
const LATE_MEASUREMENTS: u32 = 2;

/// Thread budget of a window.
#[derive(Clone, Copy, Debug)]
pub(super) struct ThreadBudget {
    max_threads: usize,
    /// Last measurement of the speed. A different value marks a new measurement, since the value is a quotient of
    /// nanoseconds.
    measured: Option<f64>,
    /// Number of consecutive late measurements.
    late_count: u32,
    /// Time at which physics was last seen to be late.
    late_since: Option<Instant>,
}

impl ThreadBudget {
    /// Creates a budget of at most `threads` threads, and at least one.
    pub(super) fn new(threads: usize) -> Self {
        Self { max_threads: threads.max(1), measured: None, late_count: 0, late_since: None }
    }

    /// Returns the number of threads for the next image. Physics that keeps up with real time sleeps between steps, so
    /// the image may use the remaining time of all cores.
    pub(super) fn threads(&mut self, run: &RunState, now: Instant) -> usize {
        let rests = run.paused || run.timeline.is_some();
        let measured = run.measured_speed.filter(|_| !rests);
        if measured != self.measured {
            let is_late = matches!((run.speed, measured), (Speed::Factor(wanted), Some(speed)) if speed < MIN_SPEED_RATIO * wanted);
            self.late_count = if is_late { self.late_count + 1 } else { 0 };
            self.measured = measured;
        }
        if self.late_count >= LATE_MEASUREMENTS {
            self.late_since = Some(now);
        }
        let late = self.late_since.is_some_and(|then| now.saturating_duration_since(then) < HOLD_TIME);
        let busy = !rests && (run.speed == Speed::Unlimited || late);
        if busy { (self.max_threads / 2).max(1) } else { self.max_threads }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene_view::Timeline;

    #[test]
    fn half_of_the_threads() {
        let start = Instant::now();
        let at = |run: &RunState, desks: &mut ThreadBudget, seconds: f64| {
            desks.threads(run, start + Duration::from_secs_f64(seconds))
        };
        let real = |measured_speed| RunState { speed: Speed::REAL_TIME, measured_speed, ..RunState::default() };
        for (most, half) in [(1, 1), (2, 1), (3, 1), (8, 4)] {
            let mut desks = ThreadBudget::new(most);
            assert_eq!(at(&RunState::default(), &mut desks, 0.0), half, "as fast as can be");
            assert_eq!(at(&real(None), &mut desks, 0.0), most, "nothing is known yet");
            assert_eq!(at(&real(Some(0.99)), &mut desks, 0.5), most);
            // A single late measurement has no effect, however many images show it.
            assert_eq!([1.0, 1.1, 1.2].map(|s| at(&real(Some(0.8)), &mut desks, s)), [most; 3]);
            assert_eq!(at(&real(Some(1.0)), &mut desks, 1.5), most);
            // A late simulation keeps half of the threads even after it caught up, but not while paused or during
            // playback.
            assert_eq!(at(&real(Some(0.91)), &mut desks, 1.9), most);
            assert_eq!(at(&real(Some(0.9)), &mut desks, 2.0), half);
            assert_eq!(at(&real(Some(1.0)), &mut desks, 6.9), half);
            assert_eq!(at(&RunState { paused: true, ..real(Some(1.0)) }, &mut desks, 6.9), most);
            let timeline = Some(Timeline { time: 0.0, start: 0.0, end: 1.0 });
            assert_eq!(at(&RunState { timeline, ..real(Some(1.0)) }, &mut desks, 6.9), most);
            assert_eq!(at(&real(Some(1.0)), &mut desks, 7.1), most);
            // Slow motion is also a requested speed.
            let slow = |measured| RunState {
                speed: Speed::Factor(0.1),
                measured_speed: Some(measured),
                ..RunState::default()
            };
            assert_eq!([at(&slow(0.1), &mut desks, 8.0), at(&slow(0.091), &mut desks, 8.5)], [most; 2]);
            assert_eq!(at(&slow(0.09), &mut desks, 9.0), half);
        }
    }
}

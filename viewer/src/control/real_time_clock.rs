//! Real-time clock: measures the speed of simulated time and throttles it to the requested speed.

use super::Speed;
use std::time::{Duration, Instant};

/// Lag beyond which lost time is dropped. A simulation that was paused does not rush to catch up.
const MAX_LAG: Duration = Duration::from_millis(200);
/// Duration of one speed measurement.
const MEASURE_INTERVAL: Duration = Duration::from_millis(500);
/// Approximate longest time between two checks for commands.
const CHECK_INTERVAL: Duration = Duration::from_millis(8);

/// Clock of a simulation that has viewers.
#[derive(Debug)]
pub(super) struct RealTimeClock {
    speed: Speed,
    dt: f64,
    /// A time and the step that was due at that time.
    schedule_start: (Instant, u64),
    /// Start of the speed measurement: time and step.
    measure_start: (Instant, u64),
    measured: Option<f64>,
    /// Approximate wall-clock duration of one step, without throttling.
    step_time: Duration,
    /// End of the last wait or of the last recorded steps: time and step.
    last_wait_end: (Instant, u64),
}

impl RealTimeClock {
    pub(super) fn new(dt: f64, steps: u64, now: Instant) -> Self {
        let mark = (now, steps);
        let step_time = Duration::from_millis(4);
        Self {
            speed: Speed::Unlimited,
            dt,
            schedule_start: mark,
            measure_start: mark,
            measured: None,
            step_time,
            last_wait_end: mark,
        }
    }

    pub(super) fn speed(&self) -> Speed {
        self.speed
    }

    pub(super) fn set_speed(&mut self, speed: Speed, steps: u64, now: Instant) {
        self.speed = speed;
        self.restart(steps, now);
    }

    /// Restarts the schedule and the measurement, after a pause, a step command or a speed change.
    pub(super) fn restart(&mut self, steps: u64, now: Instant) {
        (self.schedule_start, self.measure_start, self.last_wait_end, self.measured) =
            ((now, steps), (now, steps), (now, steps), None);
    }

    /// Returns simulated seconds per second of the last complete measurement, or `None` before the first one.
    pub(super) fn measured(&self) -> Option<f64> {
        self.measured
    }

    /// Updates the measurements after steps were done.
    pub(super) fn record_steps(&mut self, steps: u64, now: Instant) {
        let (since, first) = self.last_wait_end;
        let done = steps.saturating_sub(first);
        if done > 0 {
            let each = now.saturating_duration_since(since) / u32::try_from(done).unwrap_or(u32::MAX);
            self.step_time = (self.step_time * 3 + each) / 4;
        }
        self.last_wait_end = (now, steps);
        let (began, first) = self.measure_start;
        let long = now.saturating_duration_since(began);
        if long >= MEASURE_INTERVAL {
            self.measured = Some(steps.saturating_sub(first) as f64 * self.dt / long.as_secs_f64());
            self.measure_start = (now, steps);
        }
    }

    /// Returns the time to wait before the next step; zero if the simulation lags behind or its speed is unlimited.
    pub(super) fn time_ahead(&mut self, steps: u64, now: Instant) -> Duration {
        let Speed::Factor(factor) = self.speed else { return Duration::ZERO };
        let (began, first) = self.schedule_start;
        let due = began + Duration::from_secs_f64(steps.saturating_sub(first) as f64 * self.dt / factor);
        if now.saturating_duration_since(due) > MAX_LAG {
            self.schedule_start = (now, steps);
        }
        due.saturating_duration_since(now)
    }

    /// Marks the end of a wait.
    pub(super) fn end_wait(&mut self, steps: u64, now: Instant) {
        self.last_wait_end = (now, steps);
    }

    /// Returns the number of steps until the next check for commands.
    pub(super) fn steps_until_check(&self) -> u64 {
        let by_work = CHECK_INTERVAL.as_secs_f64() / self.step_time.as_secs_f64().max(1e-9);
        let by_pace = match self.speed {
            Speed::Unlimited => f64::INFINITY,
            Speed::Factor(factor) => CHECK_INTERVAL.as_secs_f64() * factor / self.dt,
        };
        (by_work.min(by_pace) as u64).clamp(1, 100_000)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 0.01;

    #[test]
    fn waits() {
        let start = Instant::now();
        let millis = Duration::from_millis;
        let mut pace = RealTimeClock::new(DT, 5, start);
        assert_eq!(pace.time_ahead(50, start), Duration::ZERO, "free speed never waits");
        for (what, speed, steps, passed, expected) in [
            ("ten steps are 100 ms, 30 ms are gone", Speed::REAL_TIME, [5, 15].as_slice(), 30, 70),
            ("slow motion", Speed::Factor(0.1), &[5, 15], 0, 1000),
            // One second behind: no wait, and the schedule restarts here.
            ("lost time is given up", Speed::REAL_TIME, &[0, 1, 2], 1000, 10),
            // The machine slept for a day: no rush of eight million steps.
            ("a day is given up", Speed::REAL_TIME, &[0, 1, 2], 86_400_000, 10),
        ] {
            pace.set_speed(speed, steps[0], start);
            let waits: Vec<_> =
                steps[1..].iter().map(|&steps| pace.time_ahead(steps, start + millis(passed))).collect();
            let (last, before) = waits.split_last().expect("a step");
            assert!(last.abs_diff(millis(expected)) < Duration::from_micros(1), "{what}: {last:?}");
            assert!(before.iter().all(Duration::is_zero), "{what}: {before:?}");
        }
    }

    /// The speed is measured over half a second, and checks for commands are some milliseconds apart.
    #[test]
    fn measured_speed() {
        let start = Instant::now();
        let mut pace = RealTimeClock::new(DT, 0, start);
        pace.record_steps(10, start + Duration::from_millis(100));
        assert_eq!(pace.measured(), None);
        pace.record_steps(100, start + Duration::from_millis(500));
        assert!(pace.measured().is_some_and(|speed| (speed - 2.0).abs() < 1e-9), "{:?}", pace.measured());

        let mut pace = RealTimeClock::new(0.001, 0, start);
        // Repeated steps of 20 µs.
        for k in 1..40u32 {
            pace.record_steps(u64::from(k) * 100, start + Duration::from_millis(2) * k);
        }
        let block = pace.steps_until_check();
        assert!((300..=400).contains(&block), "8 ms are 400 steps: {block}");
        pace.set_speed(Speed::REAL_TIME, 0, start);
        assert_eq!(pace.steps_until_check(), 8);
    }
}

//! Schedules of sensors: periods of a whole number of physics steps, counted in integers.

use crate::error::SensorError;

/// Relative tolerance of `update_period / dt` from a whole number. Decimal seconds are not exact in binary, and 1/30 s
/// written with ten digits is still accepted.
const TOLERANCE: f64 = 1e-8;
/// Absolute tolerance in physics steps: over 1e5 steps, the relative tolerance would accept fractions.
const TOLERANCE_STEPS: f64 = 1e-3;
/// Whole numbers above this are not exact in f64.
const MAX_STEPS: f64 = 9_007_199_254_740_992.0;

/// The period of a sensor in physics steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    period_steps: u64,
}

impl Schedule {
    /// Creates a schedule with a measurement every `update_period` \[s\], at physics steps of `dt` \[s\]. Period 0 is
    /// every step.
    ///
    /// With `round_period`, a period that is not a whole number of steps becomes the nearest one (at least 1).
    ///
    /// # Errors
    ///
    /// A step that is not positive and finite; a period that is negative, not finite, or at least 2^53 steps; without
    /// `round_period`, a period that differs from a whole number of steps by more than 1e-8 of it, or by more than 1e-3
    /// steps.
    pub fn new(update_period: f64, dt: f64, round_period: bool) -> Result<Self, SensorError> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(SensorError::InvalidTimeStep { dt });
        }
        let steps = update_period / dt;
        if !(update_period >= 0.0 && steps < MAX_STEPS) {
            return Err(SensorError::InvalidPeriod { update_period });
        }
        if update_period == 0.0 {
            return Ok(Self { period_steps: 1 });
        }
        let whole = steps.round().max(1.0);
        if !round_period && (steps - whole).abs() > (TOLERANCE * whole).min(TOLERANCE_STEPS) {
            return Err(SensorError::PeriodNotMultiple { update_period, dt, steps, nearest: whole * dt });
        }
        Ok(Self { period_steps: whole as u64 })
    }

    /// The period in physics steps, at least 1.
    pub fn period_steps(self) -> u64 {
        self.period_steps
    }

    /// Creates the step counters of this schedule for `num_envs` environments, all at step 0.
    pub fn phases(self, num_envs: usize) -> Phases {
        Phases { schedule: self, envs: vec![Phase { start: 0, last_query: 0 }; num_envs] }
    }
}

/// Step counters of a [`Schedule`]: each environment counts from its own last reset.
#[derive(Clone, Debug)]
pub struct Phases {
    schedule: Schedule,
    envs: Vec<Phase>,
}

#[derive(Clone, Copy, Debug)]
struct Phase {
    /// Physics step of the environment at which the sensor was reset.
    start: u64,
    /// Physics step of the environment at the last query.
    last_query: u64,
}

impl Phases {
    /// Value for a quarantined (diverged) environment in the steps of [`due_in`](Self::due_in), which skips this
    /// environment.
    pub const QUARANTINED: u64 = u64::MAX;

    /// Schedule that the environments are counted by.
    pub fn schedule(&self) -> Schedule {
        self.schedule
    }

    /// Returns true if environment `env`, which is at physics step `step`, measures now. Measurements are due at whole
    /// periods after the reset, not at the reset itself. Repeated calls at the same step return true only once. A due
    /// step that is skipped is not caught up: the next call at a due step returns true.
    ///
    /// `step` is [`kinetoscope_scene::SceneState::step`]. A quarantined environment, whose step does not change,
    /// measures nothing.
    ///
    /// # Panics
    ///
    /// If the environment does not exist, or if steps went backwards without [`reset`](Self::reset).
    #[track_caller]
    pub fn is_due(&mut self, env: usize, step: u64) -> bool {
        self.take_due_count(env, step) > 0
    }

    /// Returns the number of measurements of environment `env`, which is at physics step `step`, that fell due since
    /// the last query. The number is 0 if [`is_due`](Self::is_due) would return false, else at least 1. It exceeds 1 if
    /// due steps were not queried, as for a lazy sensor that was not read.
    ///
    /// # Panics
    ///
    /// Same as [`is_due`](Self::is_due).
    #[track_caller]
    pub fn take_due_count(&mut self, env: usize, step: u64) -> u64 {
        let fallen_due = self.due_count(env, step);
        self.envs[env].last_query = step;
        fallen_due
    }

    /// Returns the result of [`take_due_count`](Self::take_due_count) without recording a query.
    #[track_caller]
    pub(crate) fn due_count(&self, env: usize, step: u64) -> u64 {
        let (phase, period) = (&self.envs[env], self.schedule.period_steps);
        assert!(
            step >= phase.last_query,
            "environment {env} went from step {} to {step} without a reset",
            phase.last_query
        );
        let before = (phase.last_query - phase.start) / period;
        let run = step - phase.start;
        if run.is_multiple_of(period) { run / period - before } else { 0 }
    }

    /// Returns the steps until the next environment is due, at least 1, with the environments at `steps`; one period if
    /// all environments are quarantined.
    pub fn due_in(&self, steps: impl IntoIterator<Item = u64>) -> u64 {
        self.min_wait(steps, |wait| wait)
    }

    /// Returns the minimum over all environments of `of` applied to the steps until the environment is due. Quarantined
    /// environments are skipped; without any other, returns one period.
    pub(crate) fn min_wait(&self, steps: impl IntoIterator<Item = u64>, of: impl Fn(u64) -> u64) -> u64 {
        let running =
            steps.into_iter().take(self.envs.len()).enumerate().filter(|(_, step)| *step != Self::QUARANTINED);
        running.map(|(env, step)| of(self.steps_until_due(env, step))).min().unwrap_or(self.schedule.period_steps)
    }

    /// Returns the steps until environment `env`, which is at physics step `step`, is due: 1 to a period.
    #[track_caller]
    pub(crate) fn steps_until_due(&self, env: usize, step: u64) -> u64 {
        let period = self.schedule.period_steps;
        period - step.saturating_sub(self.envs[env].start) % period
    }

    /// Resets environment `env`: the next measurement falls one period after `step`.
    ///
    /// # Panics
    ///
    /// If the environment does not exist.
    #[track_caller]
    pub fn reset(&mut self, env: usize, step: u64) {
        self.envs[env] = Phase { start: step, last_query: step };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schedule(update_period: f64, dt: f64) -> Schedule {
        Schedule::new(update_period, dt, false).unwrap()
    }

    #[test]
    fn periods() {
        for (period, dt, steps) in [
            (0.0, 0.005, 1),
            (0.005, 0.005, 1),
            (0.02, 0.005, 4),
            (0.1, 0.005, 20),
            (0.3, 0.1, 3),
            (1.0 / 30.0, 1.0 / 240.0, 8),
            (3600.0, 1e-4, 36_000_000),
        ] {
            assert_eq!(schedule(period, dt).period_steps(), steps);
        }
        for n in 1..10_000u32 {
            for dt in [0.001, 0.002, 0.005, 0.01, 1.0 / 60.0, 1.0 / 240.0, 0.0025] {
                assert_eq!(schedule(f64::from(n) * dt, dt).period_steps(), u64::from(n));
            }
        }
        let error = Schedule::new(0.033, 0.005, false).unwrap_err();
        assert!(matches!(error, SensorError::PeriodNotMultiple { nearest, .. } if nearest == 0.035), "{error}");
        assert!(error.to_string().contains("round_period"), "{error}");
        assert!(Schedule::new(0.001, 0.005, false).is_err(), "shorter than a step");
        assert!(Schedule::new(1e6 + 0.005, 0.01, false).is_err(), "half a step too long");
        let rounded = |period| Schedule::new(period, 0.005, true);
        assert_eq!([0.033, 0.001].map(|period| rounded(period).unwrap().period_steps()), [7, 1]);
        for bad in [-0.1, f64::NAN, f64::INFINITY, 1e300] {
            assert!(matches!(rounded(bad), Err(SensorError::InvalidPeriod { .. })));
        }
        for bad in [0.0, -0.1, f64::NAN, f64::INFINITY] {
            assert!(matches!(Schedule::new(0.1, bad, true), Err(SensorError::InvalidTimeStep { .. })));
        }
    }

    /// Counting seconds in f32 turns intervals of 20 steps into 21 after 3200 steps.
    #[test]
    fn million_steps() {
        let mut phases = schedule(0.1, 0.005).phases(1);
        let due = (1..=1_000_000u64).filter(|&step| phases.is_due(0, step));
        assert!(due.eq((1..=50_000).map(|k| 20 * k)));
    }

    /// Measurements that were not read are counted, and steps without a due measurement may be skipped.
    #[test]
    fn skipped_steps() {
        let mut phases = schedule(0.02, 0.005).phases(1);
        phases.reset(0, 3);
        assert_eq!([3, 7, 7, 19, 20, 23].map(|step| phases.take_due_count(0, step)), [0, 1, 0, 3, 0, 1]);
        let mut phases = schedule(0.02, 0.005).phases(2);
        phases.reset(1, 3);
        let (mut step, mut due) = (0, [Vec::new(), Vec::new()]);
        while step < 20 {
            step += phases.due_in([step, step.max(3)]);
            // Environment 1 starts late: it is queried from its own step 3 on.
            [0, 1].into_iter().filter(|&env| phases.is_due(env, step)).for_each(|env| due[env].push(step));
        }
        assert_eq!(due, [vec![4, 8, 12, 16, 20], vec![7, 11, 15, 19]]);
        // A quarantined environment one step before its due step would otherwise make every block one step long.
        let phases = schedule(0.1, 0.005).phases(2);
        assert_eq!(phases.due_in([19, 5]), 1, "a running environment is due in one step");
        assert_eq!(phases.due_in([Phases::QUARANTINED, 5]), 15);
        assert_eq!(phases.due_in([Phases::QUARANTINED; 2]), 20, "without a running environment, one period");
    }

    #[test]
    fn resets() {
        let mut phases = schedule(0.02, 0.005).phases(2);
        assert!(!phases.is_due(0, 0) && !phases.is_due(1, 0), "nothing at the start");
        let mut due = [Vec::new(), Vec::new()];
        for tick in 1..=12u64 {
            // Environment 1 is reset after tick 6 and counts from 0 again.
            if tick == 7 {
                phases.reset(1, 0);
            }
            for (env, step) in [(0, tick), (1, if tick > 6 { tick - 6 } else { tick })] {
                if phases.is_due(env, step) {
                    due[env].push(tick);
                }
                assert!(!phases.is_due(env, step), "once per step");
            }
        }
        assert_eq!(due, [vec![4, 8, 12], vec![4, 10]]);
        // A reset of the sensor alone keeps the steps of the environment.
        phases.reset(0, 13);
        assert!((14..17).all(|step| !phases.is_due(0, step)) && phases.is_due(0, 17));
    }

    #[test]
    #[should_panic(expected = "without a reset")]
    fn going_back() {
        let mut phases = schedule(0.0, 0.005).phases(1);
        phases.is_due(0, 5);
        phases.is_due(0, 4);
    }
}

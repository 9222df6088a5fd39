//! Time stamps of a recording, which continue over resets.

/// The clock of a recording.
///
/// The recorded time of an environment equals its simulation time until the environment is reset or put into another
/// state. Its simulation time then jumps, which viewers do not support. Its recorded time continues from the time
/// of the reset.
#[derive(Clone, Debug)]
pub(crate) struct RecordingClock {
    dt: f64,
    /// Number of physics steps of the simulation when the recording began.
    first_step: u64,
    /// Simulation time of each environment when the recording began \[s\].
    start_times: Vec<f64>,
    /// Difference of recorded time and simulation time of each environment \[s\].
    offsets: Vec<f64>,
}

impl RecordingClock {
    pub(crate) fn new(dt: f64, steps: u64, times: &[f64]) -> Self {
        Self { dt, first_step: steps, start_times: times.to_vec(), offsets: vec![0.0; times.len()] }
    }

    /// Converts the physics steps of the simulation to physics steps since the recording began.
    pub(crate) fn step(&self, steps: u64) -> u64 {
        steps - self.first_step
    }

    /// Present time of the recording \[s\]: environment 0's start time plus the elapsed time.
    pub(crate) fn time(&self, steps: u64) -> f64 {
        self.start_times.first().copied().unwrap_or(0.0) + self.elapsed(steps)
    }

    /// Recorded time of a simulation time of an environment \[s\].
    pub(crate) fn recorded_time(&self, env: usize, time: f64) -> f64 {
        time + self.offsets[env]
    }

    /// Adjusts the offsets after resets and writes. `times` are the present simulation times of all environments \[s\].
    pub(crate) fn resync(&mut self, env_ids: &[usize], times: &[f64], steps: u64) {
        for &env in env_ids {
            let now = self.start_times[env] + self.elapsed(steps);
            // Rounding errors of summed steps are far below half a step. A larger difference means that the time was
            // set.
            if (times[env] + self.offsets[env] - now).abs() > 0.5 * self.dt {
                self.offsets[env] = now - times[env];
            }
        }
    }

    fn elapsed(&self, steps: u64) -> f64 {
        self.step(steps) as f64 * self.dt
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resets() {
        let mut clock = RecordingClock::new(0.25, 8, &[2.0, 2.0]);
        assert_eq!([clock.recorded_time(0, 2.5), clock.recorded_time(1, 2.5)], [2.5, 2.5]);
        clock.resync(&[1], &[2.5, 0.0], 10);
        assert_eq!([clock.recorded_time(0, 2.75), clock.recorded_time(1, 0.25)], [2.75, 2.75]);
        // A write to joints does not change the time.
        clock.resync(&[0], &[2.5, 0.0], 10);
        assert_eq!(clock.recorded_time(0, 2.75), 2.75);
        assert_eq!((clock.step(10), clock.time(10)), (2, 2.5));
        // Set to 7 s at the recorded time of 3 s: 0.25 s later is the recorded time 3.25 s.
        clock.resync(&[0], &[7.0, 0.5], 12);
        assert_eq!(clock.recorded_time(0, 7.25), 3.25);
    }
}

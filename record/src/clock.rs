//! The time of a recording: simulation time that goes on over a reset.

/// The clock of a recording.
///
/// Until an environment is reset, or put into another state, its recorded times are its simulation times. Afterwards its
/// simulation time starts anew, which no viewer follows; its recorded times go on from the moment of the reset.
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    dt: f64,
    /// Steps of the simulation when the recording began.
    first: u64,
    /// Simulation time of every environment when the recording began \[s\].
    start: Vec<f64>,
    /// What is added to simulation times \[s\].
    offsets: Vec<f64>,
}

impl Clock {
    pub(crate) fn new(dt: f64, steps: u64, times: &[f64]) -> Self {
        Self { dt, first: steps, start: times.to_vec(), offsets: vec![0.0; times.len()] }
    }

    /// Steps since the recording began.
    pub(crate) fn step(&self, steps: u64) -> u64 {
        steps - self.first
    }

    /// The time of the recording, that of environment 0 \[s\].
    pub(crate) fn now(&self, steps: u64) -> f64 {
        self.start.first().copied().unwrap_or(0.0) + self.elapsed(steps)
    }

    /// The recorded time of an instant of an environment \[s\].
    pub(crate) fn stamp(&self, env: usize, time: f64) -> f64 {
        time + self.offsets[env]
    }

    /// After environments were reset or written to: `times` are the simulation times of all now \[s\].
    pub(crate) fn restarted(&mut self, env_ids: &[usize], times: &[f64], steps: u64) {
        for &env in env_ids {
            let now = self.start[env] + self.elapsed(steps);
            // Rounded sums of steps differ by far less than half a step: nobody set the time then.
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
        let mut clock = Clock::new(0.25, 8, &[2.0, 2.0]);
        assert_eq!([clock.stamp(0, 2.5), clock.stamp(1, 2.5)], [2.5, 2.5]);
        clock.restarted(&[1], &[2.5, 0.0], 10);
        assert_eq!([clock.stamp(0, 2.75), clock.stamp(1, 0.25)], [2.75, 2.75]);
        // Joints that were written leave the time alone.
        clock.restarted(&[0], &[2.5, 0.0], 10);
        assert_eq!(clock.stamp(0, 2.75), 2.75);
        assert_eq!((clock.step(10), clock.now(10)), (2, 2.5));
        // Put to 7 s when 3 s are recorded: what is 0.25 s later is at 3.25 s.
        clock.restarted(&[0], &[7.0, 0.5], 12);
        assert_eq!(clock.stamp(0, 7.25), 3.25);
    }
}

//! Since when bodies touch and do not, counted in physics steps.

/// Phases of contact of all bodies in all environments.
#[derive(Clone, Debug)]
pub(super) struct AirTimes {
    bodies: usize,
    dt: f64,
    threshold: f64,
    /// Step at which each environment was last looked at.
    seen: Vec<u64>,
    /// Body after body, environment after environment.
    phases: Vec<Phase>,
    /// Net forces of one environment.
    net: Vec<f64>,
}

/// What a body has been doing, in physics steps.
#[derive(Clone, Copy, Debug, Default)]
struct Phase {
    touches: bool,
    air: u64,
    contact: u64,
    last_air: u64,
    last_contact: u64,
    /// Whether contact began, or ended, since the last measurement.
    began: bool,
    ended: bool,
}

impl AirTimes {
    /// Names and units of the numbers of a measurement, one per body each.
    pub(super) const CHANNELS: [(&'static str, &'static str); 6] = [
        ("current_air_time", "s"),
        ("current_contact_time", "s"),
        ("last_air_time", "s"),
        ("last_contact_time", "s"),
        ("first_contact", ""),
        ("first_air", ""),
    ];

    pub(super) fn new(num_envs: usize, bodies: usize, dt: f64, threshold: f64) -> Self {
        let (seen, phases) = (vec![0; num_envs], vec![Phase::default(); num_envs * bodies]);
        Self { bodies, dt, threshold, seen, phases, net: vec![0.0; 3 * bodies] }
    }

    /// Looks at environment `env` at `step`; `net_forces` adds the net forces on its bodies.
    pub(super) fn look(&mut self, env: usize, step: u64, net_forces: impl FnOnce(&mut [f64])) {
        let steps = step.saturating_sub(self.seen[env]);
        if steps == 0 {
            return;
        }
        self.seen[env] = step;
        self.net.fill(0.0);
        net_forces(&mut self.net);
        let phases = &mut self.phases[env * self.bodies..(env + 1) * self.bodies];
        for (phase, force) in phases.iter_mut().zip(self.net.chunks_exact(3)) {
            phase.look(touches(force, self.threshold), steps);
        }
    }

    /// Starts environment `env` anew at `step`: bodies have been touching, or not, for no time at all.
    pub(super) fn reset(&mut self, env: usize, step: u64, net_forces: impl FnOnce(&mut [f64])) {
        self.seen[env] = step;
        self.net.fill(0.0);
        net_forces(&mut self.net);
        let phases = &mut self.phases[env * self.bodies..(env + 1) * self.bodies];
        for (phase, force) in phases.iter_mut().zip(self.net.chunks_exact(3)) {
            *phase = Phase { touches: touches(force, self.threshold), ..Phase::default() };
        }
    }

    /// Writes [`CHANNELS`](Self::CHANNELS) of environment `env` to `row`, all bodies of one after all of the other.
    pub(super) fn read(&self, env: usize, row: &mut [f64]) {
        let phases = &self.phases[env * self.bodies..(env + 1) * self.bodies];
        for (b, phase) in phases.iter().enumerate() {
            let times = [phase.air, phase.contact, phase.last_air, phase.last_contact].map(|n| n as f64 * self.dt);
            let flags = [phase.began, phase.ended].map(|flag| f64::from(u8::from(flag)));
            for (channel, value) in times.into_iter().chain(flags).enumerate() {
                row[channel * self.bodies + b] = value;
            }
        }
    }

    /// Forgets what began and ended in environment `env`: a measurement has told it.
    pub(super) fn told(&mut self, env: usize) {
        for phase in &mut self.phases[env * self.bodies..(env + 1) * self.bodies] {
            (phase.began, phase.ended) = (false, false);
        }
    }
}

/// Whether a force counts as contact.
fn touches(force: &[f64], threshold: f64) -> bool {
    force.iter().map(|f| f * f).sum::<f64>() > threshold * threshold
}

impl Phase {
    /// The body touched, or did not, in the last `steps` steps.
    fn look(&mut self, touches: bool, steps: u64) {
        if touches && !self.touches {
            (self.began, self.last_air, self.contact) = (true, self.air, 0);
        } else if !touches && self.touches {
            (self.ended, self.last_contact, self.air) = (true, self.contact, 0);
        }
        self.touches = touches;
        if touches {
            (self.contact, self.air) = (self.contact + steps, 0);
        } else {
            (self.air, self.contact) = (self.air + steps, 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases() {
        let mut times = AirTimes::new(1, 1, 0.5, 1.0);
        let force = |f: f64| move |net: &mut [f64]| net[2] += f;
        times.reset(0, 0, force(0.0));
        let (mut row, mut reads) = ([0.0; 6], Vec::new());
        for (k, f) in [0.0, 0.9, 1.0, 5.0, 5.0, 0.0, 2.0, 0.0, 0.0].into_iter().enumerate() {
            times.look(0, k as u64 + 1, force(f));
            times.read(0, &mut row);
            times.told(0);
            reads.push(row);
        }
        // Air, contact, last air, last contact, first contact, first air; exactly 1 N is not above the threshold.
        let expected = [
            [0.5, 0.0, 0.0, 0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [1.5, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.5, 1.5, 0.0, 1.0, 0.0],
            [0.0, 1.0, 1.5, 0.0, 0.0, 0.0],
            [0.5, 0.0, 1.5, 1.0, 0.0, 1.0],
            [0.0, 0.5, 0.5, 1.0, 1.0, 0.0],
            [0.5, 0.0, 0.5, 0.5, 0.0, 1.0],
            [1.0, 0.0, 0.5, 0.5, 0.0, 0.0],
        ];
        assert_eq!(reads, expected);
    }

    /// The next measurement reports a touch between two; a touch at the reset is no first contact.
    #[test]
    fn first_contact() {
        let mut row = [0.0; 6];
        let mut times = AirTimes::new(1, 1, 0.5, 1.0);
        for (step, f) in [(1, 0.0), (2, 9.0), (3, 0.0), (4, 0.0)] {
            times.look(0, step, |net| net[0] += f);
        }
        times.read(0, &mut row);
        assert_eq!(row, [1.0, 0.0, 0.5, 0.5, 1.0, 1.0]);
        let mut times = AirTimes::new(2, 1, 0.5, 1.0);
        times.reset(1, 0, |net| net[1] = -3.0);
        times.look(1, 1, |net| net[1] = -3.0);
        times.look(1, 1, |net| net[1] = 0.0);
        times.read(1, &mut row);
        assert_eq!(row, [0.0, 0.5, 0.0, 0.0, 0.0, 0.0]);
        times.read(0, &mut row);
        assert_eq!(row, [0.0; 6], "the other environment");
    }
}

//! Air and contact times of bodies, counted in physics steps.

/// Contact phases of all bodies in all environments.
#[derive(Clone, Debug)]
pub(super) struct ContactTimers {
    bodies: usize,
    dt: f64,
    threshold: f64,
    /// Physics step of the last update of each environment.
    last_step: Vec<u64>,
    /// Phases, environment by environment, body by body.
    phases: Vec<ContactPhase>,
    /// Net forces of one environment \[N\], reused.
    net: Vec<f64>,
}

/// Contact phase of a body, in physics steps.
#[derive(Clone, Copy, Debug, Default)]
struct ContactPhase {
    in_contact: bool,
    air: u64,
    contact: u64,
    last_air: u64,
    last_contact: u64,
    /// True if contact began since the last measurement; `ended` is the same for the end of contact.
    began: bool,
    ended: bool,
}

impl ContactTimers {
    /// Names and units of the channels of a measurement, each with one number per body.
    pub(super) const CHANNELS: [(&'static str, &'static str); 6] = [
        ("current_air_time", "s"),
        ("current_contact_time", "s"),
        ("last_air_time", "s"),
        ("last_contact_time", "s"),
        ("first_contact", ""),
        ("first_air", ""),
    ];

    pub(super) fn new(num_envs: usize, bodies: usize, dt: f64, threshold: f64) -> Self {
        let (last_step, phases) = (vec![0; num_envs], vec![ContactPhase::default(); num_envs * bodies]);
        Self { bodies, dt, threshold, last_step, phases, net: vec![0.0; 3 * bodies] }
    }

    /// Updates environment `env` at the physics step `step`; `net_forces` adds the net forces on its bodies \[N\]. Does
    /// nothing at the step of the last update or reset.
    pub(super) fn update(&mut self, env: usize, step: u64, net_forces: impl FnOnce(&mut [f64])) {
        let steps = step.saturating_sub(self.last_step[env]);
        if steps == 0 {
            return;
        }
        self.last_step[env] = step;
        self.net.fill(0.0);
        net_forces(&mut self.net);
        let phases = &mut self.phases[env * self.bodies..(env + 1) * self.bodies];
        for (phase, force) in phases.iter_mut().zip(self.net.chunks_exact(3)) {
            phase.update(is_contact(force, self.threshold), steps);
        }
    }

    /// Resets environment `env` at the physics step `step`. All times restart at 0, and bodies in contact report no
    /// first contact.
    pub(super) fn reset(&mut self, env: usize, step: u64, net_forces: impl FnOnce(&mut [f64])) {
        self.last_step[env] = step;
        self.net.fill(0.0);
        net_forces(&mut self.net);
        let phases = &mut self.phases[env * self.bodies..(env + 1) * self.bodies];
        for (phase, force) in phases.iter_mut().zip(self.net.chunks_exact(3)) {
            *phase = ContactPhase { in_contact: is_contact(force, self.threshold), ..ContactPhase::default() };
        }
    }

    /// Writes [`CHANNELS`](Self::CHANNELS) of environment `env` to `row`, channel by channel, body by body.
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

    /// Clears the `began` and `ended` flags of environment `env`, after a measurement has reported them.
    pub(super) fn clear_events(&mut self, env: usize) {
        for phase in &mut self.phases[env * self.bodies..(env + 1) * self.bodies] {
            (phase.began, phase.ended) = (false, false);
        }
    }
}

/// Returns true if the magnitude of a force exceeds the contact threshold \[N\].
fn is_contact(force: &[f64], threshold: f64) -> bool {
    force.iter().map(|f| f * f).sum::<f64>() > threshold * threshold
}

impl ContactPhase {
    /// Updates the phase with the contact state of the last `steps` physics steps.
    fn update(&mut self, touches: bool, steps: u64) {
        if touches && !self.in_contact {
            (self.began, self.last_air, self.contact) = (true, self.air, 0);
        } else if !touches && self.in_contact {
            (self.ended, self.last_contact, self.air) = (true, self.contact, 0);
        }
        self.in_contact = touches;
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
        let mut times = ContactTimers::new(1, 1, 0.5, 1.0);
        let force = |f: f64| move |net: &mut [f64]| net[2] += f;
        times.reset(0, 0, force(0.0));
        let (mut row, mut reads) = ([0.0; 6], Vec::new());
        for (k, f) in [0.0, 0.9, 1.0, 5.0, 5.0, 0.0, 2.0, 0.0, 0.0].into_iter().enumerate() {
            times.update(0, k as u64 + 1, force(f));
            times.read(0, &mut row);
            times.clear_events(0);
            reads.push(row);
        }
        // Air, contact, last air, last contact, first contact, first air. A force of exactly 1 N does not exceed the
        // threshold.
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

    /// A contact between two measurements is reported by the next one. A contact at the reset is no first contact.
    #[test]
    fn first_contact() {
        let mut row = [0.0; 6];
        let mut times = ContactTimers::new(1, 1, 0.5, 1.0);
        for (step, f) in [(1, 0.0), (2, 9.0), (3, 0.0), (4, 0.0)] {
            times.update(0, step, |net| net[0] += f);
        }
        times.read(0, &mut row);
        assert_eq!(row, [1.0, 0.0, 0.5, 0.5, 1.0, 1.0]);
        let mut times = ContactTimers::new(2, 1, 0.5, 1.0);
        times.reset(1, 0, |net| net[1] = -3.0);
        times.update(1, 1, |net| net[1] = -3.0);
        times.update(1, 1, |net| net[1] = 0.0);
        times.read(1, &mut row);
        assert_eq!(row, [0.0, 0.5, 0.0, 0.0, 0.0, 0.0]);
        times.read(0, &mut row);
        assert_eq!(row, [0.0; 6], "the other environment");
    }
}

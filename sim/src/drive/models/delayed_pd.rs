//! Actuator model `delayed_pd`: the law of `ideal_pd` with delayed targets.

use super::{ActuatorLaw, JointMotion, proportional_derivative};
use crate::drive::gains::{Gains, Target};
use serde::{Deserialize, Serialize};

/// Controller with delayed targets: [`IdealPd`](super::IdealPd) with the position, velocity and effort targets of
/// `delay` steps ago. Its measurements are not delayed.
///
/// A target that is set before step n acts from step n + `delay` on. Until then, and after a reset, the targets are
/// those of the start: the initial positions, with velocity and effort 0. Steps are MuJoCo's, `physics_dt / substeps`
/// long. [`RobotMut::set_delay`](crate::RobotMut::set_delay) changes the delay at run time, per environment.
///
/// Step n uses the targets of step n - delay, with the delay at step n. If the delay grows by k, the last k applied
/// targets act again, in their order. If it shrinks by k, the next k targets never act.
///
/// A position target is clamped to the target range twice: when it is set, and again when it acts, to the range at that
/// time ([`RobotMut::set_qpos_limits`](crate::RobotMut::set_qpos_limits)).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DelayedPd {
    /// Delay of the targets when the robot is added \[MuJoCo steps\].
    pub delay: u32,
    /// Largest delay that [`RobotMut::set_delay`](crate::RobotMut::set_delay) accepts \[MuJoCo steps\]. A value below
    /// `delay` counts as `delay`.
    pub max_delay: u32,
}

/// Largest supported delay \[MuJoCo steps\]: each step takes 24 bytes in each environment.
const MAX_DELAY_STEPS: u32 = 10_000;

/// Layout of the memory of a drive: its delay, the ring position of the next target, the ring buffer of targets.
const DELAY: usize = 0;
const NEXT: usize = 1;
const RING: usize = 2;

impl DelayedPd {
    /// Capacity of the ring buffer: the largest delay \[MuJoCo steps\].
    pub fn delay_capacity(&self) -> u32 {
        self.delay.max(self.max_delay)
    }

    /// Current delay, read from the memory of a drive \[MuJoCo steps\].
    pub(crate) fn delay_of(memory: &[f64]) -> u32 {
        memory[DELAY] as u32
    }

    /// Changes the delay of a drive with this memory \[MuJoCo steps\]; the stored targets stay.
    pub(crate) fn set_delay(memory: &mut [f64], steps: u32) {
        memory[DELAY] = f64::from(steps);
    }
}

impl ActuatorLaw for DelayedPd {
    fn name(&self) -> &'static str {
        "delayed_pd"
    }

    fn check(&self, _gains: &Gains) -> Result<(), String> {
        if self.delay_capacity() > MAX_DELAY_STEPS {
            return Err(format!(
                "the larger of delay and max_delay is {} steps; the maximum is {MAX_DELAY_STEPS}",
                self.delay_capacity()
            ));
        }
        Ok(())
    }

    fn initial_memory(&self) -> Vec<f64> {
        let mut memory = vec![0.0; RING + 3 * self.delay_capacity() as usize];
        memory[DELAY] = f64::from(self.delay);
        memory
    }

    fn reset_memory(&self, target: &Target, memory: &mut [f64]) {
        for slot in memory[RING..].as_chunks_mut::<3>().0 {
            *slot = [target.position, target.velocity, target.feedforward];
        }
    }

    fn effort(&self, now: &JointMotion, target: &Target, gains: &Gains, memory: &[f64]) -> f64 {
        let ring = memory[RING..].as_chunks::<3>().0;
        let delayed = match (memory[DELAY] as usize).min(ring.len()) {
            0 => *target,
            delay => {
                // A hand-made file may hold any number.
                let next = memory[NEXT] as usize % ring.len();
                let [position, velocity, feedforward] = ring[(next + ring.len() - delay) % ring.len()];
                // The target was in range when it was set; the range may be narrower now.
                let [low, high] = now.range;
                Target { position: position.max(low).min(high), velocity, feedforward }
            }
        };
        proportional_derivative(now, &delayed, gains).clamp(-gains.max_effort, gains.max_effort)
    }

    fn update_memory(&self, target: &Target, memory: &mut [f64]) {
        let next = memory[NEXT] as usize;
        let ring = memory[RING..].as_chunks_mut::<3>().0;
        let slots = ring.len();
        if slots > 0 {
            ring[next % slots] = [target.position, target.velocity, target.feedforward];
            memory[NEXT] = ((next % slots + 1) % slots) as f64;
        }
    }
}

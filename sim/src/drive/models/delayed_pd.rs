//! Actuator model `delayed_pd`: the law of `ideal_pd` with targets of some steps ago.

use super::{ActuatorLaw, JointMotion, proportional_derivative};
use crate::drive::gains::{Gains, Target};
use serde::{Deserialize, Serialize};

/// A controller that hears of its targets some steps later: [`IdealPd`](super::IdealPd) with the position, velocity and
/// effort targets of `delay` steps ago; what it measures is not delayed.
///
/// A target that is set before step n acts from step n + `delay` on. Until then, and after a reset, the targets are those at
/// the start: the initial positions. Steps are MuJoCo's, `physics_dt / substeps` long. The delay may differ between
/// environments and change while the simulation runs: [`RobotMut::set_delay`](crate::RobotMut::set_delay).
///
/// Step n hears the targets of step n - delay, with the delay as it is in step n. Where the delay grows by k
/// the last k targets that have acted act once more, in their order, and the line goes on from there; where it falls by k the
/// next k targets never act.
///
/// A position target is clamped to the range of targets twice: when it is set, and when it acts, as the range is then
/// ([`RobotMut::set_qpos_limits`](crate::RobotMut::set_qpos_limits)).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DelayedPd {
    /// Delay at first \[steps\].
    pub delay: u32,
    /// The longest delay that may be set later \[steps\]; at least `delay`.
    pub max_delay: u32,
}

/// The longest delay there may be \[steps\]: each one is 24 bytes in each environment.
const LONGEST: u32 = 10_000;

/// The memory of a drive: its delay, where the next target goes, and the targets in a ring.
const DELAY: usize = 0;
const NEXT: usize = 1;
const RING: usize = 2;

impl DelayedPd {
    /// The longest delay that there is room for \[steps\].
    pub fn longest(&self) -> u32 {
        self.delay.max(self.max_delay)
    }

    /// The delay of a drive with this memory \[steps\].
    pub(crate) fn delay_of(memory: &[f64]) -> u32 {
        memory[DELAY] as u32
    }

    /// Changes the delay of a drive with this memory; the targets in it stay as they are.
    pub(crate) fn set_delay(memory: &mut [f64], steps: u32) {
        memory[DELAY] = f64::from(steps);
    }
}

impl ActuatorLaw for DelayedPd {
    fn name(&self) -> &'static str {
        "delayed_pd"
    }

    fn check(&self, _gains: &Gains) -> Result<(), String> {
        if self.longest() > LONGEST {
            return Err(format!("delay and max_delay are up to {} steps; {LONGEST} are the most", self.longest()));
        }
        Ok(())
    }

    fn memory(&self) -> Vec<f64> {
        let mut memory = vec![0.0; RING + 3 * self.longest() as usize];
        memory[DELAY] = f64::from(self.delay);
        memory
    }

    fn start(&self, target: &Target, memory: &mut [f64]) {
        for slot in memory[RING..].as_chunks_mut::<3>().0 {
            *slot = [target.position, target.velocity, target.feedforward];
        }
    }

    fn effort(&self, now: &JointMotion, target: &Target, gains: &Gains, memory: &[f64]) -> f64 {
        let ring = memory[RING..].as_chunks::<3>().0;
        let heard = match (memory[DELAY] as usize).min(ring.len()) {
            0 => *target,
            delay => {
                // A file that was made by hand may hold any number.
                let next = memory[NEXT] as usize % ring.len();
                let [position, velocity, feedforward] = ring[(next + ring.len() - delay) % ring.len()];
                // It was inside of the range when it was set; the range may be tighter by now.
                let [low, high] = now.range;
                Target { position: position.max(low).min(high), velocity, feedforward }
            }
        };
        proportional_derivative(now, &heard, gains).clamp(-gains.max_effort, gains.max_effort)
    }

    fn remember(&self, target: &Target, memory: &mut [f64]) {
        let next = memory[NEXT] as usize;
        let ring = memory[RING..].as_chunks_mut::<3>().0;
        let slots = ring.len();
        if slots > 0 {
            ring[next % slots] = [target.position, target.velocity, target.feedforward];
            memory[NEXT] = ((next % slots + 1) % slots) as f64;
        }
    }
}

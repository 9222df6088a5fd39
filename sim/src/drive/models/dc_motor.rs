//! Actuator model `dc_motor`: the available effort falls with the speed.

use super::{ActuatorLaw, JointMotion, proportional_derivative};
use crate::drive::gains::{Gains, Target};
use serde::{Deserialize, Serialize};

/// DC motor with a gear, as in Isaac Lab 2. In all four quadrants of speed and effort, the effort of
/// [`IdealPd`](super::IdealPd) is limited to the range
///
/// ```text
/// max(s (-1 - v / v_max), -max_effort)  to  min(s (1 - v / v_max), max_effort)
/// ```
///
/// with the stall effort s ([`saturation_effort`](Self::saturation_effort)), the continuous limit `max_effort` and the
/// no-load speed `v_max`, which is the drive's `max_velocity` (`DriveCfg::max_velocity`, or the velocity limit of the
/// URDF). The speed in this formula is clamped to ±`v_max` (1 + `max_effort` / s), where the motor brakes with all of
/// `max_effort`.
///
/// On its torque-speed line the motor is an explicit damper of s / `v_max`: a joint of inertia M at the no-load speed
/// is stable for h s / `v_max` < 2 M. `add_robot` warns if s / `v_max` or the gains are too large for the time step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DcMotor {
    /// Stall effort \[N m or N\]. It depends on the motor, so it has no default.
    pub saturation_effort: f64,
}

impl DcMotor {
    /// Smallest and largest effort \[N m or N\] at a joint velocity \[rad/s or m/s\].
    fn range(&self, velocity: f64, gains: &Gains) -> [f64; 2] {
        let (stall, limit) = (self.saturation_effort, gains.max_effort);
        let fastest = 1.0 + limit / stall;
        let speed = (velocity / gains.max_velocity).clamp(-fastest, fastest);
        [(stall * (-1.0 - speed)).max(-limit), (stall * (1.0 - speed)).min(limit)]
    }
}

impl ActuatorLaw for DcMotor {
    fn name(&self) -> &'static str {
        "dc_motor"
    }

    fn check(&self, gains: &Gains) -> Result<(), String> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        if !positive(self.saturation_effort) {
            return Err(format!("saturation_effort is {}; it must be finite and above 0", self.saturation_effort));
        }
        if !positive(gains.max_velocity) {
            return Err(format!(
                "max_velocity is {}; a dc_motor needs its no-load speed, finite and above 0: set drive.max_velocity, or the \
                 velocity limit of the joint in the URDF",
                gains.max_velocity
            ));
        }
        if !gains.max_effort.is_finite() {
            return Err(format!(
                "max_effort is {}; a dc_motor needs its continuous effort, finite: set drive.max_effort, or the effort limit \
                 of the joint in the URDF",
                gains.max_effort
            ));
        }
        Ok(())
    }

    fn damping(&self, gains: &Gains) -> f64 {
        gains.kd.max(self.saturation_effort / gains.max_velocity)
    }

    fn effort(&self, now: &JointMotion, target: &Target, gains: &Gains, _memory: &[f64]) -> f64 {
        let [least, most] = self.range(now.velocity, gains);
        // At the ends of the speed range both limits are equal up to rounding, and `clamp` would panic on swapped ones.
        proportional_derivative(now, target, gains).max(least).min(most)
    }
}

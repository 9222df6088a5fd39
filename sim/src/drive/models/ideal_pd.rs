//! Actuator model `ideal_pd`: tau = clamp(kp (q* - q) + kd (v* - v) + tau_ff, ±max_effort).

use super::{ActuatorLaw, JointMotion, proportional_derivative};
use crate::drive::gains::{Gains, Target};
use serde::{Deserialize, Serialize};

/// Ideal PD controller with an effort limit.
///
/// ```text
/// tau = clamp(kp (q* - q) + kd (v* - v) + tau_ff, ±max_effort)
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IdealPd {}

impl ActuatorLaw for IdealPd {
    fn name(&self) -> &'static str {
        "ideal_pd"
    }

    fn check(&self, _gains: &Gains) -> Result<(), String> {
        Ok(())
    }

    fn effort(&self, now: &JointMotion, target: &Target, gains: &Gains, _memory: &[f64]) -> f64 {
        proportional_derivative(now, target, gains).clamp(-gains.max_effort, gains.max_effort)
    }
}

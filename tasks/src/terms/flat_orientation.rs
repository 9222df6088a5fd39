//! Reward for an upright root link.

use crate::reward::RewardTerm;
use kinetoscope_sim::RobotId;

/// Squared sine of the angle between the z axis of the root link and the direction of gravity: 0 for an upright root, 1
/// for one on its side. It is also 0 upside down and without gravity. A penalty needs a negative `weight`.
pub fn flat_orientation(name: &str, weight: f64, robot: RobotId) -> RewardTerm {
    RewardTerm::new(name, weight, move |now| {
        let gravity = now.robot(robot).projected_gravity_b();
        Ok(gravity.rows().into_iter().map(|down| down[0] * down[0] + down[1] * down[1]).collect())
    })
}

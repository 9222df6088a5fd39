//! Reward for an upright root link.

use crate::reward::RewardTerm;
use kinetoscope_sim::RobotId;

/// Squared sine of the angle between the z axes of the root link and of the world: 0 where the robot stands upright.
pub fn flat_orientation(name: &str, weight: f64, robot: RobotId) -> RewardTerm {
    RewardTerm::new(name, weight, move |now| {
        let gravity = now.sim().robot(robot).projected_gravity_b();
        Ok(gravity.rows().into_iter().map(|down| down[0] * down[0] + down[1] * down[1]).collect())
    })
}

//! Standing upright, as a reward.

use crate::reward::RewardTerm;
use kinetoscope_sim::RobotId;

/// The square of the sine of the angle between the upward axis of the root link and the world's: 0 where it stands upright.
pub fn flat_orientation(name: &str, weight: f64, robot: RobotId) -> RewardTerm {
    RewardTerm::new(name, weight, move |now| {
        let gravity = now.sim().robot(robot).projected_gravity_b();
        Ok(gravity.rows().into_iter().map(|down| down[0] * down[0] + down[1] * down[1]).collect())
    })
}

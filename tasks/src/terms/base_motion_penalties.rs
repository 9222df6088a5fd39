//! Rewards of the root link's velocity that no command asks for.

use crate::reward::RewardTerm;
use kinetoscope_sim::RobotId;

/// Squared velocity of the root link's origin along the z axis of the root link \[m²/s²\]; Isaac Lab's `lin_vel_z_l2`.
/// A penalty needs a negative `weight`.
pub fn lin_vel_z_l2(name: &str, weight: f64, robot: RobotId) -> RewardTerm {
    RewardTerm::new(name, weight, move |now| Ok(now.robot(robot).root_lin_vel_b().column(2).mapv(|v| v * v)))
}

/// Sum of the squared angular velocities about the x and y axes of the root link \[rad²/s²\]; Isaac Lab's
/// `ang_vel_xy_l2`. A penalty needs a negative `weight`.
pub fn ang_vel_xy_l2(name: &str, weight: f64, robot: RobotId) -> RewardTerm {
    RewardTerm::new(name, weight, move |now| {
        let rates = now.robot(robot).root_ang_vel_b();
        Ok(rates.rows().into_iter().map(|rate| rate[0] * rate[0] + rate[1] * rate[1]).collect())
    })
}

//! Reward of joint accelerations.

use super::{find_joints, sum_over_joints};
use crate::error::Result;
use crate::reward::RewardTerm;
use kinetoscope_sim::{RobotId, SimulationManager};

/// Sum of the squared joint accelerations in the last physics step ([`qacc`](kinetoscope_sim::Robot::qacc))
/// \[rad²/s⁴ or m²/s⁴\], over the joints that match one of `patterns` (whole names); Isaac Lab's `joint_acc_l2`. A
/// penalty needs a negative `weight`.
///
/// # Errors
/// A pattern is invalid or matches no joint, or two patterns match the same joint.
///
/// # Panics
/// The robot belongs to another manager.
pub fn joint_acc_l2(
    sim: &SimulationManager,
    name: &str,
    weight: f64,
    robot: RobotId,
    patterns: &[&str],
) -> Result<RewardTerm> {
    let (_, joints) = find_joints(sim, robot, patterns)?;
    Ok(RewardTerm::new(name, weight, move |now| {
        Ok(sum_over_joints(now.robot(robot).qacc(), &joints, |_, acceleration| acceleration * acceleration))
    }))
}

//! Reward of joint efforts.

use super::{find_joints, sum_over_joints};
use crate::error::Result;
use crate::reward::RewardTerm;
use kinetoscope_sim::{RobotId, SimulationManager};

/// Sum of the squared drive efforts ([`qf`](kinetoscope_sim::Robot::qf)) in the last physics step \[N² m² or N²\], over
/// the joints that match one of `patterns` (whole names). Joints without a drive add 0. A penalty needs a negative
/// `weight`.
///
/// # Errors
/// A pattern is invalid or matches no joint, or two patterns match the same joint.
///
/// # Panics
/// The robot belongs to another manager.
pub fn joint_torques_l2(
    sim: &SimulationManager,
    name: &str,
    weight: f64,
    robot: RobotId,
    patterns: &[&str],
) -> Result<RewardTerm> {
    let (_, joints) = find_joints(sim, robot, patterns)?;
    Ok(RewardTerm::new(name, weight, move |now| {
        Ok(sum_over_joints(now.robot(robot).qf(), &joints, |_, effort| effort * effort))
    }))
}

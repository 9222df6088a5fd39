//! Reward of joint positions near the initial ones.

use super::{find_joints, sum_over_joints};
use crate::error::Result;
use crate::reward::RewardTerm;
use kinetoscope_sim::{RobotId, SimulationManager};

/// Sum of the absolute differences between the joint positions and the initial ones \[rad or m\], over the joints that
/// match one of `patterns` (whole names); Isaac Lab's `joint_deviation_l1`. A penalty needs a negative `weight`.
///
/// # Errors
/// A pattern is invalid or matches no joint, or two patterns match the same joint.
///
/// # Panics
/// The robot belongs to another manager.
pub fn joint_deviation_l1(
    sim: &SimulationManager,
    name: &str,
    weight: f64,
    robot: RobotId,
    patterns: &[&str],
) -> Result<RewardTerm> {
    let (_, joints) = find_joints(sim, robot, patterns)?;
    let starts = sim.robot(robot).default_qpos().row(0).to_owned();
    Ok(RewardTerm::new(name, weight, move |now| {
        Ok(sum_over_joints(now.robot(robot).qpos(), &joints, |joint, position| (position - starts[joint]).abs()))
    }))
}

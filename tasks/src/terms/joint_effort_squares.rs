//! Reward of joint efforts.

use super::{find_joints, select_joints};
use crate::error::Result;
use crate::reward::RewardTerm;
use kinetoscope_sim::{RobotId, SimulationManager};
use ndarray::Axis;

/// Sum of the squared drive efforts in the last physics step \[N² m² or N²\], over the joints that match one of
/// `patterns` (whole names).
///
/// # Errors
/// A pattern matches no joint.
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
        let efforts = select_joints(&now.sim().robot(robot).qf(), &joints);
        Ok(efforts.map_axis(Axis(1), |row| row.iter().map(|x| x * x).sum()))
    }))
}

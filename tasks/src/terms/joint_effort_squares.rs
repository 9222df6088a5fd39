//! What drives give, as a reward.

use super::{columns, joints};
use crate::error::Result;
use crate::reward::RewardTerm;
use ndarray::Axis;
use kinetoscope_sim::{RobotId, SimulationManager};

/// Sum of the squares of the efforts of the drives of joints that match one of `patterns` (whole names) in the last physics step
/// \[N² m² or N²\].
///
/// # Errors
/// A pattern that matches nothing.
///
/// # Panics
/// The robot is of another manager.
pub fn joint_effort_squares(
    sim: &SimulationManager,
    name: &str,
    weight: f64,
    robot: RobotId,
    patterns: &[&str],
) -> Result<RewardTerm> {
    let (_, joints) = joints(sim, robot, patterns)?;
    Ok(RewardTerm::new(name, weight, move |now| {
        let efforts = columns(&now.sim().robot(robot).qf(), &joints);
        Ok(efforts.map_axis(Axis(1), |row| row.iter().map(|x| x * x).sum()))
    }))
}

//! Termination by the height of the root link.

use crate::termination::TerminationTerm;
use kinetoscope_sim::RobotId;

/// Terminates where the root link of a robot is below `height` in its environment \[m\].
pub fn root_height_below_minimum(name: &str, robot: RobotId, height: f64) -> TerminationTerm {
    TerminationTerm::new(name, move |now| Ok(now.sim().robot(robot).root_pose().column(2).mapv(|z| z < height)))
}

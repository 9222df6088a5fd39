//! Robots that fall.

use crate::termination::TerminationTerm;
use kinetoscope_sim::RobotId;

/// Ends where the root link of a robot is below a height in its environment \[m\].
pub fn base_below(name: &str, robot: RobotId, height: f64) -> TerminationTerm {
    TerminationTerm::new(name, move |now| Ok(now.sim().robot(robot).root_pose().column(2).mapv(|z| z < height)))
}

//! Termination by the height of the root link.

use crate::termination::TerminationTerm;
use kinetoscope_sim::RobotId;

/// Terminates the episodes of environments in which the z coordinate of the root link's origin is below `height` \[m\],
/// in the environment frame (not above terrain).
pub fn root_height_below_minimum(name: &str, robot: RobotId, height: f64) -> TerminationTerm {
    TerminationTerm::new(name, move |now| Ok(now.robot(robot).root_pose().column(2).mapv(|z| z < height)))
}

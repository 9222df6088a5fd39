//! Positions and efforts of joints.

use super::joint_observation;
use crate::error::Result;
use crate::observation::ObservationTerm;
use kinetoscope_sim::{RobotId, RobotState, SimulationManager};

/// Joint positions \[rad or m\]; columns as in [`joint_pos_rel`](super::joint_pos_rel).
///
/// # Errors
/// A pattern is invalid or matches no joint, or two patterns match the same joint.
///
/// # Panics
/// The robot belongs to another manager.
pub fn joint_pos(sim: &SimulationManager, name: &str, robot: RobotId, patterns: &[&str]) -> Result<ObservationTerm> {
    joint_observation(sim, name, robot, patterns, RobotState::qpos, |_, position| position)
}

/// Efforts of the drives in the last physics step \[N m or N\]; 0 for joints without a drive. Columns as in
/// [`joint_pos_rel`](super::joint_pos_rel).
///
/// # Errors
/// A pattern is invalid or matches no joint, or two patterns match the same joint.
///
/// # Panics
/// The robot belongs to another manager.
pub fn joint_effort(sim: &SimulationManager, name: &str, robot: RobotId, patterns: &[&str]) -> Result<ObservationTerm> {
    joint_observation(sim, name, robot, patterns, RobotState::qf, |_, effort| effort)
}

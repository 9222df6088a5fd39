//! Termination by joint limits.

use super::find_joints;
use crate::error::Result;
use crate::termination::TerminationTerm;
use kinetoscope_sim::{RobotId, SimulationManager};
use ndarray::{Array1, Axis};

/// Terminates the episodes of environments in which a joint that matches one of `patterns` (whole names) is beyond its
/// soft limits ([`soft_qpos_limits`](kinetoscope_sim::Robot::soft_qpos_limits)). Joints without limits never terminate
/// an episode.
///
/// # Errors
/// A pattern is invalid or matches no joint, or two patterns match the same joint.
///
/// # Panics
/// The robot belongs to another manager.
pub fn joint_out_of_limits(
    sim: &SimulationManager,
    name: &str,
    robot: RobotId,
    patterns: &[&str],
) -> Result<TerminationTerm> {
    let (_, joints) = find_joints(sim, robot, patterns)?;
    Ok(TerminationTerm::new(name, move |now| {
        let (positions, limits) = (now.robot(robot).qpos(), now.sim().robot(robot).soft_qpos_limits());
        let is_out = |env: usize| {
            joints.iter().any(|joint| {
                let (at, range) = (positions[(env, joint.0)], limits.index_axis(Axis(0), env));
                at < range[(joint.0, 0)] || at > range[(joint.0, 1)]
            })
        };
        Ok((0..now.num_envs()).map(is_out).collect::<Array1<bool>>())
    }))
}

//! Random initial joint states.

use super::{check_range, find_joints};
use crate::episode_rng::env_ids;
use crate::error::{Result, TermKind};
use crate::event::EventTerm;
use kinetoscope_sim::{RobotId, SimulationManager};
use ndarray::Array2;

/// Creates an event that sets the joints that match one of `patterns` (whole names) to random states when an episode
/// begins. An offset from `positions` \[rad or m\] is added to the default position, and the sum is clamped to the
/// joint limits. The velocity is from `velocities` \[rad/s or m/s\]. Both ranges are \[low, high\], uniformly
/// distributed, with a number for each joint. Position targets stay at their defaults.
///
/// # Errors
/// A pattern is invalid or matches no joint, two patterns match the same joint, or the ends of a range are not finite or
/// not in order.
///
/// # Panics
/// The robot belongs to another manager.
pub fn reset_joints_by_offset(
    sim: &SimulationManager,
    name: &str,
    robot: RobotId,
    patterns: &[&str],
    positions: [f64; 2],
    velocities: [f64; 2],
) -> Result<EventTerm> {
    for (field, range) in [("positions", positions), ("velocities", velocities)] {
        check_range(TermKind::Event, name, field, range)?;
    }
    let (_, joints) = find_joints(sim, robot, patterns)?;
    Ok(EventTerm::on_reset(name, move |sim, rngs| {
        let starts = sim.robot(robot).default_qpos();
        let size = (rngs.len(), joints.len());
        let (mut at, mut moving) = (Array2::zeros(size), Array2::zeros(size));
        for (k, rng) in rngs.iter_mut().enumerate() {
            let env = rng.env().0;
            let (from, [low, high]) = (joints.iter().map(|joint| starts[(env, joint.0)]), positions);
            at.row_mut(k).iter_mut().zip(from).for_each(|(to, from)| *to = rng.uniform_range(low, high) + from);
            let [low, high] = velocities;
            moving.row_mut(k).iter_mut().for_each(|to| *to = rng.uniform_range(low, high));
        }
        let envs = env_ids(rngs);
        // Written positions are clamped to the limits.
        sim.robot_mut(robot).write_qpos(&at, Some(&joints), Some(&envs))?;
        sim.robot_mut(robot).write_qvel(&moving, Some(&joints), Some(&envs))?;
        Ok(())
    }))
}

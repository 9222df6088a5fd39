//! Random initial joint states.

use super::find_joints;
use crate::error::Result;
use crate::event::EventTerm;
use kinetoscope_sim::{RobotId, SimulationManager};
use ndarray::Array2;

/// Creates an event that sets the joints that match one of `patterns` (whole names) to random states when an episode
/// begins. An offset from `positions` \[rad or m\] is added to the default position, and the sum is clamped to the
/// joint limits. The velocity is from `velocities` \[rad/s or m/s\]. Both ranges are \[low, high\], uniformly
/// distributed, with a number for each joint. Position targets stay at their defaults.
///
/// # Errors
/// A pattern is invalid or matches no joint, or two patterns match the same joint.
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
    let (_, joints) = find_joints(sim, robot, patterns)?;
    Ok(EventTerm::on_reset(name, move |sim, rngs| {
        let starts = sim.robot(robot).default_qpos();
        for rng in rngs {
            let env = rng.env();
            let mut drawn =
                |[low, high]: [f64; 2]| Array2::from_shape_fn((1, joints.len()), |_| rng.uniform_range(low, high));
            let (mut at, moving) = (drawn(positions), drawn(velocities));
            at.indexed_iter_mut().for_each(|((_, k), x)| *x += starts[(env.0, joints[k].0)]);
            // Written positions are clamped to the limits.
            sim.robot_mut(robot).write_qpos(&at, Some(&joints), Some(&[env]))?;
            sim.robot_mut(robot).write_qvel(&moving, Some(&joints), Some(&[env]))?;
        }
        Ok(())
    }))
}

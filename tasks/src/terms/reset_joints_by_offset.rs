//! Joints that begin somewhere.

use super::joints;
use crate::error::Result;
use crate::event::EventTerm;
use ndarray::Array2;
use kinetoscope_sim::{RobotId, SimulationManager};

/// Puts joints that match one of `patterns` (whole names) beside their start when an episode begins: the start and a number drawn
/// uniformly from `positions` \[rad or m\], within their limits, with a velocity drawn from `velocities` \[rad/s or m/s\].
///
/// # Errors
/// A pattern that matches nothing.
///
/// # Panics
/// The robot is of another manager.
pub fn reset_joints_by_offset(
    sim: &SimulationManager,
    name: &str,
    robot: RobotId,
    patterns: &[&str],
    positions: [f64; 2],
    velocities: [f64; 2],
) -> Result<EventTerm> {
    let (_, joints) = joints(sim, robot, patterns)?;
    Ok(EventTerm::on_reset(name, move |sim, dice| {
        let starts = sim.robot(robot).default_qpos();
        for die in dice {
            let env = die.env();
            let mut drawn = |[low, high]: [f64; 2]| Array2::from_shape_fn((1, joints.len()), |_| die.between(low, high));
            let (mut at, moving) = (drawn(positions), drawn(velocities));
            at.indexed_iter_mut().for_each(|((_, k), x)| *x += starts[(env.0, joints[k].0)]);
            // Written positions are clamped to the limits.
            sim.robot_mut(robot).write_qpos(&at, Some(&joints), Some(&[env]))?;
            sim.robot_mut(robot).write_qvel(&moving, Some(&joints), Some(&[env]))?;
        }
        Ok(())
    }))
}

//! Reward for tracking a velocity command.

use crate::reward::RewardTerm;
use kinetoscope_sim::RobotId;

/// Reward `weight` exp(-d² / `std`²) for tracking a velocity command.
///
/// d is the distance between the x and y velocity of the root link's origin, in the axes of the root link, and the
/// first two columns of the command term called `command` \[m/s\]. The step fails if there is no such term, or if it
/// has fewer than two columns.
pub fn track_lin_vel(name: &str, weight: f64, robot: RobotId, command: impl Into<String>, std: f64) -> RewardTerm {
    let command = command.into();
    RewardTerm::new(name, weight, move |now| {
        let (moves, wanted) = (now.robot(robot).root_lin_vel_b(), now.command(&command)?);
        if wanted.ncols() < 2 {
            let found = wanted.ncols();
            return Err(format!("the command {command:?} has {found} columns; it needs at least two, x and y").into());
        }
        let pairs = moves.rows().into_iter().zip(wanted.rows());
        let square =
            |k: usize, is: &ndarray::ArrayView1<'_, f64>, to: &ndarray::ArrayView1<'_, f64>| (is[k] - to[k]).powi(2);
        Ok(pairs.map(|(is, to)| (-(square(0, &is, &to) + square(1, &is, &to)) / (std * std)).exp()).collect())
    })
}

//! Reward for tracking a turning rate.

use crate::reward::RewardTerm;
use kinetoscope_sim::RobotId;

/// Reward `weight` exp(-d² / `std`²) for tracking a turning rate; Isaac Lab's `track_ang_vel_z_exp`.
///
/// d is the difference between the angular velocity about the z axis of the root link and the third column of the
/// command term called `command` \[rad/s\]. The step fails if there is no such term, or if it has fewer than three
/// columns.
pub fn track_ang_vel(name: &str, weight: f64, robot: RobotId, command: impl Into<String>, std: f64) -> RewardTerm {
    let command = command.into();
    RewardTerm::new(name, weight, move |now| {
        let (turning, wanted) = (now.robot(robot).root_ang_vel_b(), now.command(&command)?);
        if wanted.ncols() < 3 {
            let found = wanted.ncols();
            return Err(format!(
                "the command {command:?} has {found} columns; it needs at least three: x, y and the turning rate"
            )
            .into());
        }
        let pairs = turning.column(2).into_iter().zip(wanted.column(2));
        Ok(pairs.map(|(is, to)| (-(is - to).powi(2) / (std * std)).exp()).collect())
    })
}

//! Pushes of robots.

use super::check_range;
use crate::episode_rng::env_ids;
use crate::error::{Result, TermKind};
use crate::event::{EventMode, EventTerm};
use kinetoscope_sim::RobotId;
use ndarray::Array2;

/// Creates an event that pushes a robot: it adds random numbers to the velocity of the root link's origin \[m/s\] and
/// to its angular velocity \[rad/s\], in world axes. Isaac Lab's `push_by_setting_velocity` does the same. Ranges are
/// \[low, high\] along x, y and z, uniformly distributed. With a fixed base, the event returns an error.
///
/// # Errors
/// The ends of a range are not finite or not in order.
pub fn push_by_setting_velocity(
    name: &str,
    mode: EventMode,
    robot: RobotId,
    linear: [[f64; 2]; 3],
    angular: [[f64; 2]; 3],
) -> Result<EventTerm> {
    for (field, ranges) in [("linear", linear), ("angular", angular)] {
        ranges.into_iter().try_for_each(|range| check_range(TermKind::Event, name, field, range))?;
    }
    let ranges = [linear, angular].concat();
    Ok(EventTerm::with_context(name, mode, move |now, rngs| {
        let present = now.robot(robot).root_velocity();
        let mut velocities = Array2::zeros((rngs.len(), 6));
        for (mut row, rng) in velocities.rows_mut().into_iter().zip(&mut *rngs) {
            let velocity = present.row(rng.env().0);
            for (k, [low, high]) in ranges.iter().enumerate() {
                row[k] = velocity[k] + rng.uniform_range(*low, *high);
            }
        }
        Ok(now.sim_mut().robot_mut(robot).write_root_velocity(&velocities, Some(&env_ids(rngs)))?)
    }))
}

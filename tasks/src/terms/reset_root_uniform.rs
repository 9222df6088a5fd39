//! Random initial root states.

use super::check_range;
use crate::episode_rng::{EpisodeRng, env_ids};
use crate::error::{Result, TermKind, TermResult};
use crate::event::EventTerm;
use kinetoscope_scene::pose::{from_row, from_xyz_rpy, to_row};
use kinetoscope_sim::{RobotId, SimulationManager};
use ndarray::Array2;

/// Ranges \[low, high\] of uniformly distributed offsets from the default root pose, and of root velocities. The
/// default is no offset and no velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RootRanges {
    /// Offsets along x, y and z of the environment frame \[m\].
    pub position: [[f64; 2]; 3],
    /// Roll, pitch, yaw about the axes of the default root pose \[rad\].
    pub rpy: [[f64; 2]; 3],
    /// Linear velocity of the root link's origin in world axes \[m/s\].
    pub linear: [[f64; 2]; 3],
    /// Angular velocity in world axes \[rad/s\].
    pub angular: [[f64; 2]; 3],
}

impl RootRanges {
    /// Checks the ranges of the event called `name`.
    pub(super) fn check(&self, name: &str) -> Result<()> {
        for (field, ranges) in
            [("position", self.position), ("rpy", self.rpy), ("linear", self.linear), ("angular", self.angular)]
        {
            ranges.into_iter().try_for_each(|range| check_range(TermKind::Event, name, field, range))?;
        }
        Ok(())
    }
}

/// Creates an event that sets the root link to a random pose and velocity when an episode begins. Poses are offsets
/// from the default root pose. With a fixed base, the event returns an error.
///
/// # Errors
/// The ends of a range are not finite or not in order.
pub fn reset_root_uniform(name: &str, robot: RobotId, ranges: RootRanges) -> Result<EventTerm> {
    ranges.check(name)?;
    Ok(EventTerm::on_reset(name, move |sim, rngs| write_roots(sim, robot, ranges, rngs, |_| [0.0; 3])))
}

/// Sets the root links in the environments of `rngs` to random poses and velocities. The result of `origin` is added to
/// the position.
pub(super) fn write_roots(
    sim: &mut SimulationManager,
    robot: RobotId,
    ranges: RootRanges,
    rngs: &mut [EpisodeRng],
    origin: impl Fn(&EpisodeRng) -> [f64; 3],
) -> TermResult {
    let drawn = |rng: &mut EpisodeRng, ranges: [[f64; 2]; 3]| ranges.map(|[low, high]| rng.uniform_range(low, high));
    let starts = sim.robot(robot).default_root_pose();
    let (mut poses, mut velocities) = (Array2::zeros((rngs.len(), 7)), Array2::zeros((rngs.len(), 6)));
    for (k, rng) in rngs.iter_mut().enumerate() {
        let start: [f64; 7] = std::array::from_fn(|column| starts[(rng.env().0, column)]);
        let (position, rpy) = (drawn(rng, ranges.position), drawn(rng, ranges.rpy));
        let mut pose = from_row(&start) * from_xyz_rpy([0.0; 3], rpy);
        for offset in [position, origin(rng)] {
            pose.translation.vector += from_xyz_rpy(offset, [0.0; 3]).translation.vector;
        }
        let velocity = [drawn(rng, ranges.linear), drawn(rng, ranges.angular)].concat();
        poses.row_mut(k).iter_mut().zip(to_row(&pose)).for_each(|(to, from)| *to = from);
        velocities.row_mut(k).iter_mut().zip(velocity).for_each(|(to, from)| *to = from);
    }
    let envs = env_ids(rngs);
    let mut robot = sim.robot_mut(robot);
    robot.write_root_pose(&poses, Some(&envs))?;
    robot.write_root_velocity(&velocities, Some(&envs))?;
    Ok(())
}

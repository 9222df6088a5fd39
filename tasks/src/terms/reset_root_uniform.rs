//! Random initial root states.

use crate::episode_rng::EpisodeRng;
use crate::event::EventTerm;
use kinetoscope_scene::pose::{from_row, from_xyz_rpy, to_row};
use kinetoscope_sim::RobotId;
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

/// Creates an event that sets the root link to a random pose and velocity when an episode begins. Poses are offsets
/// from the default root pose. With a fixed base, the event returns an error.
pub fn reset_root_uniform(name: &str, robot: RobotId, ranges: RootRanges) -> EventTerm {
    let drawn = |rng: &mut EpisodeRng, ranges: [[f64; 2]; 3]| ranges.map(|[low, high]| rng.uniform_range(low, high));
    EventTerm::on_reset(name, move |sim, rngs| {
        for rng in rngs {
            let start: [f64; 7] = {
                let starts = sim.robot(robot).default_root_pose();
                std::array::from_fn(|k| starts[(rng.env().0, k)])
            };
            let (position, rpy) = (drawn(rng, ranges.position), drawn(rng, ranges.rpy));
            let mut pose = from_row(&start) * from_xyz_rpy([0.0; 3], rpy);
            pose.translation.vector += from_xyz_rpy(position, [0.0; 3]).translation.vector;
            let velocity = [drawn(rng, ranges.linear), drawn(rng, ranges.angular)].concat();
            let row = |numbers: &[f64]| Array2::from_shape_fn((1, numbers.len()), |(_, k)| numbers[k]);
            let mut robot = sim.robot_mut(robot);
            robot.write_root_pose(&row(&to_row(&pose)), Some(&[rng.env()]))?;
            robot.write_root_velocity(&row(&velocity), Some(&[rng.env()]))?;
        }
        Ok(())
    })
}

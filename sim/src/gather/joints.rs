//! One number per joint with one degree of freedom.

use crate::index::JointIndexing;
use crate::simulation::Simulation;
use ndarray::Array2;

/// Movable joints of all robots, then those of parts.
pub(super) fn all(simulation: &Simulation) -> impl Iterator<Item = &JointIndexing> {
    let of_robots = simulation.robots.iter().flat_map(|robot| &robot.joints);
    of_robots.chain(simulation.parts.iter().flat_map(|part| &part.joints))
}

/// Fills the row of an environment.
pub(super) fn fill(
    array: &mut Option<Array2<f64>>,
    env: usize,
    simulation: &Simulation,
    value: impl Fn(&JointIndexing) -> f64,
) {
    if let Some(array) = array {
        for (j, joint) in all(simulation).enumerate() {
            array[(env, j)] = value(joint);
        }
    }
}

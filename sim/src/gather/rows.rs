//! Rows of one environment: one number per joint, or quantities captured inside the step.

use crate::indexing::JointIndexing;
use crate::simulation::Simulation;
use ndarray::{Array2, Array3, Axis};

/// Joints with one degree of freedom of all robots and articulations, then the hinge and slide joints of attached MJCF
/// files.
pub(super) fn all_joints(simulation: &Simulation) -> impl Iterator<Item = &JointIndexing> {
    let of_robots = simulation.robots.iter().flat_map(|robot| &robot.joints);
    of_robots.chain(simulation.mjcf_models.iter().flat_map(|part| &part.joints))
}

/// Fills row `env` with one number for each joint of [`all_joints`], if the array exists.
pub(super) fn fill_joints(
    array: &mut Option<Array2<f64>>,
    env: usize,
    simulation: &Simulation,
    value: impl Fn(&JointIndexing) -> f64,
) {
    if let Some(array) = array {
        for (j, joint) in all_joints(simulation).enumerate() {
            array[(env, j)] = value(joint);
        }
    }
}

/// Copies captured quantities to the rows of an environment; zeros if the capture is empty after a failed step.
pub(super) fn fill_captured(values: &[f64], env: usize, array: &mut Option<Array3<f64>>) {
    if let Some(array) = array
        && let Some(row) = array.index_axis_mut(Axis(0), env).as_slice_mut()
    {
        if row.len() == values.len() { row.copy_from_slice(values) } else { row.fill(0.0) }
    }
}

//! Poses of links and objects.

use super::rows::ChunkRows;
use crate::env::SimEnv;
use crate::simulation::Simulation;
use kinetoscope_scene::pose::to_row;
use ndarray::ArrayViewMut3;

/// Fills the rows of environment `i` of the chunk.
pub(super) fn fill(simulation: &Simulation, env: &SimEnv, i: usize, state: &mut ChunkRows<'_>) {
    rows(simulation, env, i, &mut state.body_poses);
}

/// Writes the current poses to row `i` of `array`.
pub(super) fn rows(simulation: &Simulation, env: &SimEnv, i: usize, array: &mut Option<ArrayViewMut3<'_, f64>>) {
    let Some(array) = array else { return };
    for (b, link) in simulation.body_axis.bodies().iter().enumerate() {
        for (k, value) in to_row(&link.pose(env.data())).into_iter().enumerate() {
            array[(i, b, k)] = value;
        }
    }
}

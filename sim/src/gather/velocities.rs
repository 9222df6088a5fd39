//! Velocities of links and objects.

use super::rows::ChunkRows;
use crate::capture::body_velocity;
use crate::env::SimEnv;
use crate::simulation::Simulation;
use ndarray::ArrayViewMut3;

/// Fills the rows of environment `i` of the chunk.
pub(super) fn fill(simulation: &Simulation, env: &SimEnv, i: usize, state: &mut ChunkRows<'_>) {
    rows(simulation, env, i, &mut state.body_velocities);
}

/// Writes the current velocities to row `i` of `array`.
pub(super) fn rows(simulation: &Simulation, env: &SimEnv, i: usize, array: &mut Option<ArrayViewMut3<'_, f64>>) {
    let Some(array) = array else { return };
    for (b, link) in simulation.body_axis.bodies().iter().enumerate() {
        let origin = link.pose(env.data()).translation.vector;
        let [velocity, turning] = body_velocity(env.data(), link.body, &origin);
        for (k, value) in velocity.iter().chain(&turning).enumerate() {
            array[(i, b, k)] = *value;
        }
    }
}

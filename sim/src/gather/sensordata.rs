//! Values of MuJoCo's own sensors.

use super::rows::ChunkRows;
use crate::env::SimEnv;
use crate::simulation::Simulation;

/// Fills the row of environment `i` of the chunk. After a step, values of solved quantities belong to the state before
/// the step (see [`crate::capture`]).
pub(super) fn fill(_simulation: &Simulation, env: &SimEnv, i: usize, state: &mut ChunkRows<'_>) {
    if let Some(mut row) = state.sensordata.as_mut().map(|values| values.row_mut(i)) {
        row.iter_mut().zip(env.data().sensordata()).for_each(|(to, from)| *to = *from);
    }
}

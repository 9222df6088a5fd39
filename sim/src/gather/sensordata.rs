//! Values of the engine's own sensors.

use crate::env::Env;
use crate::simulation::Simulation;
use kinetoscope_scene::SceneState;

/// Fills the row of environment number `i`. After a step, values of what was solved are still those of the step (see
/// [`crate::capture`]).
pub(super) fn fill(_simulation: &Simulation, env: &Env, i: usize, state: &mut SceneState) {
    if let Some(mut row) = state.sensordata.as_mut().map(|values| values.row_mut(i)) {
        row.iter_mut().zip(env.data().sensordata()).for_each(|(to, from)| *to = *from);
    }
}

//! Forces and torques in joints.

use super::rows::captured;
use crate::env::Env;
use crate::simulation::Simulation;
use kinetoscope_scene::SceneState;

/// Fills the rows of environment `i`.
pub(super) fn fill(_simulation: &Simulation, env: &Env, i: usize, state: &mut SceneState) {
    captured(&env.solved().wrenches, i, &mut state.joint_wrenches);
}

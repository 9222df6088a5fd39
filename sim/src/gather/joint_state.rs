//! Positions and velocities of joints.

use super::rows::joints;
use crate::env::Env;
use crate::simulation::Simulation;
use kinetoscope_scene::SceneState;

/// Fills the rows of environment `i`.
pub(super) fn fill(simulation: &Simulation, env: &Env, i: usize, state: &mut SceneState) {
    let data = env.data();
    joints(&mut state.joint_positions, i, simulation, |joint| data.qpos()[joint.qpos]);
    joints(&mut state.joint_velocities, i, simulation, |joint| data.qvel()[joint.dof]);
}

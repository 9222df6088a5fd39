//! Positions and velocities of joints.

use super::rows::{ChunkRows, fill_joints};
use crate::env::SimEnv;
use crate::simulation::Simulation;

/// Fills the rows of environment `i` of the chunk.
pub(super) fn fill(simulation: &Simulation, env: &SimEnv, i: usize, state: &mut ChunkRows<'_>) {
    let data = env.data();
    fill_joints(&mut state.joint_positions, i, simulation, |joint| data.qpos()[joint.qpos]);
    fill_joints(&mut state.joint_velocities, i, simulation, |joint| data.qvel()[joint.dof]);
}

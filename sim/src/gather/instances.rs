//! Poses of the instances of the render scene, in double precision.

use super::rows::ChunkRows;
use crate::env::SimEnv;
use crate::simulation::Simulation;

/// Fills the row of environment `i` of the chunk.
pub(super) fn fill(simulation: &Simulation, env: &SimEnv, i: usize, state: &mut ChunkRows<'_>) {
    if let (Some(visible), Some(poses)) = (&simulation.visual_scene, &mut state.instance_poses)
        && let Some(poses) = poses.row_mut(i).into_slice()
    {
        visible.read_poses_f64(env.data(), poses);
    }
}

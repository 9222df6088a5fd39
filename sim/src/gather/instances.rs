//! Poses of the instances of the render scene, in double precision.

use crate::env::Env;
use crate::simulation::Simulation;
use kinetoscope_scene::SceneState;

/// Fills the row of environment `i`.
pub(super) fn fill(simulation: &Simulation, env: &Env, i: usize, state: &mut SceneState) {
    if let (Some(visible), Some(poses)) = (&simulation.visible, &mut state.instance_poses)
        && let Some(poses) = poses.row_mut(i).as_slice_mut()
    {
        visible.read_exact(env.data(), poses);
    }
}

//! Poses, lights and deforming shapes for cameras.

use super::rows::ChunkRows;
use crate::env::SimEnv;
use crate::simulation::Simulation;
use crate::visible::VisualScene;
use kinetoscope_scene::{EnvScene, Light, PoseF32, VisibleState};
use ndarray::Array2;

/// Allocates the state that cameras read for a scene in `num_envs` environments.
pub(super) fn allocate(visible: &VisualScene, num_envs: usize) -> VisibleState {
    VisibleState {
        instance_poses: Array2::from_elem((num_envs, visible.scene().instances().len()), PoseF32::IDENTITY),
        lights: Array2::from_elem((num_envs, visible.scene().lights.len()), Light::default()),
        scenes: if visible.deforms() { vec![EnvScene::default(); num_envs] } else { Vec::new() },
    }
}

/// Fills the rows of environment `i` of the chunk.
pub(super) fn fill(simulation: &Simulation, env: &SimEnv, i: usize, state: &mut ChunkRows<'_>) {
    static SHARED_SCENE: EnvScene = EnvScene(None);
    let index = state.first + i;
    if let (Some(visible), Some(poses), Some(lights)) =
        (&simulation.visual_scene, &mut state.visible_poses, &mut state.visible_lights)
        && let (Some(poses), Some(lights)) = (poses.row_mut(i).into_slice(), lights.row_mut(i).into_slice())
    {
        visible.read_poses(env.data(), poses, lights);
        if let Some(scene) = state.visible_scenes.get_mut(i) {
            visible.update_shapes(env.data(), index, simulation.env_scenes.get(index).unwrap_or(&SHARED_SCENE), scene);
        }
    }
}

//! Poses, lights and deforming shapes for cameras.

use crate::env::SimEnv;
use crate::simulation::Simulation;
use crate::visible::VisualScene;
use kinetoscope_scene::{EnvScene, Light, PoseF32, SceneState, VisibleState};
use ndarray::Array2;

/// Allocates the state that cameras read for a scene in `num_envs` environments.
pub(super) fn allocate(visible: &VisualScene, num_envs: usize) -> VisibleState {
    VisibleState {
        instance_poses: Array2::from_elem((num_envs, visible.scene().instances().len()), PoseF32::IDENTITY),
        lights: Array2::from_elem((num_envs, visible.scene().lights.len()), Light::default()),
        scenes: if visible.deforms() { vec![EnvScene::default(); num_envs] } else { Vec::new() },
    }
}

/// Fills the rows of environment `i`.
pub(super) fn fill(simulation: &Simulation, env: &SimEnv, i: usize, state: &mut SceneState) {
    static SHARED_SCENE: EnvScene = EnvScene(None);
    if let (Some(visible), Some(seen)) = (&simulation.visual_scene, &mut state.visible)
        && let (Some(poses), Some(lights)) =
            (seen.instance_poses.row_mut(i).as_slice_mut(), seen.lights.row_mut(i).as_slice_mut())
    {
        visible.read_poses(env.data(), poses, lights);
        if let Some(scene) = seen.scenes.get_mut(i) {
            visible.update_shapes(env.data(), i, simulation.env_scenes.get(i).unwrap_or(&SHARED_SCENE), scene);
        }
    }
}

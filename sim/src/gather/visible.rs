//! Poses, lights and deforming shapes for cameras.

use crate::env::Env;
use crate::simulation::Simulation;
use crate::visible::Visible;
use kinetoscope_scene::{Light, OwnScene, PoseF32, SceneState, VisibleState};
use ndarray::Array2;

/// Allocates the state that cameras read for a scene in `num_envs` environments.
pub(super) fn room(visible: &Visible, num_envs: usize) -> VisibleState {
    VisibleState {
        instance_poses: Array2::from_elem((num_envs, visible.scene().instances().len()), PoseF32::IDENTITY),
        lights: Array2::from_elem((num_envs, visible.scene().lights.len()), Light::default()),
        scenes: if visible.deforms() { vec![OwnScene::default(); num_envs] } else { Vec::new() },
    }
}

/// Fills the rows of environment `i`.
pub(super) fn fill(simulation: &Simulation, env: &Env, i: usize, state: &mut SceneState) {
    static AS_ALL: OwnScene = OwnScene(None);
    if let (Some(visible), Some(seen)) = (&simulation.visible, &mut state.visible)
        && let (Some(poses), Some(lights)) =
            (seen.instance_poses.row_mut(i).as_slice_mut(), seen.lights.row_mut(i).as_slice_mut())
    {
        visible.read(env.data(), poses, lights);
        if let Some(scene) = seen.scenes.get_mut(i) {
            visible.shape(env.data(), i, simulation.own_scenes.get(i).unwrap_or(&AS_ALL), scene);
        }
    }
}

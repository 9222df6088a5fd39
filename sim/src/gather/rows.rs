//! Rows of one environment: one number per joint, or quantities captured inside the step.

use crate::indexing::JointIndexing;
use crate::simulation::Simulation;
use kinetoscope_scene::{EnvScene, Light, PoseF32, PoseF64, SceneState};
use ndarray::{Array, ArrayViewMut, ArrayViewMut2, ArrayViewMut3, Axis, RemoveAxis};
use std::sync::{Mutex, PoisonError};

/// Rows of consecutive environments in the arrays of a [`SceneState`]. Threads fill the rows of different chunks at the
/// same time.
#[derive(Default)]
pub(super) struct ChunkRows<'a> {
    /// Index of the first environment. All other indices count from it.
    pub(super) first: usize,
    pub(super) body_poses: Option<ArrayViewMut3<'a, f64>>,
    pub(super) body_velocities: Option<ArrayViewMut3<'a, f64>>,
    pub(super) body_accelerations: Option<ArrayViewMut3<'a, f64>>,
    pub(super) force_poses: Option<ArrayViewMut3<'a, f64>>,
    pub(super) force_velocities: Option<ArrayViewMut3<'a, f64>>,
    pub(super) joint_wrenches: Option<ArrayViewMut3<'a, f64>>,
    pub(super) joint_efforts: Option<ArrayViewMut2<'a, f64>>,
    pub(super) joint_positions: Option<ArrayViewMut2<'a, f64>>,
    pub(super) joint_velocities: Option<ArrayViewMut2<'a, f64>>,
    pub(super) sensordata: Option<ArrayViewMut2<'a, f64>>,
    pub(super) actuator_controls: Option<ArrayViewMut2<'a, f64>>,
    pub(super) actuator_forces: Option<ArrayViewMut2<'a, f64>>,
    pub(super) actuator_activations: Option<ArrayViewMut2<'a, f64>>,
    pub(super) instance_poses: Option<ArrayViewMut2<'a, PoseF64>>,
    pub(super) visible_poses: Option<ArrayViewMut2<'a, PoseF32>>,
    pub(super) visible_lights: Option<ArrayViewMut2<'a, Light>>,
    /// Empty if no instance is deformable.
    pub(super) visible_scenes: &'a mut [EnvScene],
}

impl<'a> ChunkRows<'a> {
    /// Splits the arrays of `state` into chunks of `chunk_size` environments, and fills the empty list `chunks`.
    pub(super) fn split(state: &'a mut SceneState, chunk_size: usize, chunks: &mut Vec<Mutex<Self>>) {
        let first = (0..state.num_envs()).step_by(chunk_size);
        chunks.extend(first.map(|first| Mutex::new(Self { first, ..Self::default() })));
        macro_rules! assign {
            ($($name:ident),*) => {
                $(split_array(&mut state.$name, chunk_size, chunks, |rows| &mut rows.$name);)*
            };
        }
        assign!(body_poses, body_velocities, body_accelerations, force_poses, force_velocities, joint_wrenches);
        assign!(joint_efforts, joint_positions, joint_velocities, sensordata);
        assign!(actuator_controls, actuator_forces, actuator_activations, instance_poses);
        if let Some(visible) = &mut state.visible {
            let poses = visible.instance_poses.axis_chunks_iter_mut(Axis(0), chunk_size);
            let lights = visible.lights.axis_chunks_iter_mut(Axis(0), chunk_size);
            for (rows, (poses, lights)) in unlocked(chunks).zip(poses.zip(lights)) {
                (rows.visible_poses, rows.visible_lights) = (Some(poses), Some(lights));
            }
            for (rows, scenes) in unlocked(chunks).zip(visible.scenes.chunks_mut(chunk_size)) {
                rows.visible_scenes = scenes;
            }
        }
    }
}

/// The chunks of a list that is borrowed mutably, so that no lock is needed.
fn unlocked<'c, 'a>(chunks: &'c mut [Mutex<ChunkRows<'a>>]) -> impl Iterator<Item = &'c mut ChunkRows<'a>> {
    chunks.iter_mut().map(|chunk| chunk.get_mut().unwrap_or_else(PoisonError::into_inner))
}

/// Gives each chunk its rows of an array.
fn split_array<'a, T, D: RemoveAxis>(
    array: &'a mut Option<Array<T, D>>,
    chunk_size: usize,
    chunks: &mut [Mutex<ChunkRows<'a>>],
    field: impl for<'c> Fn(&'c mut ChunkRows<'a>) -> &'c mut Option<ArrayViewMut<'a, T, D>>,
) {
    if let Some(array) = array {
        for (chunk, rows) in unlocked(chunks).zip(array.axis_chunks_iter_mut(Axis(0), chunk_size)) {
            *field(chunk) = Some(rows);
        }
    }
}

/// Joints with one degree of freedom of all robots and articulations, then the hinge and slide joints of attached MJCF
/// files.
pub(super) fn all_joints(simulation: &Simulation) -> impl Iterator<Item = &JointIndexing> {
    let of_robots = simulation.robots.iter().flat_map(|robot| &robot.joints);
    of_robots.chain(simulation.mjcf_models.iter().flat_map(|part| &part.joints))
}

/// Fills row `env` with one number for each joint of [`all_joints`], if the array exists.
pub(super) fn fill_joints(
    array: &mut Option<ArrayViewMut2<'_, f64>>,
    env: usize,
    simulation: &Simulation,
    value: impl Fn(&JointIndexing) -> f64,
) {
    if let Some(array) = array {
        for (j, joint) in all_joints(simulation).enumerate() {
            array[(env, j)] = value(joint);
        }
    }
}

/// Copies captured quantities to row `env`; zeros if nothing was captured, for example after a failed step.
pub(super) fn fill_captured(values: &[f64], env: usize, array: &mut Option<ArrayViewMut3<'_, f64>>) {
    if let Some(array) = array
        && let Some(row) = array.index_axis_mut(Axis(0), env).into_slice()
    {
        if row.len() == values.len() { row.copy_from_slice(values) } else { row.fill(0.0) }
    }
}

//! From a batch of environments to the arrays that sensors read: only what somebody asked for.

use crate::batch::Batch;
use crate::compile::Simulation;
use crate::env::Env;
use crate::objects::free_body::body_pose;
use ndarray::{Array2, Array3};
use scene::{Light, PoseF32, SceneState, VisibleState};
use sensors::Requires;

/// What [`gather`] can fill so far.
pub(crate) const AVAILABLE: Requires =
    Requires::POSES.union(Requires::JOINT_STATE).union(Requires::JOINT_EFFORTS).union(Requires::VISIBLE);

/// Number of links of all robots and of objects: the body axis of a [`SceneState`].
fn body_count(simulation: &Simulation) -> usize {
    simulation.robots.iter().map(|r| r.links.len()).sum::<usize>() + simulation.objects.len()
}

/// Number of movable joints of all robots: the joint axis of a [`SceneState`].
fn joint_count(simulation: &Simulation) -> usize {
    simulation.robots.iter().map(|r| r.joints.len()).sum()
}

/// A state with room for what `requires` names.
pub(crate) fn allocate(simulation: &Simulation, requires: Requires) -> SceneState {
    let n = simulation.batch.num_envs();
    let (bodies, joints) = (body_count(simulation), joint_count(simulation));
    let wants = |field| requires.contains(field);
    let per_joint = |wanted: bool| wanted.then(|| Array2::zeros((n, joints)));
    SceneState {
        body_poses: wants(Requires::POSES).then(|| Array3::zeros((n, bodies, 7))),
        joint_positions: per_joint(wants(Requires::JOINT_STATE)),
        joint_velocities: per_joint(wants(Requires::JOINT_STATE)),
        joint_efforts: per_joint(wants(Requires::JOINT_EFFORTS)),
        visible: simulation.visible.as_ref().filter(|_| wants(Requires::VISIBLE)).map(|visible| VisibleState {
            instance_poses: Array2::from_elem((n, visible.scene().instances().len()), PoseF32::IDENTITY),
            lights: Array2::from_elem((n, visible.scene().lights.len()), Light::default()),
        }),
        ..SceneState::new(n)
    }
}

/// Steps and times of all environments.
pub(crate) fn gather_steps(simulation: &Simulation, substeps: u32, state: &mut SceneState) {
    let dt = simulation.batch.model().timestep();
    simulation.batch.for_each(|i, env| {
        state.step[i] = env.steps() / u64::from(substeps);
        state.time[i] = env.data().time();
        // Efforts were solved for the state before the last MuJoCo step.
        state.force_time[i] = if env.steps() == 0 { env.data().time() } else { env.data().time() - dt };
    });
}

/// Fills the arrays that `requires` names, which must be there: links of all robots and their joints, in the order in
/// which they were added, then objects.
pub(crate) fn gather(simulation: &Simulation, substeps: u32, requires: Requires, state: &mut SceneState) {
    gather_steps(simulation, substeps, state);
    if requires.is_empty() {
        return;
    }
    let batch: &Batch = &simulation.batch;
    let wants = |field| requires.contains(field);
    batch.for_each(|i, env| {
        if let Some(poses) = state.body_poses.as_mut().filter(|_| wants(Requires::POSES)) {
            let links = simulation.robots.iter().flat_map(|r| &r.links).copied();
            let objects = simulation.objects.iter().map(|o| (o.body, scene::Pose::identity()));
            for (b, (body, body_from_link)) in links.chain(objects).enumerate() {
                let row = scene::pose::to_row(&(body_pose(env.data(), body) * body_from_link));
                for (k, value) in row.into_iter().enumerate() {
                    poses[(i, b, k)] = value;
                }
            }
        }
        if wants(Requires::JOINT_STATE) {
            fill(&mut state.joint_positions, i, simulation, |joint| env.data().qpos()[joint.qpos]);
            fill(&mut state.joint_velocities, i, simulation, |joint| env.data().qvel()[joint.dof]);
        }
        if wants(Requires::JOINT_EFFORTS) {
            fill(&mut state.joint_efforts, i, simulation, |joint| effort(env, joint.drive));
        }
        if wants(Requires::VISIBLE)
            && let (Some(visible), Some(seen)) = (&simulation.visible, &mut state.visible)
            && let (Some(poses), Some(lights)) =
                (seen.instance_poses.row_mut(i).as_slice_mut(), seen.lights.row_mut(i).as_slice_mut())
        {
            visible.read(env.data(), poses, lights);
        }
    });
}

fn fill(
    array: &mut Option<Array2<f64>>,
    env: usize,
    simulation: &Simulation,
    value: impl Fn(&crate::compile::JointIndexing) -> f64,
) {
    if let Some(array) = array {
        for (j, joint) in simulation.robots.iter().flat_map(|r| &r.joints).enumerate() {
            array[(env, j)] = value(joint);
        }
    }
}

fn effort(env: &Env, drive: Option<usize>) -> f64 {
    drive.map_or(0.0, |d| env.drives.effort[d])
}

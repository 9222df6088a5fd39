//! From a batch of environments to the arrays that sensors read: only what somebody asked for.

mod actuators;
mod joints;
mod motion;
mod solved;

use crate::env::EnvStatus;
use crate::index::JointIndexing;
use crate::simulation::Simulation;
use kinetoscope_scene::state::Contacts;
use kinetoscope_scene::{Light, OwnScene, PoseF32, PoseF64, SceneState, VisibleState};
use kinetoscope_sensors::{Phases, Requires};
use ndarray::{Array2, Array3};

/// What [`gather`] can fill so far.
pub(crate) const AVAILABLE: Requires = Requires::POSES
    .union(Requires::VELOCITIES)
    .union(Requires::JOINT_STATE)
    .union(Requires::JOINT_EFFORTS)
    .union(Requires::ACTUATORS)
    .union(Requires::SENSORDATA)
    .union(Requires::VISIBLE)
    .union(Requires::INSTANCES)
    .union(Requires::MARKERS)
    .union(Requires::SOLVED);

/// A state with room for what `requires` names. The body axis has the links of all robots, then objects, then frames of
/// parts; the joint axis the movable joints of all robots, then those of parts with one degree of freedom; the actuator axis
/// the drives of all robots, then the actuators of parts.
pub(crate) fn allocate(simulation: &Simulation, requires: Requires) -> SceneState {
    let n = simulation.batch.num_envs();
    let bodies = simulation.plan.bodies().len();
    let joints = joints::all(simulation).count();
    let actuators = actuators::count(simulation);
    let per_body = |field, width| requires.contains(field).then(|| Array3::zeros((n, bodies, width)));
    let per_joint = |field| requires.contains(field).then(|| Array2::zeros((n, joints)));
    let per_actuator = || requires.contains(Requires::ACTUATORS).then(|| Array2::zeros((n, actuators)));
    let visible = simulation.visible.as_ref().filter(|_| requires.contains(Requires::VISIBLE));
    let exact = simulation.visible.as_ref().filter(|_| requires.contains(Requires::INSTANCES));
    SceneState {
        body_poses: per_body(Requires::POSES, 7),
        body_velocities: per_body(Requires::VELOCITIES, 6),
        body_accelerations: per_body(Requires::ACCELERATIONS, 6),
        force_poses: per_body(Requires::ACCELERATIONS, 7),
        force_velocities: per_body(Requires::ACCELERATIONS, 6),
        joint_wrenches: per_body(Requires::JOINT_WRENCHES, 6),
        joint_positions: per_joint(Requires::JOINT_STATE),
        joint_velocities: per_joint(Requires::JOINT_STATE),
        joint_efforts: per_joint(Requires::JOINT_EFFORTS),
        actuator_controls: per_actuator(),
        actuator_forces: per_actuator(),
        actuator_activations: per_actuator(),
        sensordata: requires
            .contains(Requires::SENSORDATA)
            .then(|| Array2::zeros((n, simulation.batch.model().nsensordata()))),
        contacts: requires.contains(Requires::CONTACTS).then(|| Contacts { first: vec![0; n + 1], list: Vec::new() }),
        visible: visible.map(|visible| VisibleState {
            instance_poses: Array2::from_elem((n, visible.scene().instances().len()), PoseF32::IDENTITY),
            lights: Array2::from_elem((n, visible.scene().lights.len()), Light::default()),
            scenes: if visible.deforms() { vec![OwnScene::default(); n] } else { Vec::new() },
        }),
        instance_poses: exact
            .map(|visible| Array2::from_elem((n, visible.scene().instances().len()), PoseF64::IDENTITY)),
        ..SceneState::new(n)
    }
}

/// Steps and times of all environments.
pub(crate) fn gather_steps(simulation: &Simulation, substeps: u32, state: &mut SceneState) {
    simulation.batch.for_each(|i, env| {
        state.step[i] = env.steps() / u64::from(substeps);
        state.time[i] = env.data().time();
        state.force_time[i] = env.solved_time();
    });
}

/// The step of every environment, for sensors that say when they are due.
pub(crate) fn gather_clocks(simulation: &Simulation, substeps: u32, clocks: &mut Vec<u64>) {
    clocks.resize(simulation.batch.num_envs(), 0);
    simulation.batch.for_each(|i, env| {
        let runs = *env.status() == EnvStatus::Running;
        clocks[i] = if runs { env.steps() / u64::from(substeps) } else { Phases::STANDS };
    });
}

/// Fills the arrays that `requires` names, which must be there.
pub(crate) fn gather(simulation: &Simulation, substeps: u32, requires: Requires, state: &mut SceneState) {
    static AS_ALL: OwnScene = OwnScene(None);
    gather_steps(simulation, substeps, state);
    if requires.is_empty() {
        return;
    }
    let wants = |field| requires.contains(field);
    if (wants(Requires::VISIBLE) || wants(Requires::INSTANCES)) && state.own_scenes != simulation.own_scenes {
        state.own_scenes.clone_from(&simulation.own_scenes);
    }
    let bodies = simulation.plan.bodies();
    if let Some(contacts) = state.contacts.as_mut().filter(|_| wants(Requires::CONTACTS)) {
        contacts.list.clear();
    }
    simulation.batch.for_each(|i, env| {
        if wants(Requires::POSES) {
            motion::poses(bodies, env.data(), i, &mut state.body_poses);
        }
        if wants(Requires::VELOCITIES) {
            motion::velocities(bodies, env.data(), i, &mut state.body_velocities);
        }
        if wants(Requires::JOINT_STATE) {
            joints::fill(&mut state.joint_positions, i, simulation, |joint| env.data().qpos()[joint.qpos]);
            joints::fill(&mut state.joint_velocities, i, simulation, |joint| env.data().qvel()[joint.dof]);
        }
        if wants(Requires::JOINT_EFFORTS) {
            // A joint without a drive of ours may have actuators of an MJCF file.
            let effort = |joint: &JointIndexing| match joint.drive {
                Some(drive) => env.drives.effort[drive],
                None => env.data().qfrc_actuator()[joint.dof],
            };
            joints::fill(&mut state.joint_efforts, i, simulation, effort);
        }
        if wants(Requires::ACTUATORS) {
            actuators::fill(simulation, env, i, state);
        }
        if wants(Requires::SENSORDATA)
            && let Some(mut row) = state.sensordata.as_mut().map(|values| values.row_mut(i))
        {
            // After a step, values of what was solved are still those of the step (see `capture`).
            row.iter_mut().zip(env.data().sensordata()).for_each(|(to, from)| *to = *from);
        }
        if wants(Requires::CONTACTS) {
            solved::contacts(env.solved(), i, &mut state.contacts);
        }
        if wants(Requires::ACCELERATIONS) {
            if env.solved().poses.is_empty() {
                // Nothing can be solved for the state as it is, but it is somewhere.
                motion::poses(bodies, env.data(), i, &mut state.force_poses);
                motion::velocities(bodies, env.data(), i, &mut state.force_velocities);
            } else {
                solved::rows(&env.solved().poses, i, &mut state.force_poses);
                solved::rows(&env.solved().velocities, i, &mut state.force_velocities);
            }
            solved::rows(&env.solved().accelerations, i, &mut state.body_accelerations);
        }
        if wants(Requires::JOINT_WRENCHES) {
            solved::rows(&env.solved().wrenches, i, &mut state.joint_wrenches);
        }
        if wants(Requires::VISIBLE)
            && let (Some(visible), Some(seen)) = (&simulation.visible, &mut state.visible)
            && let (Some(poses), Some(lights)) =
                (seen.instance_poses.row_mut(i).as_slice_mut(), seen.lights.row_mut(i).as_slice_mut())
        {
            visible.read(env.data(), poses, lights);
            if let Some(scene) = seen.scenes.get_mut(i) {
                visible.shape(env.data(), i, simulation.own_scenes.get(i).unwrap_or(&AS_ALL), scene);
            }
        }
        if wants(Requires::INSTANCES)
            && let (Some(visible), Some(poses)) = (&simulation.visible, &mut state.instance_poses)
            && let Some(poses) = poses.row_mut(i).as_slice_mut()
        {
            visible.read_exact(env.data(), poses);
        }
    });
}

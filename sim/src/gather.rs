//! From a batch of environments to the arrays that sensors read: only what somebody asked for.

use crate::batch::Batch;
use crate::compile::Simulation;
use crate::env::Env;
use crate::objects::robot::{RobotData, body_pose};
use ndarray::{Array2, Array3};
use scene::SceneState;
use sensors::Requires;
use std::sync::Arc;

/// What [`gather`] can fill so far.
pub(crate) const AVAILABLE: Requires = Requires::POSES.union(Requires::JOINT_STATE).union(Requires::JOINT_EFFORTS);

/// Number of links of all robots: the body axis of a [`SceneState`].
pub(crate) fn body_count(simulation: &Simulation) -> usize {
    simulation.robots.iter().map(|r| r.links.len()).sum()
}

/// Number of movable joints of all robots: the joint axis of a [`SceneState`].
pub(crate) fn joint_count(simulation: &Simulation) -> usize {
    simulation.robots.iter().map(|r| r.joints.len()).sum()
}

/// Names of the bodies: `uid/link`.
pub(crate) fn body_names(robots: &[Arc<RobotData>]) -> Arc<[String]> {
    let links = robots.iter().flat_map(|r| r.description().links.iter().map(|l| format!("{}/{}", r.uid(), l.name)));
    links.collect()
}

/// Names of the joints: `uid/joint`.
pub(crate) fn joint_names(robots: &[Arc<RobotData>]) -> Arc<[String]> {
    robots.iter().flat_map(|r| r.joint_names().iter().map(|j| format!("{}/{j}", r.uid()))).collect()
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
        ..SceneState::new(n)
    }
}

/// Fills every array of `state` that is there; links and joints of all robots, in the order in which they were added.
pub(crate) fn gather(simulation: &Simulation, substeps: u32, state: &mut SceneState) {
    let batch: &Batch = &simulation.batch;
    let dt = batch.model().timestep();
    batch.for_each(|i, env| {
        state.step[i] = env.steps() / u64::from(substeps);
        state.time[i] = env.data().time();
        // Efforts were solved for the state before the last MuJoCo step.
        state.force_time[i] = if env.steps() == 0 { env.data().time() } else { env.data().time() - dt };
        if let Some(poses) = &mut state.body_poses {
            let links = simulation.robots.iter().flat_map(|r| &r.links);
            for (b, (body, body_from_link)) in links.enumerate() {
                let row = scene::pose::to_row(&(body_pose(env.data(), *body) * body_from_link));
                for (k, value) in row.into_iter().enumerate() {
                    poses[(i, b, k)] = value;
                }
            }
        }
        fill(&mut state.joint_positions, i, simulation, |joint| env.data().qpos()[joint.qpos]);
        fill(&mut state.joint_velocities, i, simulation, |joint| env.data().qvel()[joint.dof]);
        fill(&mut state.joint_efforts, i, simulation, |joint| effort(env, joint.drive));
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

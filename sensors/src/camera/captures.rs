//! What there was to see when pictures were due.

use super::ticket::Ticket;
use ndarray::{Array1, Array2, Axis};
use scene::pose::from_row;
use scene::{Light, OwnScene, Pose, PoseF32, RenderScene, SceneState};

/// What there was to see.
#[derive(Clone, Debug)]
pub(super) struct Captures {
    /// World from instance, shape \[rows, instances\].
    pub(super) poses: Array2<PoseF32>,
    /// Shape \[rows, lamps\].
    pub(super) lights: Array2<Light>,
    /// What there is instead of the scene of all, row by row.
    pub(super) scenes: Vec<OwnScene>,
    /// Where the parent was; the identity for a free camera, `None` before the first capture.
    pub(super) world_from_parent: Vec<Option<Pose>>,
    pub(super) stamps: Array1<f64>,
    pub(super) tickets: Vec<Ticket>,
}

impl Captures {
    /// Room for `rows` captures of a scene.
    pub(super) fn new(rows: usize, scene: &RenderScene, ticket: Ticket) -> Self {
        Self {
            poses: Array2::from_elem((rows, scene.instances().len()), PoseF32::IDENTITY),
            lights: Array2::from_elem((rows, scene.lights.len()), Light::default()),
            scenes: vec![OwnScene::default(); rows],
            world_from_parent: vec![None; rows],
            stamps: Array1::zeros(rows),
            tickets: vec![ticket; rows],
        }
    }

    /// Keeps what there is to see in an environment, and where the body `parent` is; the state was checked.
    pub(super) fn keep(
        &mut self,
        row: usize,
        (state, env): (&SceneState, usize),
        parent: Option<usize>,
        ticket: Ticket,
    ) {
        let Some(visible) = &state.visible else { return };
        self.poses.index_axis_mut(Axis(0), row).assign(&visible.instance_poses.index_axis(Axis(0), env));
        self.lights.index_axis_mut(Axis(0), row).assign(&visible.lights.index_axis(Axis(0), env));
        self.scenes[row].clone_from(state.own_scene(env));
        let parent = parent.zip(state.body_poses.as_ref());
        let world_from_parent = parent.map(|(body, poses)| from_row(&std::array::from_fn(|k| poses[(env, body, k)])));
        self.world_from_parent[row] = Some(world_from_parent.unwrap_or_else(Pose::identity));
        self.stamps[row] = state.time[env];
        self.tickets[row] = ticket;
    }

    /// Keeps what another one of the same scene has kept in a row.
    pub(super) fn copy(&mut self, row: usize, other: &Self, from: usize) {
        self.poses.index_axis_mut(Axis(0), row).assign(&other.poses.index_axis(Axis(0), from));
        self.lights.index_axis_mut(Axis(0), row).assign(&other.lights.index_axis(Axis(0), from));
        self.scenes[row].clone_from(&other.scenes[from]);
        self.world_from_parent[row] = other.world_from_parent[from];
        self.stamps[row] = other.stamps[from];
        self.tickets[row] = other.tickets[from];
    }
}

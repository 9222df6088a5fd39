//! What there was to see when pictures were due.

use super::opening::{Opening, parent_pose};
use kinetoscope_render::ticket::Ticket;
use kinetoscope_scene::{Light, Marker, OwnScene, Pose, PoseF32, RenderScene, SceneState};
use ndarray::{Array1, Array2, Axis};

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
    /// What other sensors showed, row by row; nothing for cameras that do not draw it.
    pub(super) markers: Vec<Vec<Marker>>,
    /// Of cameras with a shutter that takes time.
    opened: Option<Opened>,
}

/// Where things were when the shutter opened.
#[derive(Clone, Debug)]
struct Opened {
    /// World from instance, shape \[rows, instances\].
    poses: Array2<PoseF32>,
    /// Where the parent was; `None` of pictures of one instant.
    parents: Vec<Option<Pose>>,
}

impl Captures {
    /// Room for `rows` captures of a scene, by a shutter that takes time or not.
    pub(super) fn new(rows: usize, scene: &RenderScene, ticket: Ticket, slow: bool) -> Self {
        Self {
            opened: slow.then(|| Opened {
                poses: Array2::from_elem((rows, scene.instances().len()), PoseF32::IDENTITY),
                parents: vec![None; rows],
            }),
            poses: Array2::from_elem((rows, scene.instances().len()), PoseF32::IDENTITY),
            lights: Array2::from_elem((rows, scene.lights.len()), Light::default()),
            scenes: vec![OwnScene::default(); rows],
            world_from_parent: vec![None; rows],
            stamps: Array1::zeros(rows),
            tickets: vec![ticket; rows],
            markers: vec![Vec::new(); rows],
        }
    }

    /// Keeps what there is to see in an environment, and where the body `parent` is; the state was checked.
    pub(super) fn keep(
        &mut self,
        row: usize,
        (state, env): (&SceneState, usize),
        parent: Option<usize>,
        ticket: Ticket,
        opening: Option<(&Opening, usize)>,
    ) {
        let Some(visible) = &state.visible else { return };
        self.poses.index_axis_mut(Axis(0), row).assign(&visible.instance_poses.index_axis(Axis(0), env));
        self.lights.index_axis_mut(Axis(0), row).assign(&visible.lights.index_axis(Axis(0), env));
        self.scenes[row].clone_from(state.seen_scene(env));
        self.world_from_parent[row] = Some(parent_pose(state, env, parent));
        self.stamps[row] = state.time[env];
        self.tickets[row] = ticket;
        if let Some(markers) = &state.markers {
            self.markers[row].clone_from(&markers[env]);
        }
        if let Some(opened) = &mut self.opened {
            opened.parents[row] = None;
            if let Some((poses, parent)) = opening.and_then(|(opening, of)| opening.of(of)) {
                opened.poses.index_axis_mut(Axis(0), row).assign(&poses);
                opened.parents[row] = Some(parent);
            }
        }
    }

    /// Keeps what another one of the same scene has kept in a row.
    pub(super) fn copy(&mut self, row: usize, other: &Self, from: usize) {
        self.poses.index_axis_mut(Axis(0), row).assign(&other.poses.index_axis(Axis(0), from));
        self.lights.index_axis_mut(Axis(0), row).assign(&other.lights.index_axis(Axis(0), from));
        self.scenes[row].clone_from(&other.scenes[from]);
        self.world_from_parent[row] = other.world_from_parent[from];
        self.stamps[row] = other.stamps[from];
        self.tickets[row] = other.tickets[from];
        self.markers[row].clone_from(&other.markers[from]);
        if let (Some(opened), Some(other)) = (&mut self.opened, &other.opened) {
            opened.poses.index_axis_mut(Axis(0), row).assign(&other.poses.index_axis(Axis(0), from));
            opened.parents[row] = other.parents[from];
        }
    }

    /// Where things were when the shutter of a row opened, and its parent; `None` of pictures of one instant.
    pub(super) fn opened(&self, row: usize) -> Option<(&[PoseF32], Pose)> {
        let Opened { poses, parents } = self.opened.as_ref()?;
        let width = poses.ncols();
        Some((poses.as_slice()?.get(row * width..(row + 1) * width)?, parents[row]?))
    }
}

//! Where things are when the shutter of a camera opens.

use super::cfg::CameraCfg;
use super::error::CameraError;
use crate::schedule::{Phases, Schedule};
use kinetoscope_render::shutter::Shutter;
use kinetoscope_scene::pose::from_row;
use kinetoscope_scene::{Pose, PoseF32, RenderScene, SceneState};
use ndarray::{Array2, ArrayView1, Axis};

/// Steps may be a little shorter than the shutter's span, which is a sum: this part of one.
const ROUNDING: f64 = 1e-6;

/// Where things were when the shutter of the pictures opened that are due next. There is none of it for a camera whose
/// pictures are of one instant.
#[derive(Clone, Debug)]
pub(super) struct Opening {
    /// Physics steps from the opening until the picture is due, at least 1.
    steps: u64,
    /// The same \[s\].
    seconds: f64,
    /// World from instance, shape \[rows, instances\].
    poses: Array2<PoseF32>,
    /// Where the parent was, the identity for a free camera; `None` while the shutter is closed.
    parents: Vec<Option<Pose>>,
}

impl Opening {
    /// What `cfg` asks for, in `rows` environments.
    ///
    /// # Errors
    ///
    /// [`CameraError::ShutterTooSlow`] where pictures overlap.
    pub(super) fn new(
        cfg: &CameraCfg,
        schedule: Schedule,
        dt: f64,
        rows: usize,
        scene: &RenderScene,
    ) -> Result<Option<Self>, CameraError> {
        let Some(steps) = Self::steps(cfg.shutter, cfg.height, dt) else { return Ok(None) };
        if steps > schedule.period_steps() {
            let (span, period) = (cfg.shutter.span(cfg.height), schedule.period_steps() as f64 * dt);
            return Err(CameraError::ShutterTooSlow { span, period });
        }
        Ok(Some(Self {
            steps,
            seconds: steps as f64 * dt,
            poses: Array2::from_elem((rows, scene.instances().len()), PoseF32::IDENTITY),
            parents: vec![None; rows],
        }))
    }

    /// Physics steps of a shutter's span, rounded up; `None` for an instant.
    fn steps(shutter: Shutter, height: usize, dt: f64) -> Option<u64> {
        let steps = (shutter.span(height) / dt - ROUNDING).ceil().max(1.0);
        (!shutter.is_instant() && shutter.span(height) > 0.0).then_some(steps as u64)
    }

    /// From the opening until the picture is due \[s\].
    pub(super) fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Steps until the shutter of a row opens or its picture is due, given the steps until the latter.
    pub(super) fn wait(&self, due: u64) -> u64 {
        if due > self.steps { due - self.steps } else { due }
    }

    /// Opens the shutters of those rows whose pictures are due in as many steps, and does nothing in others.
    pub(super) fn open(
        &mut self,
        rows: impl Iterator<Item = usize>,
        phases: &Phases,
        (state, env_ids): (&SceneState, &[usize]),
        parent: Option<usize>,
    ) {
        for row in rows {
            let env = env_ids[row];
            if phases.wait(row, state.step[env]) == self.steps {
                self.keep(row, (state, env), parent);
            }
        }
    }

    /// Somebody wrote to the state of a row: what is seen from now on was there since the shutter opened.
    pub(super) fn refresh(&mut self, row: usize, state: (&SceneState, usize), parent: Option<usize>) {
        if self.parents[row].is_some() {
            self.keep(row, state, parent);
        }
    }

    /// Closes the shutter of a row.
    pub(super) fn close(&mut self, row: usize) {
        self.parents[row] = None;
    }

    /// Where things were when the shutter of a row opened, and the parent; `None` if it is closed, or if that cannot be drawn.
    pub(super) fn of(&self, row: usize) -> Option<(ArrayView1<'_, PoseF32>, Pose)> {
        let (parent, poses) = (self.parents[row]?, self.poses.index_axis(Axis(0), row));
        poses.iter().all(PoseF32::is_rigid).then_some((poses, parent))
    }

    fn keep(&mut self, row: usize, (state, env): (&SceneState, usize), parent: Option<usize>) {
        let Some(visible) = &state.visible else { return };
        self.poses.index_axis_mut(Axis(0), row).assign(&visible.instance_poses.index_axis(Axis(0), env));
        self.parents[row] = Some(parent_pose(state, env, parent));
    }
}

/// Where the body that a camera hangs on is; the identity for a free camera.
pub(super) fn parent_pose(state: &SceneState, env: usize, parent: Option<usize>) -> Pose {
    let parent = parent.zip(state.body_poses.as_ref());
    let pose = parent.map(|(body, poses)| from_row(&std::array::from_fn(|k| poses[(env, body, k)])));
    pose.unwrap_or_else(Pose::identity)
}

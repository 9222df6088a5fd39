//! Poses of earlier instants: those of the previous frame, for optical flow, and those at shutter opening, for motion
//! blur and rolling shutters.

use super::cfg::CameraCfg;
use super::error::CameraError;
use super::frame_buffer::{CapturedFrame, Observation, copy_row};
use crate::schedule::{Phases, Schedule};
use kinetoscope_render::PreviousState;
use kinetoscope_render::Shutter;
use kinetoscope_render::View;
use kinetoscope_scene::{Pose, PoseF32, RenderScene};

/// Tolerance for the rounding of the shutter span, which is a sum, as a fraction of a step.
const ROUNDING: f64 = 1e-6;

/// Poses at shutter opening.
#[derive(Clone, Debug)]
pub(super) struct ShutterOpenPoses {
    /// World from instance.
    poses: Vec<PoseF32>,
    /// Pose of the parent in the environment, the identity for a free camera; `None` while there are no poses.
    parent: Option<Pose>,
}

impl ShutterOpenPoses {
    pub(super) fn new(instances: usize) -> Self {
        Self { poses: vec![PoseF32::IDENTITY; instances], parent: None }
    }

    /// Returns the poses of instances and parent in the environment; `None` while there are no poses.
    pub(super) fn get(&self) -> Option<(&[PoseF32], Pose)> {
        Some((&self.poses, self.parent?))
    }

    /// Copies `other`. Clears the poses if `other` is `None` or has a pose that is not rigid.
    pub(super) fn assign_valid(&mut self, other: Option<&Self>) {
        self.parent = None;
        if let Some(other) = other.filter(|other| other.poses.iter().all(PoseF32::is_rigid)) {
            self.assign(other);
        }
    }

    pub(super) fn assign(&mut self, other: &Self) {
        self.poses.copy_from_slice(&other.poses);
        self.parent = other.parent;
    }

    fn capture(&mut self, seen: &Observation<'_>) {
        let Some(visible) = &seen.state.visible else { return };
        copy_row(&mut self.poses, &visible.instance_poses, seen.env);
        self.parent = Some(seen.parent_pose());
    }
}

/// Earlier instants of all rows, for flow and for a shutter of nonzero span.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    /// Previous frames, row by row; empty for a camera without flow.
    previous: Vec<PreviousFrame>,
    shutter: Option<TimedShutter>,
}

/// The frame before the shown one.
#[derive(Clone, Debug)]
struct PreviousFrame {
    /// World from instance.
    poses: Vec<PoseF32>,
    /// View of the previous frame; `None` if the shown frame is the first.
    view: Option<View>,
    /// View at the capture of the shown frame; `None` before the first one. Later setters move the shown frame, but not
    /// the start of the next flow.
    shown_view: Option<View>,
}

/// A shutter that opens one or more steps before its frame is due.
#[derive(Clone, Debug)]
struct TimedShutter {
    /// Physics steps from the opening until the frame is due, at least 1.
    steps: u64,
    /// The same \[s\].
    seconds: f64,
    /// Poses at the opening, row by row; empty while the shutter is closed.
    open_poses: Vec<ShutterOpenPoses>,
}

impl Motion {
    /// Allocates the poses that `cfg` needs, in `rows` environments.
    ///
    /// # Errors
    ///
    /// [`CameraError::ShutterTooSlow`] if consecutive frames would overlap.
    pub(super) fn new(
        cfg: &CameraCfg,
        schedule: Schedule,
        dt: f64,
        rows: usize,
        scene: &RenderScene,
    ) -> Result<Self, CameraError> {
        let instances = scene.instances().len();
        let shutter = match shutter_steps(cfg.shutter, cfg.height, dt) {
            Some(steps) if steps > schedule.period_steps() => {
                let (span, period) = (cfg.shutter.span(cfg.height), schedule.period_steps() as f64 * dt);
                return Err(CameraError::ShutterTooSlow { span, period });
            }
            steps => steps.map(|steps| TimedShutter {
                steps,
                seconds: steps as f64 * dt,
                open_poses: vec![ShutterOpenPoses::new(instances); rows],
            }),
        };
        let previous = PreviousFrame { poses: vec![PoseF32::IDENTITY; instances], view: None, shown_view: None };
        Ok(Self { previous: vec![previous; if cfg.channels.flow { rows } else { 0 }], shutter })
    }

    /// Returns the time from shutter opening until a frame is due \[s\]; `None` for frames of one instant.
    pub(super) fn shutter_seconds(&self) -> Option<f64> {
        self.shutter.as_ref().map(|shutter| shutter.seconds)
    }

    /// Returns the steps until the shutter opens or a frame is due, given the steps until the frame is due.
    pub(super) fn steps_until_event(&self, due: u64) -> u64 {
        self.shutter.as_ref().filter(|shutter| due > shutter.steps).map_or(due, |shutter| due - shutter.steps)
    }

    /// Returns the poses at the opening of the shutter of a row; `None` for a camera whose frames show one instant.
    pub(super) fn shutter_open_poses(&self, row: usize) -> Option<&ShutterOpenPoses> {
        self.shutter.as_ref().map(|shutter| &shutter.open_poses[row])
    }

    /// Opens the shutter of a row if its next frame is due in exactly the steps of the shutter span.
    pub(super) fn open_shutter_if_due(&mut self, row: usize, phases: &Phases, seen: &Observation<'_>) {
        if let Some(shutter) = &mut self.shutter
            && phases.steps_until_due(row, seen.state.step[seen.env]) == shutter.steps
        {
            shutter.open_poses[row].capture(seen);
        }
    }

    /// Replaces the poses of an open shutter after a write to the state: the written state counts since the opening.
    pub(super) fn refresh(&mut self, row: usize, seen: &Observation<'_>) {
        if let Some(shutter) = &mut self.shutter
            && shutter.open_poses[row].parent.is_some()
        {
            shutter.open_poses[row].capture(seen);
        }
    }

    /// Drops the poses at shutter opening of a row.
    pub(super) fn close_shutter(&mut self, row: usize) {
        if let Some(shutter) = &mut self.shutter {
            shutter.open_poses[row].parent = None;
        }
    }

    /// Makes the shown frame of a row the previous frame. A frame that cannot be rendered counts as missing.
    pub(super) fn advance(&mut self, row: usize, shown: &CapturedFrame) {
        if let Some(previous) = self.previous.get_mut(row) {
            previous.poses.copy_from_slice(&shown.poses);
            let can_be_drawn = |view: &View| view.validate().is_ok() && shown.poses.iter().all(PoseF32::is_rigid);
            previous.view = previous.shown_view.filter(can_be_drawn);
        }
    }

    /// Records the view of a newly shown frame.
    pub(super) fn record_shown_view(&mut self, row: usize, view: View) {
        if let Some(previous) = self.previous.get_mut(row) {
            previous.shown_view = Some(view);
        }
    }

    /// Makes the next frame of a row its first frame, and drops the poses at shutter opening.
    pub(super) fn reset(&mut self, row: usize) {
        if let Some(previous) = self.previous.get_mut(row) {
            previous.view = None;
        }
        self.close_shutter(row);
    }

    /// Returns the frame before the shown one; `None` for a camera without flow, or if the shown frame is the first.
    pub(super) fn previous_frame(&self, row: usize) -> Option<PreviousState<'_>> {
        let PreviousFrame { poses, view, .. } = self.previous.get(row)?;
        Some(PreviousState { poses, view: view.as_ref()? })
    }
}

/// Returns the physics steps of the span of a shutter, rounded up; `None` for a shutter of one instant.
fn shutter_steps(shutter: Shutter, height: usize, dt: f64) -> Option<u64> {
    let steps = (shutter.span(height) / dt - ROUNDING).ceil().max(1.0);
    (!shutter.is_instant() && shutter.span(height) > 0.0).then_some(steps as u64)
}

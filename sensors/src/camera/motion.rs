//! Poses of earlier instants that frames are drawn with: those of the frame before, for optical flow, and those of shutter
//! opening, for motion blur and rolling shutters.

use super::cfg::CameraCfg;
use super::error::CameraError;
use super::frame_buffer::{CapturedFrame, Observation, copy_row};
use crate::schedule::{Phases, Schedule};
use kinetoscope_render::Before;
use kinetoscope_render::Shutter;
use kinetoscope_render::View;
use kinetoscope_scene::{Pose, PoseF32, RenderScene};

/// Steps may be a little shorter than the shutter's span, which is a sum: this part of one.
const ROUNDING: f64 = 1e-6;

/// Poses at shutter opening.
#[derive(Clone, Debug)]
pub(super) struct OpeningPoses {
    /// World from instance.
    poses: Vec<PoseF32>,
    /// Pose of the parent, the identity for a free camera; `None` while there are no poses.
    parent: Option<Pose>,
}

impl OpeningPoses {
    pub(super) fn new(instances: usize) -> Self {
        Self { poses: vec![PoseF32::IDENTITY; instances], parent: None }
    }

    /// Poses of instances and parent.
    pub(super) fn get(&self) -> Option<(&[PoseF32], Pose)> {
        Some((&self.poses, self.parent?))
    }

    /// Copies `other`, or nothing where it cannot be drawn.
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

/// Earlier instants of all rows, as far as the camera needs them.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    /// The frame before, row by row; empty for a camera without flow.
    previous: Vec<PreviousFrame>,
    shutter: Option<SlowShutter>,
}

/// The frame before the shown one.
#[derive(Clone, Debug)]
struct PreviousFrame {
    /// World from instance.
    poses: Vec<PoseF32>,
    /// `None` where the shown frame is the first.
    view: Option<View>,
    /// View with which the shown frame was captured: setters since move the shown frame, and not the start of the next flow.
    shown_view: Option<View>,
}

/// A shutter that opens one or more steps before its frame is due.
#[derive(Clone, Debug)]
struct SlowShutter {
    /// Physics steps from the opening until the frame is due, at least 1.
    steps: u64,
    /// The same \[s\].
    seconds: f64,
    /// Poses at the opening, row by row; none while the shutter is closed.
    opened: Vec<OpeningPoses>,
}

impl Motion {
    /// The history that `cfg` asks for, in `rows` environments.
    ///
    /// # Errors
    ///
    /// [`CameraError::ShutterTooSlow`] where frames overlap.
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
            steps => steps.map(|steps| SlowShutter {
                steps,
                seconds: steps as f64 * dt,
                opened: vec![OpeningPoses::new(instances); rows],
            }),
        };
        let previous = PreviousFrame { poses: vec![PoseF32::IDENTITY; instances], view: None, shown_view: None };
        Ok(Self { previous: vec![previous; if cfg.channels.flow { rows } else { 0 }], shutter })
    }

    /// Time from the opening of the shutter until a frame is due \[s\]; `None` for frames of one instant.
    pub(super) fn shutter_seconds(&self) -> Option<f64> {
        self.shutter.as_ref().map(|shutter| shutter.seconds)
    }

    /// Steps until the shutter opens or a frame is due, given the steps until the latter.
    pub(super) fn wait(&self, due: u64) -> u64 {
        self.shutter.as_ref().filter(|shutter| due > shutter.steps).map_or(due, |shutter| due - shutter.steps)
    }

    /// Poses at the opening of the open shutter of a row.
    pub(super) fn opening(&self, row: usize) -> Option<&OpeningPoses> {
        self.shutter.as_ref().map(|shutter| &shutter.opened[row])
    }

    /// Opens the shutter of a row whose next frame is due in as many steps as that takes.
    pub(super) fn open_if_due(&mut self, row: usize, phases: &Phases, seen: &Observation<'_>) {
        if let Some(shutter) = &mut self.shutter
            && phases.wait(row, seen.state.step[seen.env]) == shutter.steps
        {
            shutter.opened[row].capture(seen);
        }
    }

    /// Takes the poses of an open shutter anew, after a write to the state: what is seen now was there since it opened.
    pub(super) fn refresh(&mut self, row: usize, seen: &Observation<'_>) {
        if let Some(shutter) = &mut self.shutter
            && shutter.opened[row].parent.is_some()
        {
            shutter.opened[row].capture(seen);
        }
    }

    /// Closes the shutter of a row.
    pub(super) fn close(&mut self, row: usize) {
        if let Some(shutter) = &mut self.shutter {
            shutter.opened[row].parent = None;
        }
    }

    /// The shown frame of a row becomes the one before; one that cannot be drawn counts as missing.
    pub(super) fn advance(&mut self, row: usize, shown: &CapturedFrame) {
        if let Some(previous) = self.previous.get_mut(row) {
            previous.poses.copy_from_slice(&shown.poses);
            let can_be_drawn = |view: &View| view.validate().is_ok() && shown.poses.iter().all(PoseF32::is_rigid);
            previous.view = previous.shown_view.filter(can_be_drawn);
        }
    }

    /// A frame of a row is shown that was captured with this view.
    pub(super) fn show(&mut self, row: usize, view: View) {
        if let Some(previous) = self.previous.get_mut(row) {
            previous.shown_view = Some(view);
        }
    }

    /// Makes the next frame of a row its first.
    pub(super) fn reset(&mut self, row: usize) {
        if let Some(previous) = self.previous.get_mut(row) {
            previous.view = None;
        }
        self.close(row);
    }

    /// The frame before the shown one of a row.
    pub(super) fn before(&self, row: usize) -> Option<Before<'_>> {
        let PreviousFrame { poses, view, .. } = self.previous.get(row)?;
        Some(Before { poses, view: view.as_ref()? })
    }
}

/// Physics steps of a shutter's span, rounded up; `None` for an instant.
fn shutter_steps(shutter: Shutter, height: usize, dt: f64) -> Option<u64> {
    let steps = (shutter.span(height) / dt - ROUNDING).ceil().max(1.0);
    (!shutter.is_instant() && shutter.span(height) > 0.0).then_some(steps as u64)
}

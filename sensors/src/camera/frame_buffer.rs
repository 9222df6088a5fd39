//! Frames of a camera: captured, in flight, shown and past.

use super::cfg::CameraCfg;
use super::motion::ShutterOpenPoses;
use super::viewpoints::{Viewpoint, Viewpoints};
use crate::delay::{self, DelayLine};
use crate::history::History;
use crate::schedule::Schedule;
use kinetoscope_render::lens::LensRays;
use kinetoscope_render::{RngKey, RngStream};
use kinetoscope_scene::pose::from_row;
use kinetoscope_scene::{EnvScene, Light, Marker, Pose, PoseF32, RenderScene, SceneState};
use ndarray::{Array1, Array2, ArrayView1, ArrayViewMut1, Axis};
use std::sync::Arc;

/// An environment at the instant of a frame.
#[derive(Clone, Copy)]
pub(super) struct Observation<'a> {
    pub(super) state: &'a SceneState,
    pub(super) env: usize,
    /// Index of the body that the camera is attached to; `None` for a free camera.
    pub(super) parent: Option<usize>,
}

impl Observation<'_> {
    /// Returns the pose, in the environment, of the body that the camera is attached to; the identity for a free
    /// camera.
    pub(super) fn parent_pose(&self) -> Pose {
        let parent = self.parent.zip(self.state.body_poses.as_ref());
        let pose = parent.map(|(body, poses)| from_row(&std::array::from_fn(|k| poses[(self.env, body, k)])));
        pose.unwrap_or_else(Pose::identity)
    }
}

/// State of one environment at the instant of a frame: everything that its image depends on, except the viewpoint.
#[derive(Clone, Debug)]
pub(super) struct CapturedFrame {
    /// World from instance.
    pub(super) poses: Vec<PoseF32>,
    pub(super) lights: Vec<Light>,
    /// The environment's own scene, if it differs from the shared scene.
    pub(super) scene: EnvScene,
    /// Pose of the parent in the environment; the identity for a free camera, `None` before the first capture.
    pub(super) world_from_parent: Option<Pose>,
    /// Time of the capture \[s\].
    pub(super) stamp: f64,
    /// Key of the random numbers of the image.
    pub(super) rng_key: RngKey,
    /// Markers of other sensors; empty for a camera that does not render markers.
    pub(super) markers: Vec<Marker>,
    /// Poses at shutter opening; `None` for a shutter that opens and closes at one instant.
    shutter_open: Option<ShutterOpenPoses>,
}

impl CapturedFrame {
    /// Allocates a frame of a scene; `slow_shutter` also allocates the poses at shutter opening.
    fn new(scene: &RenderScene, rng_key: RngKey, slow_shutter: bool) -> Self {
        let instances = scene.instances().len();
        Self {
            poses: vec![PoseF32::IDENTITY; instances],
            lights: vec![Light::default(); scene.lights.len()],
            scene: EnvScene::default(),
            world_from_parent: None,
            stamp: 0.0,
            rng_key,
            markers: Vec::new(),
            shutter_open: slow_shutter.then(|| ShutterOpenPoses::new(instances)),
        }
    }

    /// Captures an environment. The state must be checked before.
    fn capture(&mut self, seen: &Observation<'_>, key: RngKey, opening: Option<&ShutterOpenPoses>) {
        let Observation { state, env, .. } = *seen;
        let Some(visible) = &state.visible else { return };
        copy_row(&mut self.poses, &visible.instance_poses, env);
        copy_row(&mut self.lights, &visible.lights, env);
        self.scene.clone_from(state.visible_scene(env));
        self.world_from_parent = Some(seen.parent_pose());
        self.stamp = state.time[env];
        self.rng_key = key;
        if let Some(markers) = &state.markers {
            self.markers.clone_from(&markers[env]);
        }
        if let Some(own) = &mut self.shutter_open {
            own.assign_valid(opening);
        }
    }

    /// Copies another frame of the same scene, reusing memory.
    fn assign(&mut self, other: &Self) {
        self.poses.copy_from_slice(&other.poses);
        self.lights.clone_from_slice(&other.lights);
        self.scene.clone_from(&other.scene);
        self.world_from_parent = other.world_from_parent;
        self.stamp = other.stamp;
        self.rng_key = other.rng_key;
        self.markers.clone_from(&other.markers);
        if let (Some(own), Some(other)) = (&mut self.shutter_open, &other.shutter_open) {
            own.assign(other);
        }
    }

    /// Returns poses of instances and parent at shutter opening; `None` for a frame of one instant.
    pub(super) fn shutter_open_poses(&self) -> Option<(&[PoseF32], Pose)> {
        self.shutter_open.as_ref()?.get()
    }
}

/// A captured frame with its viewpoint and lens.
#[derive(Clone, Copy)]
pub(super) struct FrameSource<'a> {
    pub(super) row: usize,
    pub(super) frame: &'a CapturedFrame,
    pub(super) viewpoint: &'a Viewpoint,
    pub(super) rays: Option<&'a Arc<LensRays>>,
}

impl<'a> FrameSource<'a> {
    /// Combines a frame of a row with the current viewpoint of the row.
    pub(super) fn with_current_viewpoint(row: usize, frame: &'a CapturedFrame, viewpoints: &'a Viewpoints) -> Self {
        Self { row, frame, viewpoint: viewpoints.row(row), rays: viewpoints.rays(row) }
    }
}

/// A delivered frame, with its viewpoint and lens at that time. Later setters do not change it.
#[derive(Clone, Debug)]
struct DeliveredFrame {
    frame: CapturedFrame,
    viewpoint: Viewpoint,
    rays: Option<Arc<LensRays>>,
}

impl DeliveredFrame {
    fn assign(&mut self, source: FrameSource<'_>) {
        self.frame.assign(source.frame);
        self.viewpoint = *source.viewpoint;
        self.rays = source.rays.cloned();
    }

    fn source(&self, row: usize) -> FrameSource<'_> {
        FrameSource { row, frame: &self.frame, viewpoint: &self.viewpoint, rays: self.rays.as_ref() }
    }
}

/// Frames of a camera in all its environments, row by row. All memory is allocated at construction.
#[derive(Debug)]
pub(super) struct FrameBuffer {
    shown: Vec<CapturedFrame>,
    /// Times of the shown frames \[s\].
    stamps: Array1<f64>,
    /// Frames in flight; `None` without a latency.
    delay: Option<DelayLine<CapturedFrame>>,
    /// Probability that a frame is lost on its way.
    dropout: f64,
    delivered: DeliveredFrames,
    /// True if the latest delivered frame is shown, from the viewpoint of its delivery.
    shows_latest: Vec<bool>,
}

/// Delivered frames.
#[derive(Debug)]
struct DeliveredFrames {
    counts: Array1<u64>,
    /// The latest delivered frame, with a latency; without a latency this is the shown frame.
    latest: History<DeliveredFrame>,
    history: History<DeliveredFrame>,
    stamps: History<f64>,
}

impl DeliveredFrames {
    fn push(&mut self, source: FrameSource<'_>) {
        let row = source.row;
        self.counts[row] += 1;
        for frames in [&mut self.latest, &mut self.history] {
            if let Some([newest]) = frames.push_reused(row) {
                newest.assign(source);
            }
        }
        self.stamps.push(row, &[source.frame.stamp]);
    }
}

impl FrameBuffer {
    /// Returns an upper bound of the number of frames of an environment that are in flight at once; 0 for a camera
    /// without latency, history and dropout.
    pub(super) fn max_pending(cfg: &CameraCfg, schedule: Schedule) -> usize {
        let keeps_frames = cfg.latency_steps > 0 || cfg.history_length > 0 || cfg.dropout > 0.0;
        if keeps_frames { delay::capacity(cfg.latency_steps.into(), schedule.period_steps()) } else { 0 }
    }

    /// Allocates the frames that `cfg` needs.
    pub(super) fn new(
        cfg: &CameraCfg,
        schedule: Schedule,
        scene: &RenderScene,
        viewpoints: &Viewpoints,
        key: RngKey,
    ) -> Self {
        let rows = viewpoints.len();
        let frame = CapturedFrame::new(scene, key, !cfg.shutter.is_instant());
        let arrived = DeliveredFrame { frame: frame.clone(), viewpoint: *viewpoints.row(0), rays: None };
        let latency = u64::from(cfg.latency_steps);
        Self {
            shown: vec![frame.clone(); rows],
            stamps: Array1::zeros(rows),
            delay: (latency > 0).then(|| DelayLine::new(rows, latency, schedule.period_steps(), frame)),
            dropout: cfg.dropout,
            delivered: DeliveredFrames {
                counts: Array1::zeros(rows),
                latest: History::filled_with(rows, usize::from(latency > 0), 1, arrived.clone()),
                history: History::filled_with(rows, cfg.history_length, 1, arrived),
                stamps: History::new(rows, cfg.history_length, 1),
            },
            shows_latest: vec![false; rows],
        }
    }

    /// Captures a frame of a row that is due. The frame is put in flight, lost, or shown at once; returns true if it is
    /// shown.
    pub(super) fn capture(
        &mut self,
        row: usize,
        seen: &Observation<'_>,
        key: RngKey,
        opening: Option<&ShutterOpenPoses>,
        viewpoints: &Viewpoints,
    ) -> bool {
        if self.dropout > 0.0 && key.uniforms(RngStream::DROPOUT, 0)[0] < self.dropout {
            return false;
        }
        if let Some(delay) = &mut self.delay {
            delay.push(row, seen.state.step[seen.env]).capture(seen, key, opening);
            return false;
        }
        self.shown[row].capture(seen, key, opening);
        self.stamps[row] = self.shown[row].stamp;
        self.delivered.push(FrameSource::with_current_viewpoint(row, &self.shown[row], viewpoints));
        true
    }

    /// Takes the frames of a row that are due for delivery by `step`; returns true if another frame is shown.
    pub(super) fn deliver(&mut self, row: usize, step: u64, viewpoints: &Viewpoints) -> bool {
        let mut shows = false;
        while let Some((frame, is_newest)) = self.delay.as_mut().and_then(|delay| delay.take(row, step)) {
            self.delivered.push(FrameSource::with_current_viewpoint(row, frame, viewpoints));
            if is_newest {
                self.shown[row].assign(frame);
                self.stamps[row] = frame.stamp;
                shows = true;
            }
        }
        shows
    }

    /// Shows the current state of an environment after a reset or a write. This is not a measurement.
    pub(super) fn refresh(&mut self, row: usize, seen: &Observation<'_>, key: RngKey) {
        if let Some(delay) = &mut self.delay {
            delay.refresh(row, seen.state.step[seen.env]);
        }
        self.shown[row].capture(seen, key, None);
        self.stamps[row] = self.shown[row].stamp;
    }

    /// Clears the frames of a row that are in flight or past.
    pub(super) fn reset(&mut self, row: usize) {
        let DeliveredFrames { counts, latest, history, stamps } = &mut self.delivered;
        counts[row] = 0;
        latest.clear(row);
        history.clear(row);
        stamps.reset(row);
        if let Some(delay) = &mut self.delay {
            delay.clear(row);
        }
    }

    /// Returns the number of steps until the next frame is delivered in any row, at least 1. `steps` are the current
    /// steps of the rows; rows at [`Phases::QUARANTINED`](crate::Phases::QUARANTINED) are skipped. `None` if no other
    /// row has a frame in flight.
    pub(super) fn next_delivery_in(&self, steps: impl Iterator<Item = u64>) -> Option<u64> {
        self.delay.as_ref()?.due_in(steps)
    }

    /// Returns the shown frame of a row.
    pub(super) fn shown(&self, row: usize) -> &CapturedFrame {
        &self.shown[row]
    }

    /// Returns true if the latest delivered frame is shown, from the viewpoint of its delivery.
    pub(super) fn shows_latest(&self, row: usize) -> bool {
        self.shows_latest[row]
    }

    pub(super) fn set_shows_latest(&mut self, row: usize, shows_latest: bool) {
        self.shows_latest[row] = shows_latest;
    }

    /// Returns the latest delivered frame of a row if it is not the shown one; always `None` without a latency, and
    /// before the first delivery.
    pub(super) fn latest_if_not_shown(&self, row: usize) -> Option<FrameSource<'_>> {
        let [latest] = self.delivered.latest.slice(row, 0).filter(|_| !self.shows_latest[row])? else { return None };
        Some(latest.source(row))
    }

    /// Returns the frame of the history of a row that is `age` delivered frames old; 0 is the newest. `None` if the
    /// history does not contain so many frames.
    pub(super) fn history_frame(&self, row: usize, age: usize) -> Option<FrameSource<'_>> {
        let [past] = self.delivered.history.slice(row, age)? else { return None };
        Some(past.source(row))
    }

    /// Times of the shown frames \[s\], shape (rows).
    pub(super) fn stamps(&self) -> ArrayView1<'_, f64> {
        self.stamps.view()
    }

    /// Frames delivered since the last reset, shape (rows).
    pub(super) fn counts(&self) -> ArrayView1<'_, u64> {
        self.delivered.counts.view()
    }

    /// Times of the frames in the history \[s\], newest first.
    pub(super) fn stamp_history(&self) -> &History<f64> {
        &self.delivered.stamps
    }
}

/// Copies a row of an array.
pub(super) fn copy_row<T: Clone>(to: &mut [T], from: &Array2<T>, row: usize) {
    ArrayViewMut1::from(to).assign(&from.index_axis(Axis(0), row));
}

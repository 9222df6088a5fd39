//! Camera sensor: captures the state when a frame is due, renders it when it is read.

pub(super) mod rendering;

use super::cfg::{CameraCfg, DepthMiss};
use super::delivered::HistoryImages;
use super::env_rows::EnvRows;
use super::error::CameraError;
use super::extrinsics::CameraConvention;
use super::frame_buffer::{FrameBuffer, FrameSource, Observation};
use super::frustum::frustum;
use super::motion::Motion;
use super::placement::{CameraPlacement, PlaceRows, PoseFrame};
use super::viewpoints::Viewpoints;
use crate::cached::Cached;
use crate::error::SensorError;
use crate::schedule::{Phases, Schedule};
use crate::sensor::Sensor;
use kinetoscope_render::RenderProgress;
use kinetoscope_render::RngKey;
use kinetoscope_render::frame::{Channels, Images};
use kinetoscope_render::frame::{ImageView, ListedChannel};
use kinetoscope_render::lens;
use kinetoscope_render::lens::{LensRays, Optics};
use kinetoscope_render::{Intrinsics, PixelIntrinsics};
use kinetoscope_render::{RenderError, View};
use kinetoscope_scene::StateFields;
use kinetoscope_scene::pose::to_row;
use kinetoscope_scene::{Marker, Pose, PoseF32, RenderScene, SceneState, VisibleState};
use ndarray::{Array2, Array3, ArrayView1};
use rendering::{FrameRenderer, RenderedImages};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// A camera in each of several environments.
///
/// When a frame is due, the camera *captures* it: it stores the poses of everything visible. The image is rendered from
/// them at the first read afterwards, once, and only if the frame changed ([`CameraCfg::lazy`]). So a read always shows
/// the instant of [`stamps`](Self::stamps), however late it comes. After a setter of [`CameraPlacement`], the next read
/// shows the same instant from the new pose. Poses and intrinsics set that way persist over a reset, until
/// [`restore`](CameraPlacement::restore).
///
/// A camera is perfect by default. Optionally it has a [`history`](Self::history), latency, dropout, noise, and
/// imperfections of real cameras ([`CameraCfg::imperfections`]). With these options, the camera stays lazy and gives
/// the same bits: each capture is kept until it is delivered or read. Setters affect the shown frame and frames in
/// flight; frames in the history keep the pose and the intrinsics of their delivery.
///
/// Returned views borrow the camera, so images are not overwritten while they are read. The first axis of all arrays is
/// the environments of the camera, [`env_ids`](Self::env_ids). Poses are in the frame of the environment, lengths in
/// meters. If the state of one environment cannot be rendered (a pose that is not finite), image reads fail for all
/// environments until a valid state of that environment is captured.
pub struct Camera {
    pub(super) cfg: CameraCfg,
    pub(super) path: String,
    pub(super) scene: Arc<RenderScene>,
    pub(super) num_bodies: usize,
    /// Physics step \[s\].
    pub(super) dt: f64,
    pub(super) lens: ViewTemplate,
    pub(super) viewpoints: Viewpoints,
    pub(super) phases: Phases,
    /// Keys of the random numbers of the frames captured last, row by row.
    pub(super) rng_keys: Vec<RngKey>,
    pub(super) frames: FrameBuffer,
    pub(super) motion: Motion,
    /// Images of the shown frames, of the latest delivered frames where others are shown, and of the history.
    pub(super) images: Cached<RenderedImages>,
    pub(super) latest_images: Cached<RenderedImages>,
    pub(super) past_images: Cached<HistoryImages>,
    pub(super) renderer: Mutex<FrameRenderer>,
    pub(super) progress: RenderProgress,
    pub(super) render_count: AtomicU64,
    /// Rows that show another frame. Only used within an update, kept for its memory.
    pub(super) changed: Vec<usize>,
}

/// Image size and depth range, common to all views.
#[derive(Clone, Copy, Debug)]
pub(super) struct ViewTemplate {
    width: usize,
    height: usize,
    near: f32,
    far: f32,
}

impl ViewTemplate {
    pub(super) fn new(cfg: &CameraCfg) -> Result<Self, CameraError> {
        let (near, far) = (cfg.near as f32, cfg.far as f32);
        // The rasterizer compares the depth with 1/near, which must be finite.
        if near > 0.0 && near < far && far.is_finite() {
            return Ok(Self { width: cfg.width, height: cfg.height, near, far });
        }
        Err(CameraError::View(RenderError::Range { near, far }))
    }

    pub(super) fn view(&self, pixels: &PixelIntrinsics, world_from_camera: PoseF32) -> View {
        let Self { width, height, near, far } = *self;
        let [fx, fy, cx, cy] = [pixels.fx, pixels.fy, pixels.cx, pixels.cy].map(|x| x as f32);
        View { parallel: false, width, height, fx, fy, cx, cy, near, far, world_from_camera }
    }
}

impl Sensor for Camera {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.check(state)?;
        let mut changed = std::mem::take(&mut self.changed);
        changed.clear();
        for row in 0..self.viewpoints.len() {
            let (seen, before) = (self.observe(row, state), self.frames.counts()[row]);
            let step = state.step[seen.env];
            let is_due = self.phases.is_due(row, step);
            let shown = is_due && self.capture(row, &seen);
            let shown = self.frames.deliver(row, step, &self.viewpoints) || shown;
            self.record_deliveries(row, self.frames.counts()[row] - before);
            if shown {
                changed.push(row);
            }
        }
        self.invalidate(&changed);
        changed.iter().for_each(|&row| self.frames.set_shows_latest(row, true));
        self.changed = changed;
        self.render_if_eager();
        (0..self.viewpoints.len()).for_each(|row| self.open_shutter(row, state));
        Ok(())
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.check(state)?;
        let rows = self.viewpoints.envs.visible_rows(env_ids)?;
        for &row in &rows {
            self.phases.reset(row, state.step[self.env_ids()[row]]);
            self.rng_keys[row].reset();
            self.frames.reset(row);
            self.motion.reset(row);
            self.clear_past_images(row);
        }
        self.show_current_state(&rows, state);
        rows.iter().for_each(|&row| self.open_shutter(row, state));
        Ok(())
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.check(state)?;
        let rows = self.viewpoints.envs.visible_rows(env_ids)?;
        rows.iter().for_each(|&row| self.rng_keys[row].advance_unscheduled());
        self.show_current_state(&rows, state);
        rows.iter().for_each(|&row| self.motion.refresh(row, &self.observe(row, state)));
        Ok(())
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        let steps = || self.env_ids().iter().map(|&env| step[env]);
        let due = self.phases.min_wait(steps(), |due| self.motion.steps_until_event(due));
        self.frames.next_delivery_in(steps()).map_or(due, |arrival| arrival.min(due))
    }

    /// Axes of the optical frame and an arrow along each edge of the view frustum, at the captured instant. Empty for
    /// an environment that the camera does not see.
    fn markers(&self, env: usize, _pose: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let row = self.viewpoints.envs.of(env);
        let placed = row.and_then(|row| Some((self.world_from_camera(row)?, self.optics_of(row)?)));
        let (height, width) = self.image_shape();
        placed.map_or_else(Vec::new, |(pose, optics)| frustum(&pose, &optics, height, width))
    }
}

impl PlaceRows for Camera {
    fn env_rows(&self) -> &EnvRows {
        &self.viewpoints.envs
    }

    fn place_rows(&mut self, rows: &[usize], poses: &[Pose], frame: PoseFrame) -> Result<(), SensorError> {
        let Self { viewpoints, frames, .. } = self;
        viewpoints.place(rows, poses, frame, |row| frames.shown(row).world_from_parent)?;
        self.invalidate(rows);
        Ok(())
    }

    fn restore_rows(&mut self, rows: &[usize]) {
        self.viewpoints.restore(rows);
        self.invalidate(rows);
    }
}

impl CameraPlacement for Camera {
    fn local_pose(&self, convention: CameraConvention) -> Array2<f64> {
        self.viewpoints.local_pose(convention)
    }

    fn set_intrinsics(&mut self, intrinsics: &[Intrinsics], env_ids: Option<&[usize]>) -> Result<(), SensorError> {
        let rows = self.viewpoints.envs.selected_rows(env_ids)?;
        let lens = self.lens;
        self.viewpoints.set_intrinsics(&rows, intrinsics, |pixels| {
            lens.view(pixels, PoseF32::IDENTITY).validate().map_err(CameraError::View)
        })?;
        self.invalidate(&rows);
        Ok(())
    }
}

impl Camera {
    pub(super) fn requires(attached: bool, draws_markers: bool) -> StateFields {
        let part = |wanted: bool, field| if wanted { field } else { StateFields::NONE };
        StateFields::VISIBLE | part(attached, StateFields::POSES) | part(draws_markers, StateFields::MARKERS)
    }

    /// Index of the environment of each row (first axis) of the camera's arrays.
    pub fn env_ids(&self) -> &[usize] {
        self.viewpoints.envs.env_ids()
    }

    /// Path: `uid/link/name` for an attached camera, else the name of the camera.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Measured channels.
    pub fn channels(&self) -> Channels {
        self.cfg.channels
    }

    /// Period of captures, in physics steps.
    pub fn schedule(&self) -> Schedule {
        self.phases.schedule()
    }

    /// Time between images \[s\], after rounding to whole physics steps.
    pub fn update_period(&self) -> f64 {
        self.schedule().period_steps() as f64 * self.dt
    }

    /// Image shape (height, width) \[pixels\].
    pub fn image_shape(&self) -> (usize, usize) {
        (self.lens.height, self.lens.width)
    }

    /// True if the camera is attached to a body.
    pub fn is_attached(&self) -> bool {
        self.viewpoints.parent.is_some()
    }

    /// Time of the shown frames \[s\] since the last reset of the environment, shape (N): that of their capture, or of
    /// a later write to the state; 0 before the first frame.
    pub fn stamps(&self) -> ArrayView1<'_, f64> {
        self.frames.stamps()
    }

    /// Number of frames delivered since the last reset, read or not, shape (N). The images of a reset or of a write to
    /// the state do not count.
    pub fn frame_counts(&self) -> ArrayView1<'_, u64> {
        self.frames.counts()
    }

    /// Number of images rendered since the camera was built, summed over environments: a measure of work.
    pub fn render_count(&self) -> u64 {
        self.render_count.load(Ordering::Relaxed)
    }

    /// Progress of path tracing, and a way to cancel it from another thread. After [`RenderProgress::cancel`], a read
    /// that renders returns [`CameraError::Render`] with [`RenderError::Canceled`]. The first read after
    /// [`RenderProgress::resume`] renders the canceled images.
    pub fn progress(&self) -> &RenderProgress {
        &self.progress
    }

    /// Images of one channel: `camera.channel::<Depth>()?`, shape (N, H, W) or (N, H, W, components). Renders the
    /// frames captured since the last read.
    ///
    /// # Errors
    ///
    /// [`CameraError::ChannelOff`], [`CameraError::NothingCaptured`] before the first reset or update, and
    /// [`CameraError::Render`].
    pub fn channel<C: ListedChannel>(&self) -> Result<ImageView<'_, C>, SensorError> {
        self.require_channel::<C>()?;
        self.images()?.get::<C>().ok_or_else(|| self.channel_off::<C>().into())
    }

    /// Returns an error if the channel is not measured.
    pub(super) fn require_channel<C: ListedChannel>(&self) -> Result<(), CameraError> {
        if self.cfg.channels.has::<C>() { Ok(()) } else { Err(self.channel_off::<C>()) }
    }

    pub(super) fn channel_off<C: ListedChannel>(&self) -> CameraError {
        CameraError::ChannelOff { channel: C::NAME, enabled: self.cfg.channels.names() }
    }

    /// Images of all channels. Renders the frames captured since the last read.
    ///
    /// # Errors
    ///
    /// [`CameraError::NothingCaptured`] before the first reset or update, and [`CameraError::Render`].
    pub fn images(&self) -> Result<&Images, SensorError> {
        (0..self.viewpoints.len()).try_for_each(|row| self.require_captured(row))?;
        let make = || Ok(RenderedImages::new(&self.cfg, self.viewpoints.len()));
        let draw = |images: &mut RenderedImages| self.render_stale(images, |row| Some(self.shown_source(row)));
        Ok(self.images.get_or_update(make, draw)?.images()?)
    }

    /// Intrinsic matrices `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]` \[pixels\], shape (N, 3, 3), as last set. The corner
    /// of the first pixel is at (0, 0).
    pub fn intrinsic_matrices(&self) -> Array3<f64> {
        Array3::from_shape_fn((self.viewpoints.len(), 3, 3), |(row, i, j)| {
            self.viewpoints.row(row).pixels.matrix()[(i, j)]
        })
    }

    /// The lens, the same in all environments.
    pub fn lens(&self) -> lens::Lens {
        self.viewpoints.lens()
    }

    /// Optics of environment `env`: the lens with its intrinsics, mapping directions to pixels and back.
    ///
    /// # Errors
    ///
    /// An environment that the camera does not see.
    pub fn optics(&self, env: usize) -> Result<Optics, SensorError> {
        let pixels = self.viewpoints.row(self.row(env)?).pixels;
        Ok(Optics::new(self.viewpoints.lens(), pixels)?)
    }

    /// True if the color channel shows the markers of other sensors.
    pub fn renders_markers(&self) -> bool {
        self.cfg.draw_markers
    }

    /// Memory of the lens rays \[bytes\]; 0 for a pinhole.
    pub fn lens_bytes(&self) -> usize {
        self.viewpoints.ray_bytes()
    }

    /// Poses in the environment at the captured instant, with the local poses as last set, rows
    /// `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7). NaN for an attached camera before its first capture.
    pub fn pose_w(&self, convention: CameraConvention) -> Array2<f64> {
        let pose = |row| self.world_from_camera(row).map(|pose| to_row(&convention.pose_from_optical(&pose)));
        Array2::from(
            (0..self.viewpoints.len()).map(|row| pose(row).unwrap_or([f64::NAN; 7])).collect::<Vec<[f64; 7]>>(),
        )
    }

    /// View of environment `env` at the captured instant: pose, pinhole intrinsics, near and far. The view has no
    /// distortion: for a lens other than a pinhole, [`optics`](Self::optics) converts between directions and pixels.
    ///
    /// # Errors
    ///
    /// The camera does not see the environment, or it is attached to a body and has captured nothing yet
    /// ([`CameraError::NothingCaptured`]).
    pub fn view(&self, env: usize) -> Result<View, SensorError> {
        let row = self.row(env)?;
        let pose = self.world_from_camera(row).ok_or(CameraError::NothingCaptured { env })?;
        Ok(self.lens.view(&self.viewpoints.row(row).pixels, PoseF32::from(&pose)))
    }

    /// The row of an environment; an error for an environment that the camera does not see.
    pub(super) fn row(&self, env: usize) -> Result<usize, SensorError> {
        self.viewpoints.envs.row(env)
    }

    /// Returns true if a number is a hit: of the depth channel, or of the distance channel if rays do not all go
    /// forward.
    pub(super) fn is_hit(&self, depth: f32) -> bool {
        match self.cfg.depth_miss {
            DepthMiss::Inf => depth.is_finite(),
            DepthMiss::Far => depth < self.lens.far,
            DepthMiss::Zero => depth > 0.0,
        }
    }

    /// Returns true if straight lines are bent in the image.
    pub(super) fn is_distorted(&self) -> bool {
        !self.viewpoints.lens().is_pinhole()
    }

    /// Returns an error for a lens other than a pinhole; `what` names the feature.
    pub(super) fn require_pinhole(&self, what: &'static str) -> Result<(), CameraError> {
        let lens = self.viewpoints.lens();
        if lens.is_pinhole() { Ok(()) } else { Err(CameraError::PinholeOnly { what, lens: lens.name() }) }
    }

    /// Returns the optics of a row; `None` only for invalid intrinsics, which setters reject.
    fn optics_of(&self, row: usize) -> Option<Optics> {
        match self.rays_of(row) {
            Some(rays) => Some(*rays.optics()),
            None => Optics::new(lens::Lens::default(), self.viewpoints.row(row).pixels).ok(),
        }
    }

    /// Returns the lens rays of a row; `None` for a pinhole.
    pub(super) fn rays_of(&self, row: usize) -> Option<&LensRays> {
        self.viewpoints.rays(row).map(|rays| &**rays)
    }

    /// Returns the pose of the optical frame in the environment at the captured instant; `None` for an attached camera
    /// before the first capture.
    pub(super) fn world_from_camera(&self, row: usize) -> Option<Pose> {
        self.viewpoints.world_from(self.viewpoints.row(row), self.frames.shown(row).world_from_parent)
    }

    /// Checks that the state belongs to the scene that the camera was built for.
    fn check(&self, state: &SceneState) -> Result<(), SensorError> {
        let missing = Self::requires(self.is_attached(), self.cfg.draw_markers).without(StateFields::present_in(state));
        let Some(VisibleState { instance_poses, lights, .. }) = state.visible.as_ref().filter(|_| missing.is_empty())
        else {
            return Err(SensorError::MissingFields { sensor: "camera", missing });
        };
        let envs = self.viewpoints.envs.num_envs();
        let counts = [
            ("environments", envs, state.num_envs()),
            ("environments with a time", envs, state.time.len()),
            ("environments with instances", envs, instance_poses.nrows()),
            ("instances", self.scene.instances().len(), instance_poses.ncols()),
            ("environments with lights", envs, lights.nrows()),
            ("lights", self.scene.lights.len(), lights.ncols()),
        ];
        let of_bodies = state.body_poses.as_ref().filter(|_| self.is_attached()).map(|poses| {
            let (found, bodies, numbers) = poses.dim();
            [
                ("environments with bodies", envs, found),
                ("bodies", self.num_bodies, bodies),
                ("numbers per body pose", 7, numbers),
            ]
        });
        let of_markers = state.markers.as_ref().filter(|_| self.cfg.draw_markers);
        let of_markers = of_markers.map(|markers| ("environments with markers", envs, markers.len()));
        let all = counts.into_iter().chain(of_bodies.into_iter().flatten()).chain(of_markers);
        match all.into_iter().find(|(_, expected, found)| expected != found) {
            Some((what, expected, found)) => Err(SensorError::WrongShape { what, expected, found }),
            None => Ok(()),
        }
    }

    fn observe<'a>(&self, row: usize, state: &'a SceneState) -> Observation<'a> {
        Observation { state, env: self.env_ids()[row], parent: self.viewpoints.parent }
    }

    /// Captures a frame of a row that is due; returns true if it is shown at once.
    fn capture(&mut self, row: usize, seen: &Observation<'_>) -> bool {
        let Self { frames, motion, viewpoints, rng_keys, .. } = self;
        rng_keys[row].advance_scheduled();
        motion.advance(row, frames.shown(row));
        let shown = frames.capture(row, seen, rng_keys[row], motion.shutter_open_poses(row), viewpoints);
        motion.close_shutter(row);
        if shown {
            self.motion.record_shown_view(row, self.view_of(row));
        }
        shown
    }

    /// Shows the current state of some environments. The state must be checked before.
    fn show_current_state(&mut self, rows: &[usize], state: &SceneState) {
        for &row in rows {
            self.frames.refresh(row, &self.observe(row, state), self.rng_keys[row]);
            self.motion.record_shown_view(row, self.view_of(row));
        }
        self.invalidate(rows);
        self.render_if_eager();
    }

    fn open_shutter(&mut self, row: usize, state: &SceneState) {
        self.motion.open_shutter_if_due(row, &self.phases, &self.observe(row, state));
    }

    fn render_if_eager(&self) {
        if !self.cfg.lazy {
            // Errors are returned by the next read.
            let _ = self.images();
            self.render_history();
        }
    }

    /// Marks the images of some rows as outdated, after a change of frame or viewpoint.
    fn invalidate(&mut self, rows: &[usize]) {
        if rows.is_empty() {
            return;
        }
        rows.iter().for_each(|&row| self.frames.set_shows_latest(row, false));
        self.latest_images = Cached::empty();
        self.images.invalidate();
        if let Some(images) = self.images.value_mut() {
            rows.iter().for_each(|&row| images.set_stale(row, true));
        }
    }

    /// Returns an error before the first reset or update of a row, while poses are unknown.
    pub(super) fn require_captured(&self, row: usize) -> Result<(), CameraError> {
        let captured = self.frames.shown(row).world_from_parent.is_some();
        captured.then_some(()).ok_or(CameraError::NothingCaptured { env: self.env_ids()[row] })
    }

    /// Returns the shown frame of a row, with its current viewpoint.
    fn shown_source(&self, row: usize) -> FrameSource<'_> {
        FrameSource::with_current_viewpoint(row, self.frames.shown(row), &self.viewpoints)
    }

    /// Returns the view of a captured row.
    pub(super) fn view_of(&self, row: usize) -> View {
        self.view_from(&self.shown_source(row))
    }

    fn view_from(&self, source: &FrameSource<'_>) -> View {
        let pose = self.viewpoints.world_from(source.viewpoint, source.frame.world_from_parent);
        self.lens.view(&source.viewpoint.pixels, PoseF32::from(&pose.unwrap_or_else(Pose::identity)))
    }
}

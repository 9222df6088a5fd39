//! The camera: captures what there is to see, draws when somebody looks.

use super::cfg::{CameraCfg, DepthMiss};
use super::channel::{Channels, Listed, PictureView, Pictures};
use super::earlier::Earlier;
use super::error::CameraError;
use super::extrinsics::{CameraConvention, Poses};
use super::frustum::frustum;
use super::intrinsics::{Intrinsics, PixelIntrinsics};
use super::mounts::{Mount, Mounts, chosen_rows};
use super::parallel::{Job, ParallelRasterizer};
use super::rasterizer::Shot;
use crate::error::SensorError;
use crate::schedule::{Phases, Schedule};
use crate::sensor::{Requires, Sensor, SensorContext};
use crate::visibility::{RenderError, View};
use ndarray::{Array1, Array2, Array3, ArrayView1, Axis};
use scene::pose::{from_row, to_row};
use scene::{Light, Marker, OwnScene, Pose, PoseF32, RenderScene, SceneState, VisibleState};
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// A camera in each of several environments.
///
/// When a picture is due, the camera *captures*: it keeps where everything is. Pictures are drawn from that at the first
/// reading afterwards, once, and only where something changed ([`CameraCfg::lazy`]). So a reading always shows the instant
/// of [`stamps`](Self::stamps), however late it comes. After a setter ([`set_local_pose`](Self::set_local_pose),
/// [`look_at`](Self::look_at), [`set_intrinsics`](Self::set_intrinsics)...) the next reading shows the same instant from
/// the new place. Places and lenses set that way stay over a reset, until [`restore`](Self::restore).
///
/// Views that were read borrow the camera: nothing draws over them. The first axis of everything is the camera's own
/// environments, [`env_ids`](Self::env_ids); the frame is that of the environment, units are metres. An environment whose
/// state cannot be drawn (a pose that is not finite) makes reading an error, until it was captured anew.
pub struct Camera {
    lens: Lens,
    scene: Arc<RenderScene>,
    env_ids: Vec<usize>,
    /// Which row belongs to an environment; the inverse of `env_ids`.
    row_of_env: Vec<Option<usize>>,
    num_bodies: usize,
    /// Index of the body it hangs on.
    parent: Option<usize>,
    pub(super) mounts: Mounts,
    channels: Channels,
    depth_miss: DepthMiss,
    lazy: bool,
    phases: Phases,
    /// Physics step \[s\].
    dt: f64,
    captures: Captures,
    /// Where flow is measured.
    earlier: Option<Earlier>,
    frame_counts: Array1<u64>,
    /// Rows that are due, between updates without meaning: its memory is kept.
    due: Vec<usize>,
    /// The pictures of what was captured, once somebody looked.
    drawn: OnceLock<Canvas>,
    desk: Mutex<Desk>,
    draws: AtomicU64,
}

/// What all views have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lens {
    width: usize,
    height: usize,
    near: f32,
    far: f32,
}

/// What there was to see.
#[derive(Clone, Debug)]
struct Captures {
    /// World from instance, shape \[rows, instances\].
    poses: Array2<PoseF32>,
    /// Shape \[rows, lamps\].
    lights: Array2<Light>,
    /// What there is instead of the scene of all, row by row.
    scenes: Vec<OwnScene>,
    /// Where the parent was; the identity for a free camera, `None` before the first capture.
    world_from_parent: Vec<Option<Pose>>,
    stamps: Array1<f64>,
}

/// Pictures, and which of them are not of what was captured last.
#[derive(Debug)]
struct Canvas {
    pictures: Pictures,
    stale: Vec<bool>,
    failure: Option<CameraError>,
}

/// What is needed for drawing: one at a time.
#[derive(Debug)]
struct Desk {
    rasterizer: ParallelRasterizer,
    /// The canvas, while it is not in `Camera::drawn`.
    canvas: Option<Canvas>,
    /// Lists that are empty between drawings: their memory is kept.
    views: Vec<View>,
    jobs: Vec<Job<'static>>,
}

impl Lens {
    pub(super) fn new(cfg: &CameraCfg) -> Result<Self, CameraError> {
        let (near, far) = (cfg.near as f32, cfg.far as f32);
        // The rasterizer holds the depth against 1/near: it must be a number.
        if near > 0.0 && near < far && far.is_finite() {
            return Ok(Self { width: cfg.width, height: cfg.height, near, far });
        }
        Err(CameraError::View(RenderError::Range { near, far }))
    }

    pub(super) fn view(&self, pixels: &PixelIntrinsics, world_from_camera: PoseF32) -> View {
        let Self { width, height, near, far } = *self;
        let [fx, fy, cx, cy] = [pixels.fx, pixels.fy, pixels.cx, pixels.cy].map(|x| x as f32);
        View { width, height, fx, fy, cx, cy, near, far, world_from_camera }
    }
}

impl Canvas {
    fn new(pictures: Pictures, rows: usize) -> Self {
        Self { pictures, stale: vec![true; rows], failure: None }
    }
}

impl Sensor for Camera {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.check(state)?;
        let mut due = std::mem::take(&mut self.due);
        due.clear();
        due.extend((0..self.env_ids.len()).filter(|&row| self.phases.is_due(row, state.step[self.env_ids[row]])));
        for &row in &due {
            self.frame_counts[row] += 1;
        }
        self.keep_earlier(&due);
        self.capture(&due, state);
        self.due = due;
        Ok(())
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.check(state)?;
        let rows = self.seen_rows(env_ids)?;
        for &row in &rows {
            self.phases.reset(row, state.step[self.env_ids[row]]);
            self.frame_counts[row] = 0;
            self.earlier.iter_mut().for_each(|earlier| earlier.forget(row));
        }
        self.capture(&rows, state);
        Ok(())
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.check(state)?;
        let rows = self.seen_rows(env_ids)?;
        self.capture(&rows, state);
        Ok(())
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.phases.due_in(self.env_ids.iter().map(|&env| step[env]))
    }

    /// The optical frame, and an arrow along each edge of the picture's pyramid, at the captured instant; none in an
    /// environment that it does not look into.
    fn markers(&self, env: usize, _pose: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let row = self.row_of_env.get(env).copied().flatten();
        let placed = row.and_then(|row| Some((self.world_from_camera(row)?, self.mounts.row(row).pixels)));
        placed.map_or_else(Vec::new, |(pose, lens)| frustum(&pose, &lens, self.image_shape()))
    }
}

impl Camera {
    pub(super) fn requires(attached: bool) -> Requires {
        if attached { Requires::VISIBLE | Requires::POSES } else { Requires::VISIBLE }
    }

    #[allow(clippy::too_many_arguments, reason = "the parts that the configuration has checked, in one place")]
    pub(super) fn new(
        cfg: &CameraCfg,
        context: &SensorContext,
        scene: Arc<RenderScene>,
        schedule: Schedule,
        parent: Option<usize>,
        (lens, pixels, parent_from_camera): (Lens, PixelIntrinsics, Pose),
        env_ids: Vec<usize>,
        pictures: Pictures,
    ) -> Self {
        let rows = env_ids.len();
        let mut row_of_env = vec![None; context.num_envs];
        for (row, &env) in env_ids.iter().enumerate() {
            row_of_env[env] = Some(row);
        }
        let captures = Captures {
            poses: Array2::from_elem((rows, scene.instances().len()), PoseF32::IDENTITY),
            lights: Array2::from_elem((rows, scene.lights.len()), Light::default()),
            scenes: vec![OwnScene::default(); rows],
            world_from_parent: vec![None; rows],
            stamps: Array1::zeros(rows),
        };
        let earlier = cfg.channels.flow.then(|| Earlier::new(rows, scene.instances().len()));
        let mut rasterizer = ParallelRasterizer::new(cfg.raster, context.threads).with_crew(context.crew.clone());
        rasterizer.set_renderer(cfg.renderer);
        rasterizer.share_assets(&context.ray_assets);
        let canvas = Some(Canvas::new(pictures, rows));
        Self {
            lens,
            scene,
            row_of_env,
            num_bodies: context.bodies.len(),
            parent,
            mounts: Mounts::new(Mount { parent_from_camera, pixels }, rows),
            channels: cfg.channels,
            depth_miss: cfg.depth_miss,
            lazy: cfg.lazy,
            phases: schedule.phases(rows),
            dt: context.dt,
            captures,
            earlier,
            frame_counts: Array1::zeros(rows),
            due: Vec::with_capacity(rows),
            drawn: OnceLock::new(),
            desk: Mutex::new(Desk { rasterizer, canvas, views: Vec::new(), jobs: Vec::new() }),
            draws: AtomicU64::new(0),
            env_ids,
        }
    }

    /// The environments that it looks into: the first axis of everything it measures.
    pub fn env_ids(&self) -> &[usize] {
        &self.env_ids
    }

    /// What it measures.
    pub fn channels(&self) -> Channels {
        self.channels
    }

    /// When it measures.
    pub fn schedule(&self) -> Schedule {
        self.phases.schedule()
    }

    /// Rows and pixels per row: (H, W).
    pub fn image_shape(&self) -> (usize, usize) {
        (self.lens.height, self.lens.width)
    }

    /// Whether it hangs on a body.
    pub fn is_attached(&self) -> bool {
        self.parent.is_some()
    }

    /// Time of the instant that pictures show \[s\] since the last reset of the environment, shape (N).
    pub fn stamps(&self) -> ArrayView1<'_, f64> {
        self.captures.stamps.view()
    }

    /// Pictures since the last reset, shape (N): those that were due, whether somebody looked or not. The refresh of a
    /// reset is none.
    pub fn frame_counts(&self) -> ArrayView1<'_, u64> {
        self.frame_counts.view()
    }

    /// How many pictures were drawn since the camera was built, each environment counted: a measure of work.
    pub fn draws(&self) -> u64 {
        self.draws.load(Ordering::Relaxed)
    }

    /// The pictures of one channel: `camera.channel::<Depth>()?`, shape (N, H, W) or (N, H, W, components). Draws what was
    /// captured since the last reading.
    ///
    /// # Errors
    ///
    /// [`CameraError::ChannelOff`], [`CameraError::NothingCaptured`] before the first reset or update, and
    /// [`CameraError::Draw`].
    pub fn channel<C: Listed>(&self) -> Result<PictureView<'_, C>, SensorError> {
        let off = || CameraError::ChannelOff { channel: C::NAME, enabled: self.channels.names() };
        if !self.channels.has::<C>() {
            return Err(off().into());
        }
        self.pictures()?.get::<C>().ok_or_else(|| off().into())
    }

    /// All pictures. Draws what was captured since the last reading.
    ///
    /// # Errors
    ///
    /// [`CameraError::NothingCaptured`] before the first reset or update, and [`CameraError::Draw`].
    pub fn pictures(&self) -> Result<&Pictures, SensorError> {
        if let Some(row) = self.captures.world_from_parent.iter().position(Option::is_none) {
            return Err(CameraError::NothingCaptured { env: self.env_ids[row] }.into());
        }
        let canvas = self.drawn.get_or_init(|| self.draw());
        match &canvas.failure {
            Some(failure) => Err(failure.clone().into()),
            None => Ok(&canvas.pictures),
        }
    }

    /// Intrinsic matrices `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]` \[pixels\], shape (N, 3, 3).
    pub fn intrinsic_matrices(&self) -> Array3<f64> {
        Array3::from_shape_fn((self.mounts.len(), 3, 3), |(row, i, j)| self.mounts.row(row).pixels.matrix()[(i, j)])
    }

    /// Poses in the environment at the captured instant, rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7). NaN where an
    /// attached camera has captured nothing yet.
    pub fn pose_w(&self, convention: CameraConvention) -> Array2<f64> {
        let pose = |row| self.world_from_camera(row).map(|pose| to_row(&convention.of_optical(&pose)));
        Array2::from((0..self.mounts.len()).map(|row| pose(row).unwrap_or([f64::NAN; 7])).collect::<Vec<[f64; 7]>>())
    }

    /// Poses in the frame of the parent (of the environment, for a free camera), rows `[x, y, z, qw, qx, qy, qz]` \[m\],
    /// shape (N, 7).
    pub fn local_pose(&self, convention: CameraConvention) -> Array2<f64> {
        self.mounts.local_pose(convention)
    }

    /// The view of environment `env` at the captured instant: what a renderer draws.
    ///
    /// # Errors
    ///
    /// An environment that the camera does not see, [`CameraError::NothingCaptured`].
    pub fn view(&self, env: usize) -> Result<View, SensorError> {
        let row = self.row(env)?;
        let pose = self.world_from_camera(row).ok_or(CameraError::NothingCaptured { env })?;
        Ok(self.lens.view(&self.mounts.row(row).pixels, PoseF32::from(&pose)))
    }

    /// Places cameras in the frame of their parent (of the environment, for free ones), from now on.
    ///
    /// `poses` are typed or rows `[x, y, z, qw, qx, qy, qz]`: one for each of `env_ids` (`None` is all environments of the
    /// camera), or one for all. `convention` says what their axes mean.
    ///
    /// # Errors
    ///
    /// [`CameraError::Pose`], [`CameraError::Count`], an environment that the camera does not see or that is named twice;
    /// nothing is changed then.
    pub fn set_local_pose(
        &mut self,
        poses: &(impl Poses + ?Sized),
        env_ids: Option<&[usize]>,
        convention: CameraConvention,
    ) -> Result<(), SensorError> {
        let rows = self.chosen_rows(env_ids)?;
        self.mounts.set_local(&rows, poses, convention)?;
        self.outdate(&rows);
        Ok(())
    }

    /// Places cameras in the environment, as [`set_local_pose`](Self::set_local_pose). An attached camera gets the local
    /// pose that puts it there at the captured instant, and moves with its parent from then on.
    ///
    /// # Errors
    ///
    /// As [`set_local_pose`](Self::set_local_pose), and [`CameraError::NothingCaptured`] for an attached camera whose
    /// parent was not seen yet.
    pub fn set_world_poses(
        &mut self,
        poses: &(impl Poses + ?Sized),
        env_ids: Option<&[usize]>,
        convention: CameraConvention,
    ) -> Result<(), SensorError> {
        let rows = self.chosen_rows(env_ids)?;
        let Self { mounts, parent, captures, env_ids, .. } = self;
        mounts.set_world(&rows, poses, convention, |row| match (*parent, captures.world_from_parent[row]) {
            (None, _) => Ok(None),
            (Some(_), Some(world_from_parent)) => Ok(Some(world_from_parent)),
            (Some(_), None) => Err(CameraError::NothingCaptured { env: env_ids[row] }),
        })?;
        self.outdate(&rows);
        Ok(())
    }

    /// Turns cameras to something: places each at `eye`, looking at `target`, in the frame of its parent (of the
    /// environment, for free ones). See [`look_at_pose`](super::look_at_pose) for `up`; what one environment gets never depends on another. To
    /// look from an attached camera at a point of the environment, give [`look_at_pose`](super::look_at_pose) to
    /// [`set_world_poses`](Self::set_world_poses).
    ///
    /// One `eye`, `target` and `up` for each of `env_ids` (`None` is all environments of the camera), or one for all \[m\].
    ///
    /// # Errors
    ///
    /// [`CameraError::LookAt`], [`CameraError::Count`], an environment that the camera does not see or that is named
    /// twice; nothing is changed then.
    pub fn look_at(
        &mut self,
        eye: &[[f64; 3]],
        target: &[[f64; 3]],
        up: &[[f64; 3]],
        env_ids: Option<&[usize]>,
    ) -> Result<(), SensorError> {
        let rows = self.chosen_rows(env_ids)?;
        self.mounts.look_at(&rows, eye, target, up)?;
        self.outdate(&rows);
        Ok(())
    }

    /// Changes lenses: one for each of `env_ids` (`None` is all environments of the camera), or one for all.
    ///
    /// # Errors
    ///
    /// [`CameraError::Lens`], [`CameraError::View`], [`CameraError::Count`], an environment that the camera does not see
    /// or that is named twice; nothing is changed then.
    pub fn set_intrinsics(&mut self, intrinsics: &[Intrinsics], env_ids: Option<&[usize]>) -> Result<(), SensorError> {
        let rows = self.chosen_rows(env_ids)?;
        let Self { mounts, lens, .. } = self;
        mounts.set_intrinsics(&rows, intrinsics, (lens.width, lens.height), |pixels| {
            lens.view(pixels, PoseF32::IDENTITY).validate().map_err(CameraError::View)
        })?;
        self.outdate(&rows);
        Ok(())
    }

    /// Places and lenses as they were configured, in `env_ids` (`None` is all environments of the camera).
    ///
    /// # Errors
    ///
    /// An environment that the camera does not see or that is named twice; nothing is changed then.
    pub fn restore(&mut self, env_ids: Option<&[usize]>) -> Result<(), SensorError> {
        let rows = self.chosen_rows(env_ids)?;
        self.mounts.restore(&rows);
        self.outdate(&rows);
        Ok(())
    }

    /// The row of an environment.
    pub(super) fn row(&self, env: usize) -> Result<usize, SensorError> {
        let count = self.row_of_env.len();
        let row =
            self.row_of_env.get(env).ok_or(SensorError::IndexOutOfRange { what: "environment", index: env, count })?;
        Ok(row.ok_or_else(|| CameraError::NotSeen { env, seen: self.env_ids.clone() })?)
    }

    /// The rows of the environments that somebody chose.
    fn chosen_rows(&self, env_ids: Option<&[usize]>) -> Result<Vec<usize>, SensorError> {
        chosen_rows(self.env_ids.len(), env_ids, |env| self.row(env))
    }

    /// The rows of those of the environments that the camera sees; the simulation speaks of all.
    fn seen_rows(&self, env_ids: &[usize]) -> Result<Vec<usize>, SensorError> {
        let count = self.row_of_env.len();
        match env_ids.iter().find(|&&env| env >= count) {
            Some(&index) => Err(SensorError::IndexOutOfRange { what: "environment", index, count }),
            None => Ok(env_ids.iter().filter_map(|&env| self.row_of_env[env]).collect()),
        }
    }

    /// Whether a number of the depth channel is that of a surface.
    pub(super) fn is_hit(&self, depth: f32) -> bool {
        match self.depth_miss {
            DepthMiss::Inf => depth.is_finite(),
            DepthMiss::Far => depth < self.lens.far,
            DepthMiss::Zero => depth > 0.0,
        }
    }

    /// Where the optical frame is at the captured instant.
    pub(super) fn world_from_camera(&self, row: usize) -> Option<Pose> {
        let local = self.mounts.row(row).parent_from_camera;
        match self.parent {
            None => Some(local),
            Some(_) => self.captures.world_from_parent[row].map(|world_from_parent| world_from_parent * local),
        }
    }

    /// Whether the state is of the scene that the camera was built for.
    fn check(&self, state: &SceneState) -> Result<(), SensorError> {
        let missing = Self::requires(self.is_attached()).without(Requires::present_in(state));
        let Some(VisibleState { instance_poses, lights }) = state.visible.as_ref().filter(|_| missing.is_empty())
        else {
            return Err(SensorError::MissingFields { sensor: "camera", missing });
        };
        let envs = self.row_of_env.len();
        let counts = [
            ("environments", envs, state.num_envs()),
            ("environments with a time", envs, state.time.len()),
            ("environments with instances", envs, instance_poses.nrows()),
            ("instances", self.scene.instances().len(), instance_poses.ncols()),
            ("environments with lamps", envs, lights.nrows()),
            ("lamps", self.scene.lights.len(), lights.ncols()),
        ];
        let of_bodies = state.body_poses.as_ref().filter(|_| self.is_attached()).map(|poses| {
            let (found, bodies, numbers) = poses.dim();
            [
                ("environments with bodies", envs, found),
                ("bodies", self.num_bodies, bodies),
                ("numbers per body pose", 7, numbers),
            ]
        });
        match counts.into_iter().chain(of_bodies.into_iter().flatten()).find(|(_, expected, found)| expected != found) {
            Some((what, expected, found)) => Err(SensorError::WrongShape { what, expected, found }),
            None => Ok(()),
        }
    }

    /// What some rows show now is what the pictures before showed, from now on.
    fn keep_earlier(&mut self, rows: &[usize]) {
        // It is not there while it is written to.
        let Some(mut earlier) = self.earlier.take() else { return };
        for &row in rows.iter().filter(|&&row| self.captures.world_from_parent[row].is_some()) {
            earlier.keep(row, &self.captures.poses, self.view_of(row));
        }
        self.earlier = Some(earlier);
    }

    /// Keeps what there is to see in some environments; the state was checked.
    fn capture(&mut self, rows: &[usize], state: &SceneState) {
        let Some(visible) = &state.visible else { return };
        for &row in rows {
            let env = self.env_ids[row];
            let to = &mut self.captures;
            to.poses.index_axis_mut(Axis(0), row).assign(&visible.instance_poses.index_axis(Axis(0), env));
            to.lights.index_axis_mut(Axis(0), row).assign(&visible.lights.index_axis(Axis(0), env));
            to.scenes[row].clone_from(state.own_scene(env));
            let parent = self.parent.zip(state.body_poses.as_ref());
            let world_from_parent =
                parent.map(|(body, poses)| from_row(&std::array::from_fn(|k| poses[(env, body, k)])));
            to.world_from_parent[row] = Some(world_from_parent.unwrap_or_else(Pose::identity));
            to.stamps[row] = state.time[env];
        }
        self.outdate(rows);
        if !self.lazy {
            // What is wrong is said to who reads.
            let _ = self.pictures();
        }
    }

    /// The pictures of some rows are not those of the last capture any more.
    fn outdate(&mut self, rows: &[usize]) {
        if rows.is_empty() {
            return;
        }
        let drawn = self.drawn.take();
        let desk = self.desk.get_mut().unwrap_or_else(PoisonError::into_inner);
        desk.canvas = drawn.or(desk.canvas.take());
        if let Some(canvas) = &mut desk.canvas {
            rows.iter().for_each(|&row| canvas.stale[row] = true);
        }
    }

    /// Draws what is stale.
    fn draw(&self) -> Canvas {
        let rows = self.mounts.len();
        let mut desk = self.desk.lock().unwrap_or_else(PoisonError::into_inner);
        let desk = &mut *desk;
        // It is missing only where a drawing panicked.
        let mut canvas = desk.canvas.take().unwrap_or_else(|| {
            Canvas::new(Pictures::new(self.channels, rows, self.lens.width, self.lens.height), rows)
        });
        let Canvas { pictures, stale, failure } = &mut canvas;
        let is_stale = |row: &usize| stale[*row];
        desk.views.clear();
        desk.views.extend((0..rows).filter(is_stale).map(|row| self.view_of(row)));
        let mut jobs: Vec<Job<'_>> = emptied(std::mem::take(&mut desk.jobs));
        let frames = pictures.frames_mut(rows).enumerate().filter(|(row, _)| is_stale(row));
        for ((row, frame), view) in frames.zip(&desk.views) {
            let poses = row_of(&self.captures.poses, row);
            let lights = Some(row_of(&self.captures.lights, row));
            let scene = self.captures.scenes[row].0.as_deref().unwrap_or(&self.scene);
            let before = self.earlier.as_ref().and_then(|earlier| earlier.of(row));
            jobs.push((Shot { scene, poses, view, lights, before }, frame));
        }
        let result = desk.rasterizer.render(&mut jobs);
        let miss = match self.depth_miss {
            DepthMiss::Inf => None,
            DepthMiss::Far => Some(self.lens.far),
            DepthMiss::Zero => Some(0.0),
        };
        for (_, frame) in &mut jobs {
            miss.into_iter().for_each(|value| frame.replace_misses(value));
        }
        self.draws.fetch_add(jobs.len() as u64, Ordering::Relaxed);
        desk.jobs = emptied(jobs);
        *failure = result.err().and_then(|(job, error)| {
            let row = (0..rows).filter(is_stale).nth(job)?;
            Some(CameraError::Draw { env: self.env_ids[row], error })
        });
        // After a failure it is not known which are good.
        if failure.is_none() {
            stale.fill(false);
        }
        canvas
    }

    /// What there is to draw of a row at the captured instant, and what draws it: for whoever needs more than pictures.
    pub(super) fn shot_of<T>(&self, row: usize, act: impl FnOnce(&mut ParallelRasterizer, Shot<'_>) -> T) -> T {
        let mut desk = self.desk.lock().unwrap_or_else(PoisonError::into_inner);
        let view = &self.view_of(row);
        let scene = self.captures.scenes[row].0.as_deref().unwrap_or(&self.scene);
        let (poses, lights) = (row_of(&self.captures.poses, row), Some(row_of(&self.captures.lights, row)));
        act(&mut desk.rasterizer, Shot { scene, poses, view, lights, before: None })
    }

    /// The view of a row that was captured.
    pub(super) fn view_of(&self, row: usize) -> View {
        let pose = self.world_from_camera(row).unwrap_or_else(Pose::identity);
        self.lens.view(&self.mounts.row(row).pixels, PoseF32::from(&pose))
    }
}

/// Short: a scene and pictures are long.
impl fmt::Debug for Camera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Camera")
            .field("width", &self.lens.width)
            .field("height", &self.lens.height)
            .field("channels", &self.channels.names())
            .field("environments", &self.env_ids.len())
            .field("parent", &self.parent)
            .finish_non_exhaustive()
    }
}

impl fmt::Display for Camera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "Camera")?;
        writeln!(f, "  environments       : {}", self.env_ids.len())?;
        let period = self.phases.schedule().period_steps() as f64 * self.dt;
        writeln!(f, "  update period (s)  : {period}")?;
        writeln!(f, "  pictures           : {} x {}", self.lens.width, self.lens.height)?;
        write!(f, "  channels           : {}", self.channels.names().join(", "))
    }
}

/// The memory of a list for another list: of the same type, but for what it borrows.
fn emptied<T, U>(mut list: Vec<T>) -> Vec<U> {
    list.clear();
    // Collected in place.
    list.into_iter().filter_map(|_| None).collect()
}

/// A row of an array that the camera allocated itself, in C order.
fn row_of<T>(array: &Array2<T>, row: usize) -> &[T] {
    let width = array.ncols();
    array.as_slice().map_or(&[], |flat| &flat[row * width..(row + 1) * width])
}

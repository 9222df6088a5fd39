//! The camera: captures what there is to see, draws when somebody looks.

mod drawing;

use super::captures::Captures;
use super::cfg::{CameraCfg, DepthMiss};
use super::earlier::Earlier;
use super::env_rows::EnvRows;
use super::error::CameraError;
use super::extrinsics::CameraConvention;
use super::faults::Faults;
use super::frustum::frustum;
use super::memory::{Memory, Past};
use super::opening::Opening;
use super::placement::{CameraPlacement, PlaceRows, PoseFrame};
use super::viewpoints::Viewpoints;
use crate::error::SensorError;
use crate::requires::Requires;
use crate::schedule::{Phases, Schedule};
use crate::sensor::{Sensor, SensorContext};
use crate::summary;
use kinetoscope_render::frame::{Channels, Listed, PictureView, Pictures};
use kinetoscope_render::intrinsics::{Intrinsics, PixelIntrinsics};
use kinetoscope_render::lens;
use kinetoscope_render::lens::{LensRays, Optics};
use kinetoscope_render::parallel::{Job, ParallelRasterizer};
use kinetoscope_render::progress::RenderProgress;
use kinetoscope_render::request::RasterCfg;
use kinetoscope_render::shutter::Take;
use kinetoscope_render::ticket::Ticket;
use kinetoscope_render::visibility::{RenderError, View};
use kinetoscope_scene::pose::to_row;
use kinetoscope_scene::{Marker, Pose, PoseF32, RenderScene, SceneState, VisibleState};
use ndarray::{Array1, Array2, Array3, ArrayView1};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// A camera in each of several environments.
///
/// When a picture is due, the camera *captures*: it keeps where everything is. Pictures are drawn from that at the first
/// reading afterwards, once, and only where something changed ([`CameraCfg::lazy`]). So a reading always shows the instant
/// of [`stamps`](Self::stamps), however late it comes. After a setter of [`CameraPlacement`] the next reading shows the same
/// instant from the new place. Places and lenses set that way stay over a reset, until
/// [`restore`](CameraPlacement::restore).
///
/// A camera is perfect unless it is told otherwise: it may have a [`history`](Self::history), pictures may come late or get
/// lost, and be noisy or spoilt as those of real cameras ([`CameraCfg::imperfections`]). Then it is lazy still, and
/// shows the same bits: each capture is kept until it arrives, or until somebody looks. Setters act on what is shown and on
/// what is on its way; the history stays as it was seen.
///
/// Views that were read borrow the camera: nothing draws over them. The first axis of everything is the camera's own
/// environments, [`env_ids`](Self::env_ids); the frame is that of the environment, units are metres. An environment whose
/// state cannot be drawn (a pose that is not finite) makes reading an error, until it was captured anew.
pub struct Camera {
    lens: Lens,
    scene: Arc<RenderScene>,
    num_bodies: usize,
    path: String,
    pub(super) viewpoints: Viewpoints,
    channels: Channels,
    /// Whether the markers of other sensors are drawn into colours.
    draws_markers: bool,
    depth_miss: DepthMiss,
    lazy: bool,
    phases: Phases,
    /// Physics step \[s\].
    dt: f64,
    captures: Captures,
    /// Those of the newest captures.
    tickets: Vec<Ticket>,
    /// What is late, and what was; `None` for a camera that has none of it.
    memory: Option<Box<Memory>>,
    /// Where flow is measured.
    earlier: Option<Earlier>,
    /// Where the shutter takes time.
    opening: Option<Opening>,
    progress: RenderProgress,
    frame_counts: Array1<u64>,
    /// Rows that are due, between updates without meaning: its memory is kept.
    due: Vec<usize>,
    /// The pictures of what was captured, once somebody looked.
    drawn: OnceLock<Canvas>,
    /// Who draws: one reader at a time.
    turn: Mutex<()>,
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
    takes: Vec<Take<'static>>,
    tickets: Vec<Ticket>,
    /// What happens to pictures after they were drawn.
    faults: Option<Faults>,
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
        due.extend((0..self.viewpoints.len()).filter(|&row| self.phases.is_due(row, state.step[self.env_ids()[row]])));
        for &row in &due {
            self.tickets[row].due();
        }
        match self.memory.take() {
            None => {
                for &row in &due {
                    self.frame_counts[row] += 1;
                }
                self.keep_earlier(&due);
                self.capture(&due, state, true);
                self.close_shutters(&due);
            }
            Some(mut memory) => {
                self.send(&due, state, &mut memory);
                self.close_shutters(&due);
                due.clear();
                self.receive(state, &mut memory, &mut due);
                self.memory = Some(memory);
                self.draw_if_eager();
            }
        }
        self.open_shutters(0..self.viewpoints.len(), state);
        self.due = due;
        Ok(())
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.check(state)?;
        let rows = self.viewpoints.envs.seen(env_ids)?;
        for &row in &rows {
            self.phases.reset(row, state.step[self.env_ids()[row]]);
            self.frame_counts[row] = 0;
            self.tickets[row].reset();
            if let Some(memory) = &mut self.memory {
                memory.reset(row);
            }
            self.earlier.iter_mut().for_each(|earlier| earlier.forget(row));
        }
        self.close_shutters(&rows);
        self.capture(&rows, state, false);
        self.open_shutters(rows.into_iter(), state);
        Ok(())
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.check(state)?;
        let rows = self.viewpoints.envs.seen(env_ids)?;
        for &row in &rows {
            self.tickets[row].refresh();
        }
        self.capture(&rows, state, false);
        for &row in &rows {
            let (now, parent) = ((state, self.env_ids()[row]), self.viewpoints.parent);
            self.opening.iter_mut().for_each(|opening| opening.refresh(row, now, parent));
        }
        Ok(())
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        let steps = || self.env_ids().iter().map(|&env| step[env]);
        let wait = |due: u64| self.opening.as_ref().map_or(due, |opening| opening.wait(due));
        let due = self.phases.first_of(steps(), wait);
        self.memory.as_ref().and_then(|memory| memory.due_in(steps())).map_or(due, |arrival| arrival.min(due))
    }

    /// The optical frame, and an arrow along each edge of the picture's pyramid, at the captured instant; none in an
    /// environment that it does not look into.
    fn markers(&self, env: usize, _pose: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let row = self.viewpoints.envs.of(env);
        let placed = row.and_then(|row| Some((self.world_from_camera(row)?, self.optics_of(row)?)));
        placed.map_or_else(Vec::new, |(pose, optics)| frustum(&pose, &optics, self.image_shape()))
    }
}

impl PlaceRows for Camera {
    fn env_rows(&self) -> &EnvRows {
        &self.viewpoints.envs
    }

    fn place_rows(&mut self, rows: &[usize], poses: &[Pose], frame: PoseFrame) -> Result<(), SensorError> {
        let parents = &self.captures.world_from_parent;
        self.viewpoints.place(rows, poses, frame, |row| parents[row])?;
        self.outdate(rows);
        Ok(())
    }

    fn restore_rows(&mut self, rows: &[usize]) {
        self.viewpoints.restore(rows);
        self.outdate(rows);
    }
}

impl CameraPlacement for Camera {
    fn local_pose(&self, convention: CameraConvention) -> Array2<f64> {
        self.viewpoints.local_pose(convention)
    }

    fn set_intrinsics(&mut self, intrinsics: &[Intrinsics], env_ids: Option<&[usize]>) -> Result<(), SensorError> {
        let rows = self.viewpoints.envs.chosen(env_ids)?;
        let lens = self.lens;
        self.viewpoints.set_intrinsics(&rows, intrinsics, |pixels| {
            lens.view(pixels, PoseF32::IDENTITY).validate().map_err(CameraError::View)
        })?;
        self.outdate(&rows);
        Ok(())
    }
}

impl Camera {
    pub(super) fn requires(attached: bool, draws_markers: bool) -> Requires {
        let part = |wanted: bool, field| if wanted { field } else { Requires::NONE };
        Requires::VISIBLE | part(attached, Requires::POSES) | part(draws_markers, Requires::MARKERS)
    }

    #[allow(clippy::too_many_arguments, reason = "the parts that the configuration has checked, in one place")]
    pub(super) fn new(
        cfg: &CameraCfg,
        context: &SensorContext,
        scene: Arc<RenderScene>,
        (schedule, opening): (Schedule, Option<Opening>),
        lens: Lens,
        viewpoints: Viewpoints,
        (pictures, faults): (Pictures, Option<Faults>),
    ) -> Self {
        let env_ids = viewpoints.envs.env_ids();
        let rows = env_ids.len();
        let key = |env: &usize| Ticket::first(context.seed, (context.first_env + env) as u64, &context.name);
        let tickets: Vec<Ticket> = env_ids.iter().map(key).collect();
        let memory = Memory::new(cfg, schedule, rows, &scene, (*viewpoints.row(0), tickets[0]));
        let captures = Captures::new(rows, &scene, tickets[0], opening.is_some());
        let earlier = cfg.channels.flow.then(|| Earlier::new(rows, scene.instances().len()));
        let marked = u32::from(cfg.draw_markers) << Marker::GROUP;
        let raster = RasterCfg { groups: cfg.raster.groups | marked, ..cfg.raster };
        let mut rasterizer = ParallelRasterizer::new(raster, context.threads).with_pool(context.pool.clone());
        rasterizer.set_renderer(cfg.renderer);
        rasterizer.set_light(cfg.aperture, cfg.shutter);
        rasterizer.set_stops(cfg.imperfections.exposure.map_or(0.0, |exposure| exposure.stops));
        let progress = rasterizer.progress().clone();
        rasterizer.share_assets(&context.ray_assets);
        let canvas = Some(Canvas::new(pictures, rows));
        Self {
            lens,
            scene,
            num_bodies: context.bodies.len(),
            path: summary::path(context, viewpoints.parent),
            viewpoints,
            channels: cfg.channels,
            draws_markers: cfg.draw_markers,
            depth_miss: cfg.depth_miss,
            lazy: cfg.lazy,
            phases: schedule.phases(rows),
            dt: context.dt,
            captures,
            tickets,
            memory,
            earlier,
            opening,
            progress,
            frame_counts: Array1::zeros(rows),
            due: Vec::with_capacity(rows),
            drawn: OnceLock::new(),
            turn: Mutex::new(()),
            desk: Mutex::new(Desk {
                rasterizer,
                canvas,
                views: Vec::new(),
                jobs: Vec::new(),
                takes: Vec::new(),
                tickets: Vec::new(),
                faults,
            }),
            draws: AtomicU64::new(0),
        }
    }

    /// The environments that it looks into: the first axis of everything it measures.
    pub fn env_ids(&self) -> &[usize] {
        self.viewpoints.envs.env_ids()
    }

    /// Path: `uid/link/name` on a body, the camera's name without one.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// What it measures.
    pub fn channels(&self) -> Channels {
        self.channels
    }

    /// When it measures.
    pub fn schedule(&self) -> Schedule {
        self.phases.schedule()
    }

    /// Time between images \[s\].
    pub fn update_period(&self) -> f64 {
        self.schedule().period_steps() as f64 * self.dt
    }

    /// Rows and pixels per row: (H, W).
    pub fn image_shape(&self) -> (usize, usize) {
        (self.lens.height, self.lens.width)
    }

    /// Whether it hangs on a body.
    pub fn is_attached(&self) -> bool {
        self.viewpoints.parent.is_some()
    }

    /// Time of the instant that pictures show \[s\] since the last reset of the environment, shape (N).
    pub fn stamps(&self) -> ArrayView1<'_, f64> {
        self.captures.stamps.view()
    }

    /// Pictures since the last reset, shape (N): those that were due and have arrived, whether somebody looked or not. The
    /// refresh of a reset is none.
    pub fn frame_counts(&self) -> ArrayView1<'_, u64> {
        self.frame_counts.view()
    }

    /// How many pictures were drawn since the camera was built, each environment counted: a measure of work.
    pub fn draws(&self) -> u64 {
        self.draws.load(Ordering::Relaxed)
    }

    /// How far the drawing of pictures by path tracing is, and a way to break it off from another thread. A reading that was
    /// broken off is [`CameraError::Draw`] with [`RenderError::Cancelled`]; the next one draws again.
    pub fn progress(&self) -> &RenderProgress {
        &self.progress
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
        (0..self.viewpoints.len()).try_for_each(|row| self.must_have_captured(row))?;
        let canvas = match self.drawn.get() {
            Some(canvas) => canvas,
            None => {
                // One reader draws, the others wait.
                let _turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
                match self.drawn.get() {
                    Some(canvas) => canvas,
                    None => self.keep_drawn(self.draw())?,
                }
            }
        };
        match &canvas.failure {
            Some(failure) => Err(failure.clone().into()),
            None => Ok(&canvas.pictures),
        }
    }

    /// Keeps what was drawn for the next readers, except what was broken off: they draw it again.
    fn keep_drawn(&self, canvas: Canvas) -> Result<&Canvas, CameraError> {
        match &canvas.failure {
            Some(failure) if failure.is_cancelled() => {
                let failure = failure.clone();
                self.desk.lock().unwrap_or_else(PoisonError::into_inner).canvas = Some(canvas);
                Err(failure)
            }
            _ => Ok(self.drawn.get_or_init(|| canvas)),
        }
    }

    /// Intrinsic matrices `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]` \[pixels\], shape (N, 3, 3).
    pub fn intrinsic_matrices(&self) -> Array3<f64> {
        Array3::from_shape_fn((self.viewpoints.len(), 3, 3), |(row, i, j)| {
            self.viewpoints.row(row).pixels.matrix()[(i, j)]
        })
    }

    /// The lens, the same in all environments.
    pub fn lens(&self) -> lens::Lens {
        self.viewpoints.lens()
    }

    /// The lens of environment `env` in front of its pixels: from directions to pixels and back.
    ///
    /// # Errors
    ///
    /// An environment that the camera does not see.
    pub fn optics(&self, env: usize) -> Result<Optics, SensorError> {
        let pixels = self.viewpoints.row(self.row(env)?).pixels;
        Ok(Optics::new(self.viewpoints.lens(), pixels)?)
    }

    /// Whether its colours show what other sensors show of their measurements.
    pub fn draws_markers(&self) -> bool {
        self.draws_markers
    }

    /// Memory of the rays of a lens \[bytes\]: 0 for a pinhole.
    pub fn lens_bytes(&self) -> usize {
        self.viewpoints.ray_bytes()
    }

    /// Poses in the environment at the captured instant, rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7). NaN where an
    /// attached camera has captured nothing yet.
    pub fn pose_w(&self, convention: CameraConvention) -> Array2<f64> {
        let pose = |row| self.world_from_camera(row).map(|pose| to_row(&convention.of_optical(&pose)));
        Array2::from(
            (0..self.viewpoints.len()).map(|row| pose(row).unwrap_or([f64::NAN; 7])).collect::<Vec<[f64; 7]>>(),
        )
    }

    /// The view of environment `env` at the captured instant: what a renderer draws.
    ///
    /// # Errors
    ///
    /// An environment that the camera does not see, [`CameraError::NothingCaptured`].
    pub fn view(&self, env: usize) -> Result<View, SensorError> {
        let row = self.row(env)?;
        let pose = self.world_from_camera(row).ok_or(CameraError::NothingCaptured { env })?;
        Ok(self.lens.view(&self.viewpoints.row(row).pixels, PoseF32::from(&pose)))
    }

    /// The row of an environment.
    pub(super) fn row(&self, env: usize) -> Result<usize, SensorError> {
        self.viewpoints.envs.row(env)
    }

    /// Whether a number of the depth channel is that of a surface.
    pub(super) fn is_hit(&self, depth: f32) -> bool {
        match self.depth_miss {
            DepthMiss::Inf => depth.is_finite(),
            DepthMiss::Far => depth < self.lens.far,
            DepthMiss::Zero => depth > 0.0,
        }
    }

    /// Whether straight lines are bent in the picture.
    pub(super) fn bends_lines(&self) -> bool {
        !self.viewpoints.lens().is_pinhole()
    }

    /// Refuses what is only known of pictures without a lens.
    pub(super) fn must_be_pinhole(&self, what: &'static str) -> Result<(), CameraError> {
        let lens = self.viewpoints.lens();
        if lens.is_pinhole() { Ok(()) } else { Err(CameraError::PinholeOnly { what, lens: lens.name() }) }
    }

    /// The lens of a row, in front of its pixels.
    fn optics_of(&self, row: usize) -> Option<Optics> {
        match self.rays_of(row) {
            Some(rays) => Some(*rays.optics()),
            None => Optics::new(lens::Lens::default(), self.viewpoints.row(row).pixels).ok(),
        }
    }

    /// The rays of a row; none for a pinhole.
    pub(super) fn rays_of(&self, row: usize) -> Option<&LensRays> {
        self.viewpoints.rays(row).map(|rays| &**rays)
    }

    /// Where the optical frame is at the captured instant.
    pub(super) fn world_from_camera(&self, row: usize) -> Option<Pose> {
        self.viewpoints.world_from(self.viewpoints.row(row), self.captures.world_from_parent[row])
    }

    /// The history, of a camera that has a memory.
    pub(super) fn past(&self) -> Option<&Past> {
        self.memory.as_ref().map(|memory| &memory.past)
    }

    /// Whether the state is of the scene that the camera was built for.
    fn check(&self, state: &SceneState) -> Result<(), SensorError> {
        let missing = Self::requires(self.is_attached(), self.draws_markers).without(Requires::present_in(state));
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
        let of_markers = state.markers.as_ref().filter(|_| self.draws_markers);
        let of_markers = of_markers.map(|markers| ("environments with markers", envs, markers.len()));
        let all = counts.into_iter().chain(of_bodies.into_iter().flatten()).chain(of_markers);
        match all.into_iter().find(|(_, expected, found)| expected != found) {
            Some((what, expected, found)) => Err(SensorError::WrongShape { what, expected, found }),
            None => Ok(()),
        }
    }

    /// Closes the shutters of some rows.
    fn close_shutters(&mut self, rows: &[usize]) {
        if let Some(opening) = &mut self.opening {
            rows.iter().for_each(|&row| opening.close(row));
        }
    }

    /// Opens the shutters of those of some rows whose time it is.
    fn open_shutters(&mut self, rows: impl Iterator<Item = usize>, state: &SceneState) {
        let Self { opening, phases, viewpoints, .. } = self;
        if let Some(opening) = opening {
            opening.open(rows, phases, (state, viewpoints.envs.env_ids()), viewpoints.parent);
        }
    }

    /// What some rows show now is what the pictures before showed, from now on.
    fn keep_earlier(&mut self, rows: &[usize]) {
        let Self { earlier, captures, .. } = self;
        if let Some(earlier) = earlier {
            rows.iter().for_each(|&row| earlier.keep(row, &captures.poses));
        }
    }

    /// Shows what there is to see in some environments, and with `opened` what there was since the shutter opened; the state
    /// was checked.
    fn capture(&mut self, rows: &[usize], state: &SceneState, opened: bool) {
        for &row in rows {
            let env = self.env_ids()[row];
            let opening = self.opening.as_ref().filter(|_| opened).map(|opening| (opening, row));
            self.captures.keep(row, (state, env), self.viewpoints.parent, self.tickets[row], opening);
            if let Some(memory) = &mut self.memory {
                memory.refresh(row, state.step[env]);
            }
            let view = self.view_of(row);
            self.earlier.iter_mut().for_each(|earlier| earlier.capture(row, view));
        }
        self.outdate(rows);
        self.draw_if_eager();
    }

    /// Keeps what there is to see in some environments for later.
    fn send(&mut self, rows: &[usize], state: &SceneState, memory: &mut Memory) {
        for &row in rows {
            let (env, ticket) = (self.env_ids()[row], self.tickets[row]);
            if let Some(slot) = memory.send(row, state.step[env], &ticket) {
                let opening = self.opening.as_ref().map(|opening| (opening, row));
                memory.waiting.keep(slot, (state, env), self.viewpoints.parent, ticket, opening);
            }
        }
    }

    /// Takes what has arrived; `shown` become the rows that show something else.
    fn receive(&mut self, state: &SceneState, memory: &mut Memory, shown: &mut Vec<usize>) {
        for row in 0..self.viewpoints.len() {
            let mut shows = None;
            while let Some((slot, show)) = memory.receive(row, state.step[self.env_ids()[row]]) {
                memory.remember(row, slot, (self.viewpoints.row(row), self.viewpoints.rays(row)));
                self.frame_counts[row] += 1;
                if show {
                    self.captures.copy(row, &memory.waiting, slot);
                }
                shows = Some(show);
            }
            if shows == Some(true) {
                shown.push(row);
            }
        }
        self.outdate(shown);
        shown.iter().for_each(|&row| memory.past.shown[row] = true);
    }

    fn draw_if_eager(&self) {
        if !self.lazy {
            // What is wrong is said to who reads.
            let _ = self.pictures();
            self.draw_history();
        }
    }

    /// The pictures of some rows are not those of the last capture any more.
    fn outdate(&mut self, rows: &[usize]) {
        if rows.is_empty() {
            return;
        }
        if let Some(memory) = &mut self.memory {
            rows.iter().for_each(|&row| memory.past.shown[row] = false);
        }
        let drawn = self.drawn.take();
        let desk = self.desk.get_mut().unwrap_or_else(PoisonError::into_inner);
        desk.canvas = drawn.or(desk.canvas.take());
        if let Some(canvas) = &mut desk.canvas {
            rows.iter().for_each(|&row| canvas.stale[row] = true);
        }
    }

    /// Fails before the first reset or update of a row, when poses of things are not known yet.
    pub(super) fn must_have_captured(&self, row: usize) -> Result<(), CameraError> {
        let captured = self.captures.world_from_parent[row].is_some();
        captured.then_some(()).ok_or(CameraError::NothingCaptured { env: self.env_ids()[row] })
    }

    /// The view of a row that was captured.
    pub(super) fn view_of(&self, row: usize) -> View {
        let pose = self.world_from_camera(row).unwrap_or_else(Pose::identity);
        self.lens.view(&self.viewpoints.row(row).pixels, PoseF32::from(&pose))
    }
}

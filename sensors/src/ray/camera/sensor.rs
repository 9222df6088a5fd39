//! The camera made of rays as a sensor.

use super::cfg::RayCasterCameraCfg;
use super::pictures::RayPictures;
use super::pixels::Pixels;
use crate::camera::env_rows::EnvRows;
use crate::camera::frustum::frustum;
use crate::camera::placement::{CameraPlacement, PlaceRows, PoseFrame};
use crate::camera::viewpoints::Viewpoints;
use crate::camera::{CameraConvention, DepthMiss, Intrinsics, Lens, Optics, PixelIntrinsics};
use crate::error::SensorError;
use crate::expected::Expected;
use crate::ray::scan::Scan;
use crate::sampling::{Sampled, Sampler};
use crate::schedule::Phases;
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use crate::summary;
use kinetoscope_scene::pose::{from_row, to_row};
use kinetoscope_scene::{Marker, Pose, PoseF64, SceneState};
use ndarray::{Array2, Array3, Array4, ArrayView1, ArrayView3, ArrayView4, Axis};
use std::borrow::Cow;
use std::fmt;

/// A camera in every environment that casts one ray per pixel; [`Sampled`] has the stamps and counts of its pictures.
///
/// Pictures are made when they are due. The first axis is the environment; the frame is that of the environment, units are
/// metres. Nothing is ever NaN.
///
/// What is measured is the distance along the ray of each pixel: noise of the channel `distances` is added to it, and depth
/// and points follow, so that all three stay on the ray. Noisy distances are from 0 to the largest that rays reach, and
/// misses stay misses. Normals, masks, poses and lenses are exact.
///
/// Setters of [`CameraPlacement`] act from the next picture on. Poses, intrinsics and points that are read are those of the pictures that are read, however
/// late these come.
#[derive(Clone, Debug)]
pub struct RayCasterCamera {
    path: String,
    pub(super) viewpoints: Viewpoints,
    /// What depth and distance say of a miss.
    miss: f32,
    scan: Scan<Pixels>,
    sampler: Sampler,
    /// The sampler's own, to know before it asks which environments are due.
    phases: Phases,
    pub(super) expected: Expected,
    due: Vec<usize>,
    /// Where the parents were when rays were cast last; `None` before.
    pub(super) world_from_parent: Vec<Option<Pose>>,
    /// From where, and through which lens, rays were cast last.
    taken: Vec<Taken>,
    shown: Shown,
}

/// From where a picture is taken, and through which lens.
#[derive(Clone, Copy, Debug)]
pub(super) struct Taken {
    pub(super) world_from_camera: Pose,
    pub(super) lens: PixelIntrinsics,
}

/// Channels of the sampler that pictures are made of.
const CHANNELS: [&str; 5] = ["distances", "normals", "ids", "poses", "lenses"];

/// The pictures of the current values.
#[derive(Clone, Debug)]
struct Shown {
    /// Measurements that they were made of.
    counts: Vec<u64>,
    pictures: RayPictures,
}

/// A summary of several lines.
impl fmt::Display for RayCasterCamera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (height, width) = self.image_shape();
        let targets = self.scan.targets();
        let targets = format!("{} ({} of them fixed)", targets.len(), targets.fixed_count());
        summary::write(
            f,
            "Ray-caster camera",
            &self.path,
            &[
                ("update period (s)", &self.sampler.period()),
                ("shape", &format!("({height}, {width})")),
                ("number of targets", &targets),
                ("number of sensors", &self.sampler.num_envs()),
            ],
        )
    }
}

impl RayCasterCamera {
    pub(super) fn new(
        cfg: &RayCasterCameraCfg,
        context: &SensorContext,
        viewpoints: Viewpoints,
        scan: Scan<Pixels>,
        phases: Phases,
        sampler: Sampler,
    ) -> Self {
        let n = context.num_envs;
        let shape = (n, cfg.height, cfg.width);
        let miss = match cfg.depth_miss {
            DepthMiss::Inf => f32::INFINITY,
            DepthMiss::Far => cfg.max_distance as f32,
            DepthMiss::Zero => 0.0,
        };
        let viewpoint = |env| {
            let viewpoint = viewpoints.row(env);
            Taken { world_from_camera: viewpoint.parent_from_camera, lens: viewpoint.pixels }
        };
        let taken: Vec<Taken> = (0..n).map(viewpoint).collect();
        Self {
            path: summary::path(context, viewpoints.parent),
            viewpoints,
            miss,
            scan,
            sampler,
            phases,
            expected: Expected::new("ray caster camera", cfg.requires(), context),
            due: Vec::with_capacity(n),
            world_from_parent: vec![None; n],
            shown: Shown {
                counts: vec![0; n],
                pictures: RayPictures {
                    taken: taken.clone(),
                    depth: Array3::from_elem(shape, miss),
                    distance: Array3::from_elem(shape, miss),
                    normal: Array4::zeros((n, cfg.height, cfg.width, 3)),
                    mask: Array3::zeros(shape),
                },
            },
            taken,
        }
    }

    /// Casts the rays of some environments; `state` was checked.
    fn cast(&mut self, envs: &[usize], state: &SceneState) {
        let Some(poses) = &state.instance_poses else { return };
        let Self { viewpoints, scan, world_from_parent, taken, .. } = self;
        let parent = viewpoints.parent.zip(state.body_poses.as_ref());
        scan.cast(envs, poses, |env| {
            let viewpoint = viewpoints.row(env);
            let parent = parent.map(|(body, poses)| from_row(&std::array::from_fn(|k| poses[(env, body, k)])));
            let world_from_camera =
                parent.map_or(viewpoint.parent_from_camera, |pose| pose * viewpoint.parent_from_camera);
            world_from_parent[env] = parent;
            taken[env] = Taken { world_from_camera, lens: viewpoint.pixels };
            (PoseF64::from(&world_from_camera), viewpoint.pixels)
        });
    }

    /// The same, after somebody may have moved what does not move by itself.
    fn cast_anew(&mut self, envs: &[usize], state: &SceneState) {
        let Some(poses) = &state.instance_poses else { return };
        envs.iter().for_each(|&env| self.scan.settle(env, poses, state.own_scene(env)));
        self.cast(envs, state);
    }

    /// The sampler, and what was cast last.
    fn sampled(&mut self) -> (&mut Sampler, Cast<'_>) {
        let Self { sampler, scan, taken, .. } = self;
        (sampler, Cast { scan, taken })
    }

    /// Makes the pictures of the current values of an environment.
    fn show(&mut self, env: usize) {
        let count = self.sample_counts()[env];
        let Self { sampler, scan, shown, miss, .. } = self;
        shown.counts[env] = count;
        shown.pictures.develop(env, CHANNELS.map(|channel| sampler.values(channel)), scan.rays(), *miss);
    }

    /// The pictures of the measurement that arrived last, in all environments; made when asked. They are what the camera shows,
    /// except with a latency after somebody wrote to the state: what was on its way then arrives, and is not shown.
    pub fn arrived(&self) -> Cow<'_, RayPictures> {
        if !self.sampler.is_late() {
            return Cow::Borrowed(&self.shown.pictures);
        }
        let mut pictures = self.shown.pictures.clone();
        for env in 0..pictures.taken.len() {
            let values = CHANNELS.map(|channel| self.sampler.arrived(channel));
            pictures.develop(env, values, self.scan.rays(), self.miss);
        }
        Cow::Owned(pictures)
    }

    /// The pictures that it shows.
    pub fn pictures(&self) -> &RayPictures {
        &self.shown.pictures
    }

    /// Whether it hangs on a body.
    pub fn is_attached(&self) -> bool {
        self.viewpoints.parent.is_some()
    }

    /// Rows and pixels per row: (H, W).
    pub fn image_shape(&self) -> (usize, usize) {
        (self.scan.rays().height, self.scan.rays().width)
    }

    /// Distance along the optical axis, shape (N, H, W) \[m\]; for a miss what the configuration says.
    pub fn depth(&self) -> ArrayView3<'_, f32> {
        self.shown.pictures.depth.view()
    }

    /// Distance along the ray of the pixel, shape (N, H, W) \[m\]; for a miss what the configuration says.
    pub fn distance(&self) -> ArrayView3<'_, f32> {
        self.shown.pictures.distance.view()
    }

    /// Past distances along the rays, newest first, shape (N, history_length, H * W) \[m\]: +inf for a miss, 0 where not
    /// filled yet.
    pub fn distance_history(&self) -> ArrayView3<'_, f64> {
        self.sampler.history("distances")
    }

    /// Unit normals of faces, turned to the camera, in world axes, shape (N, H, W, 3); 0 for a miss.
    pub fn normal(&self) -> ArrayView4<'_, f32> {
        self.shown.pictures.normal.view()
    }

    /// Mask ids, shape (N, H, W); 0 for a miss.
    pub fn mask(&self) -> ArrayView3<'_, i32> {
        self.shown.pictures.mask.view()
    }

    /// Pictures that arrived since the last reset, shape (N); the refresh of a reset is none.
    pub fn frame_counts(&self) -> ArrayView1<'_, u64> {
        self.sample_counts()
    }

    /// Intrinsic matrices `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]` of the pictures \[pixels\], shape (N, 3, 3).
    pub fn intrinsic_matrices(&self) -> Array3<f64> {
        self.shown.pictures.intrinsic_matrices()
    }

    /// Poses in the environment at the instant of the pictures, rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7).
    pub fn pose_w(&self, convention: CameraConvention) -> Array2<f64> {
        self.shown.pictures.pose_w(convention)
    }

    /// From where the picture of an environment was taken, through which lens.
    pub(super) fn taken(&self, env: usize) -> &Taken {
        &self.shown.pictures.taken[env]
    }

    /// The depths of the pixels of an environment, row by row; `None` for a miss.
    pub(super) fn depths(&self, env: usize) -> impl Iterator<Item = Option<f32>> {
        let RayPictures { depth, mask, .. } = &self.shown.pictures;
        let (depth, mask) = (depth.index_axis(Axis(0), env), mask.index_axis(Axis(0), env));
        depth.into_iter().zip(mask).map(|(depth, id)| (*id != 0).then_some(*depth))
    }
}

/// Acts from the next image on.
impl PlaceRows for RayCasterCamera {
    fn env_rows(&self) -> &EnvRows {
        &self.viewpoints.envs
    }

    fn place_rows(&mut self, rows: &[usize], poses: &[Pose], frame: PoseFrame) -> Result<(), SensorError> {
        let parents = &self.world_from_parent;
        Ok(self.viewpoints.place(rows, poses, frame, |row| parents[row])?)
    }

    fn restore_rows(&mut self, rows: &[usize]) {
        self.viewpoints.restore(rows);
    }
}

impl CameraPlacement for RayCasterCamera {
    fn local_pose(&self, convention: CameraConvention) -> Array2<f64> {
        self.viewpoints.local_pose(convention)
    }

    fn set_intrinsics(&mut self, intrinsics: &[Intrinsics], env_ids: Option<&[usize]>) -> Result<(), SensorError> {
        let rows = self.viewpoints.envs.chosen(env_ids)?;
        Ok(self.viewpoints.set_intrinsics(&rows, intrinsics, |_| Ok(()))?)
    }
}

/// What was cast, for the sampler.
struct Cast<'a> {
    scan: &'a Scan<Pixels>,
    taken: &'a [Taken],
}

impl Cast<'_> {
    /// Writes the values of an environment that was cast to a row of the sampler.
    fn write(&self, env: usize, row: &mut [f64]) {
        let pixels = self.scan.rays().width * self.scan.rays().height;
        let (distances, row) = row.split_at_mut(pixels);
        let (normals, row) = row.split_at_mut(3 * pixels);
        let (ids, row) = row.split_at_mut(pixels);
        self.scan.each_hit(env, |k, hit| {
            distances[k] = hit.distance;
            normals[3 * k..3 * k + 3].copy_from_slice(&hit.normal);
            ids[k] = hit.mask_id.into();
        });
        let (pose, lens) = row.split_at_mut(7);
        let Taken { world_from_camera, lens: PixelIntrinsics { fx, fy, cx, cy } } = self.taken[env];
        pose.copy_from_slice(&to_row(&world_from_camera));
        lens.copy_from_slice(&[fx, fy, cx, cy]);
    }
}

impl Sensor for RayCasterCamera {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.expected.check(state)?;
        let mut due = std::mem::take(&mut self.due);
        due.clear();
        due.extend((0..state.num_envs()).filter(|&env| self.phases.is_due(env, state.step[env])));
        self.cast(&due, state);
        self.due = due;
        let (sampler, cast) = self.sampled();
        sampler.update(state, |env, row| cast.write(env, row))?;
        for env in 0..state.num_envs() {
            if self.sample_counts()[env] != self.shown.counts[env] {
                self.show(env);
            }
        }
        Ok(())
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.expected.check(state)?;
        self.expected.check_envs(env_ids)?;
        for &env in env_ids {
            self.phases.reset(env, state.step[env]);
        }
        self.cast_anew(env_ids, state);
        let (sampler, cast) = self.sampled();
        sampler.reset(env_ids, state, |env, row| cast.write(env, row))?;
        env_ids.iter().for_each(|&env| self.show(env));
        Ok(())
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.expected.check(state)?;
        self.expected.check_envs(env_ids)?;
        self.cast_anew(env_ids, state);
        let (sampler, cast) = self.sampled();
        sampler.refresh(env_ids, state, |env, row| cast.write(env, row))?;
        env_ids.iter().for_each(|&env| self.show(env));
        Ok(())
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.sampler.due_in(step)
    }

    fn sampled(&self) -> Option<&dyn Sampled> {
        Some(self)
    }

    /// The optical frame, and an arrow along each edge of the picture's pyramid, when the picture was taken.
    fn markers(&self, env: usize, _pose: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let taken = self.shown.pictures.taken.get(env);
        let placed = taken.and_then(|taken| Some((taken, Optics::new(Lens::default(), taken.lens).ok()?)));
        placed.map_or_else(Vec::new, |(taken, optics)| frustum(&taken.world_from_camera, &optics, self.image_shape()))
    }
}

impl Sampled for RayCasterCamera {
    fn sampler(&self) -> &Sampler {
        &self.sampler
    }
}

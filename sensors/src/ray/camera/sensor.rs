//! Ray-caster camera sensor.

use super::cfg::RayCasterCameraCfg;
use super::images::RayImages;
use super::pixels::Pixels;
use crate::camera::env_rows::EnvRows;
use crate::camera::frustum::frustum;
use crate::camera::placement::{CameraPlacement, PlaceRows, PoseFrame};
use crate::camera::viewpoints::{Viewpoint, Viewpoints};
use crate::camera::{CameraConvention, DepthMiss};
use crate::error::SensorError;
use crate::ray::sampler::{RayModel, RaySampler};
use crate::sampling::{Sampled, Sampler};
use crate::sensor::{Sensor, SensorContext};
use crate::summary;
use kinetoscope_render::lens::{Lens, Optics};
use kinetoscope_render::{Intrinsics, PixelIntrinsics};
use kinetoscope_scene::pose::{from_row, to_row};
use kinetoscope_scene::{Marker, Pose, PoseF64, SceneState};
use ndarray::{Array2, Array3, Array4, ArrayView1, ArrayView3, ArrayView4, Axis};
use std::borrow::Cow;
use std::fmt;

/// A camera in every environment that casts one ray per pixel; [`Sampled`] gives the stamps and counts of its images.
///
/// Images are measured when they are due. The first axis of all arrays is the environment. Poses are in the frame of
/// the environment, lengths in meters. No value is NaN after the first measurement or reset.
///
/// The measured quantity is the distance along the ray of each pixel. Noise of the channel `distances` is added to it,
/// and depth and points follow, so all three stay on the ray. Noisy distances are from 0 to the largest distance of the
/// rays, and misses stay misses. Normals, masks, poses and intrinsics are exact.
///
/// Setters of [`CameraPlacement`] take effect with the next image, which may be that of a reset or of a write to the
/// state. Poses, intrinsics and points belong to the shown images, whatever their latency.
#[derive(Clone, Debug)]
pub struct RayCasterCamera {
    path: String,
    rays: RaySampler<Pixels>,
    model: ImageModel,
}

/// Viewpoints of the rays, and the current images.
#[derive(Clone, Debug)]
struct ImageModel {
    viewpoints: Viewpoints,
    /// Poses of the parents at the last ray cast; `None` before.
    world_from_parent: Vec<Option<Pose>>,
    /// Depth and distance of a miss.
    miss: f32,
    images: RayImages,
}

/// Camera pose and intrinsics of an image.
#[derive(Clone, Copy, Debug)]
pub(super) struct ImageViewpoint {
    pub(super) world_from_camera: Pose,
    pub(super) intrinsics: PixelIntrinsics,
}

/// Sampler channels from which images are computed.
const CHANNELS: [&str; 5] = ["distances", "normals", "ids", "poses", "lenses"];

impl RayModel for ImageModel {
    type Rays = Pixels;

    fn frame(&mut self, env: usize, parent: Option<[f64; 7]>, values: &mut [f64]) -> (PoseF64, PixelIntrinsics) {
        let Viewpoint { parent_from_camera, pixels } = *self.viewpoints.row(env);
        let parent = parent.map(|row| from_row(&row));
        let world_from_camera = parent.map_or(parent_from_camera, |pose| pose * parent_from_camera);
        self.world_from_parent[env] = parent;
        let (pose, lens) = values.split_at_mut(7);
        pose.copy_from_slice(&to_row(&world_from_camera));
        lens.copy_from_slice(&[pixels.fx, pixels.fy, pixels.cx, pixels.cy]);
        (PoseF64::from(&world_from_camera), pixels)
    }

    fn update_outputs(&mut self, env: usize, sampler: &Sampler, rays: &Pixels) {
        self.images.compute(env, CHANNELS.map(|channel| sampler.values(channel)), rays, self.miss);
    }
}

/// Writes a summary of several lines.
impl fmt::Display for RayCasterCamera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (height, width) = self.image_shape();
        let targets = self.rays.targets();
        let targets = format!("{} ({} of them fixed)", targets.len(), targets.fixed_count());
        summary::write(
            f,
            "Ray-caster camera",
            &self.path,
            &[
                ("update period (s)", &self.sampler().period()),
                ("shape", &format!("({height}, {width})")),
                ("number of targets", &targets),
                ("number of sensors", &self.sampler().num_envs()),
            ],
        )
    }
}

impl RayCasterCamera {
    pub(super) fn new(
        cfg: &RayCasterCameraCfg,
        context: &SensorContext,
        rays: RaySampler<Pixels>,
        viewpoints: Viewpoints,
    ) -> Self {
        let n = context.num_envs;
        let shape = (n, cfg.height, cfg.width);
        let miss = match cfg.depth_miss {
            DepthMiss::Inf => f32::INFINITY,
            DepthMiss::Far => cfg.max_distance as f32,
            DepthMiss::Zero => 0.0,
        };
        let taken = |env| {
            let viewpoint = viewpoints.row(env);
            ImageViewpoint { world_from_camera: viewpoint.parent_from_camera, intrinsics: viewpoint.pixels }
        };
        let images = RayImages {
            viewpoints: (0..n).map(taken).collect(),
            depth: Array3::from_elem(shape, miss),
            distance: Array3::from_elem(shape, miss),
            normal: Array4::zeros((n, cfg.height, cfg.width, 3)),
            mask: Array3::zeros(shape),
        };
        let path = summary::path(context, viewpoints.parent);
        Self { path, rays, model: ImageModel { viewpoints, world_from_parent: vec![None; n], miss, images } }
    }

    /// Images of the latest delivered measurement, in all environments. They equal the shown images, except with a
    /// latency after a write to the state: images in flight are then delivered but not shown. With a latency, they are
    /// computed at every call.
    pub fn latest_delivered(&self) -> Cow<'_, RayImages> {
        if !self.sampler().has_latency() {
            return Cow::Borrowed(&self.model.images);
        }
        let mut images = self.model.images.clone();
        for env in 0..images.viewpoints.len() {
            let values = CHANNELS.map(|channel| self.sampler().latest_delivered(channel));
            images.compute(env, values, self.rays.rays(), self.model.miss);
        }
        Cow::Owned(images)
    }

    /// Shown images, in all environments: those that the methods of this sensor return.
    pub fn images(&self) -> &RayImages {
        &self.model.images
    }

    /// True if the camera is attached to a body.
    pub fn is_attached(&self) -> bool {
        self.model.viewpoints.parent.is_some()
    }

    /// Image shape (height, width) \[pixels\].
    pub fn image_shape(&self) -> (usize, usize) {
        (self.rays.rays().height, self.rays.rays().width)
    }

    /// Depth along the optical axis, shape (N, H, W) \[m\]; misses have the configured value.
    pub fn depth(&self) -> ArrayView3<'_, f32> {
        self.model.images.depth.view()
    }

    /// Distance along the ray of the pixel, shape (N, H, W) \[m\]; misses have the configured value.
    pub fn distance(&self) -> ArrayView3<'_, f32> {
        self.model.images.distance.view()
    }

    /// History of the distances along the rays, newest first, shape (N, history_length, H * W) \[m\]: +inf for a miss,
    /// 0 where not filled yet.
    pub fn distance_history(&self) -> ArrayView3<'_, f64> {
        self.sampler().history("distances")
    }

    /// Unit normals of the hit surfaces, facing the camera, in world axes, shape (N, H, W, 3); 0 for a miss.
    pub fn normal(&self) -> ArrayView4<'_, f32> {
        self.model.images.normal.view()
    }

    /// Mask ids, shape (N, H, W); 0 for a miss.
    pub fn mask(&self) -> ArrayView3<'_, i32> {
        self.model.images.mask.view()
    }

    /// Number of images delivered since the last reset, shape (N); the images of a reset or of a write to the state do
    /// not count.
    pub fn frame_counts(&self) -> ArrayView1<'_, u64> {
        self.sample_counts()
    }

    /// Intrinsic matrices `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]` of the shown images \[pixels\], shape (N, 3, 3). The
    /// corner of the first pixel is at (0, 0). Intrinsics that were set after an image apply from the next image on.
    pub fn intrinsic_matrices(&self) -> Array3<f64> {
        self.model.images.intrinsic_matrices()
    }

    /// Camera poses in the environment at the instant of the shown images, rows `[x, y, z, qw, qx, qy, qz]` \[m\],
    /// shape (N, 7).
    pub fn pose_w(&self, convention: CameraConvention) -> Array2<f64> {
        self.model.images.pose_w(convention)
    }

    /// Returns the camera pose and intrinsics of the image of an environment.
    pub(super) fn viewpoint(&self, env: usize) -> &ImageViewpoint {
        &self.model.images.viewpoints[env]
    }

    /// Returns the depths of the pixels of an environment, row by row; `None` for a miss.
    pub(super) fn depths(&self, env: usize) -> impl Iterator<Item = Option<f32>> {
        let RayImages { depth, mask, .. } = &self.model.images;
        let (depth, mask) = (depth.index_axis(Axis(0), env), mask.index_axis(Axis(0), env));
        depth.into_iter().zip(mask).map(|(depth, id)| (*id != 0).then_some(*depth))
    }
}

/// Changes take effect with the next image.
impl PlaceRows for RayCasterCamera {
    fn env_rows(&self) -> &EnvRows {
        &self.model.viewpoints.envs
    }

    fn place_rows(&mut self, rows: &[usize], poses: &[Pose], frame: PoseFrame) -> Result<(), SensorError> {
        let ImageModel { viewpoints, world_from_parent: parents, .. } = &mut self.model;
        Ok(viewpoints.place(rows, poses, frame, |row| parents[row])?)
    }

    fn restore_rows(&mut self, rows: &[usize]) {
        self.model.viewpoints.restore(rows);
    }
}

impl CameraPlacement for RayCasterCamera {
    fn local_pose(&self, convention: CameraConvention) -> Array2<f64> {
        self.model.viewpoints.local_pose(convention)
    }

    fn set_intrinsics(&mut self, intrinsics: &[Intrinsics], env_ids: Option<&[usize]>) -> Result<(), SensorError> {
        let rows = self.model.viewpoints.envs.selected_rows(env_ids)?;
        Ok(self.model.viewpoints.set_intrinsics(&rows, intrinsics, |_| Ok(()))?)
    }
}

impl Sensor for RayCasterCamera {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.rays.update(state, &mut self.model)
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.rays.reset(env_ids, state, &mut self.model)
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.rays.refresh(env_ids, state, &mut self.model)
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.sampler().due_in(step)
    }

    fn sampled(&self) -> Option<&dyn Sampled> {
        Some(self)
    }

    /// Axes of the optical frame and an arrow along each edge of the view frustum, at the instant of the image.
    fn markers(&self, env: usize, _pose: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let taken = self.model.images.viewpoints.get(env);
        let placed = taken.and_then(|taken| Some((taken, Optics::new(Lens::default(), taken.intrinsics).ok()?)));
        let (height, width) = self.image_shape();
        placed.map_or_else(Vec::new, |(taken, optics)| frustum(&taken.world_from_camera, &optics, height, width))
    }
}

impl Sampled for RayCasterCamera {
    fn sampler(&self) -> &Sampler {
        self.rays.sampler()
    }
}

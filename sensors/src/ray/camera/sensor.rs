//! The camera made of rays as a sensor.

use super::cfg::RayCasterCameraCfg;
use crate::camera::sensor::one_each;
use crate::camera::{CameraConvention, DepthMiss, PixelIntrinsics, Poses};
use crate::error::SensorError;
use crate::expected::Expected;
use crate::ray::caster::scan::{Scan, View};
use crate::ray::{Ray, RayHit};
use crate::schedule::{Phases, Schedule};
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use ndarray::{Array1, Array2, Array3, Array4, ArrayView1, ArrayView3, ArrayView4};
use scene::pose::{from_row, to_row};
use scene::{Pose, PoseF64, SceneState};

/// A camera in every environment that casts one ray per pixel.
///
/// Pictures are made when they are due. The first axis is the environment; the frame is that of the environment, units are
/// metres. Nothing is ever NaN.
#[derive(Clone, Debug)]
pub struct RayCasterCamera {
    lens: Lens,
    parent: Option<usize>,
    /// Of the optical frame, in each environment.
    parent_from_camera: Vec<Pose>,
    /// In the optical frame.
    rays: Vec<Ray>,
    max_distance: f64,
    /// What depth and distance say of a miss.
    miss: f32,
    scan: Scan,
    expected: Expected,
    phases: Phases,
    due: Vec<usize>,
    /// Pictures that are made now: their environments, frames and hits.
    views: Vec<View>,
    taken: Vec<bool>,
    hits: Vec<RayHit>,
    world_from_camera: Vec<Pose>,
    stamps: Array1<f64>,
    frame_counts: Array1<u64>,
    depth: Array3<f32>,
    distance: Array3<f32>,
    normal: Array4<f32>,
    mask: Array3<i32>,
}

/// What all pictures have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lens {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixels: PixelIntrinsics,
}

impl RayCasterCamera {
    pub(super) fn new(
        cfg: &RayCasterCameraCfg,
        context: &SensorContext,
        parent: Option<usize>,
        (parent_from_camera, lens): (Pose, Lens),
        rays: Vec<Ray>,
        scan: Scan,
        phases: Phases,
    ) -> Self {
        let n = context.num_envs;
        let shape = (n, lens.height, lens.width);
        let miss = match cfg.depth_miss {
            DepthMiss::Inf => f32::INFINITY,
            DepthMiss::Far => cfg.max_distance as f32,
            DepthMiss::Zero => 0.0,
        };
        Self {
            lens,
            parent,
            parent_from_camera: vec![parent_from_camera; n],
            max_distance: cfg.max_distance,
            miss,
            scan,
            expected: Expected::new("ray caster camera", cfg.requires(), context),
            phases,
            due: Vec::with_capacity(n),
            views: Vec::with_capacity(n),
            taken: vec![false; n],
            hits: vec![RayHit::MISS; n * rays.len()],
            world_from_camera: vec![parent_from_camera; n],
            stamps: Array1::zeros(n),
            frame_counts: Array1::zeros(n),
            depth: Array3::from_elem(shape, miss),
            distance: Array3::from_elem(shape, miss),
            normal: Array4::zeros((n, lens.height, lens.width, 3)),
            mask: Array3::zeros(shape),
            rays,
        }
    }

    /// Makes the pictures of some environments; `state` was checked. An environment that is named twice is drawn once.
    fn shoot(&mut self, envs: &[usize], state: &SceneState) {
        let Some(poses) = &state.instance_poses else { return };
        self.views.clear();
        self.taken.fill(false);
        for &env in envs {
            if std::mem::replace(&mut self.taken[env], true) {
                continue;
            }
            let parent = self.parent.zip(state.body_poses.as_ref());
            let local = self.parent_from_camera[env];
            let pose =
                parent.map_or(local, |(body, poses)| from_row(&std::array::from_fn(|k| poses[(env, body, k)])) * local);
            self.world_from_camera[env] = pose;
            self.stamps[env] = state.time[env];
            self.views.push(View { env, world_from_rays: PoseF64::from(&pose) });
        }
        let count = self.rays.len();
        let hits = &mut self.hits[..self.views.len() * count];
        self.scan.cast(&self.rays, self.max_distance, &self.views, poses, hits);
        for (view, hits) in self.views.iter().zip(hits.chunks(count)) {
            for (k, (hit, ray)) in hits.iter().zip(&self.rays).enumerate() {
                let at = (view.env, k / self.lens.width, k % self.lens.width);
                let (depth, distance) = match hit.is_hit() {
                    true => ((hit.distance * ray.direction[2]) as f32, hit.distance as f32),
                    false => (self.miss, self.miss),
                };
                (self.depth[at], self.distance[at], self.mask[at]) = (depth, distance, hit.mask_id);
                for (axis, x) in hit.normal.into_iter().enumerate() {
                    self.normal[(at.0, at.1, at.2, axis)] = x as f32;
                }
            }
        }
    }

    fn shoot_anew(&mut self, env_ids: &[usize], state: &SceneState) {
        if let Some(poses) = &state.instance_poses {
            env_ids.iter().for_each(|&env| self.scan.settle(env, poses));
        }
        self.shoot(env_ids, state);
    }

    /// When it measures.
    pub fn schedule(&self) -> Schedule {
        self.phases.schedule()
    }

    /// Rows and pixels per row: (H, W).
    pub fn image_shape(&self) -> (usize, usize) {
        (self.lens.height, self.lens.width)
    }

    /// Distance along the optical axis, shape (N, H, W) \[m\]; for a miss what the configuration says.
    pub fn depth(&self) -> ArrayView3<'_, f32> {
        self.depth.view()
    }

    /// Distance along the ray of the pixel, shape (N, H, W) \[m\]; for a miss what the configuration says.
    pub fn distance(&self) -> ArrayView3<'_, f32> {
        self.distance.view()
    }

    /// Unit normals of faces, turned to the camera, in world axes, shape (N, H, W, 3); 0 for a miss.
    pub fn normal(&self) -> ArrayView4<'_, f32> {
        self.normal.view()
    }

    /// Mask ids, shape (N, H, W); 0 for a miss.
    pub fn mask(&self) -> ArrayView3<'_, i32> {
        self.mask.view()
    }

    /// Time of the instant that pictures show \[s\] since the last reset of the environment, shape (N).
    pub fn stamps(&self) -> ArrayView1<'_, f64> {
        self.stamps.view()
    }

    /// Pictures since the last reset, shape (N); the refresh of a reset is none.
    pub fn frame_counts(&self) -> ArrayView1<'_, u64> {
        self.frame_counts.view()
    }

    /// Intrinsic matrices `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]` \[pixels\], shape (N, 3, 3).
    pub fn intrinsic_matrices(&self) -> Array3<f64> {
        let matrix = self.lens.pixels.matrix();
        Array3::from_shape_fn((self.stamps.len(), 3, 3), |(_, i, j)| matrix[(i, j)])
    }

    /// Poses in the environment at the instant of the pictures, rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7).
    pub fn pose_w(&self, convention: CameraConvention) -> Array2<f64> {
        let rows: Vec<[f64; 7]> = self.world_from_camera.iter().map(|p| to_row(&convention.of_optical(p))).collect();
        Array2::from(rows)
    }

    /// Places cameras in the frame of their parent (of the environment, for free ones), from the next picture on.
    ///
    /// `poses` are typed or rows `[x, y, z, qw, qx, qy, qz]`: one for each of `env_ids` (`None` is all environments), or one
    /// for all. `convention` says what their axes mean.
    ///
    /// # Errors
    ///
    /// [`CameraError::Pose`](crate::CameraError::Pose), [`CameraError::Count`](crate::CameraError::Count), an environment that does
    /// not exist; nothing is changed then.
    pub fn set_local_pose(
        &mut self,
        poses: &(impl Poses + ?Sized),
        env_ids: Option<&[usize]>,
        convention: CameraConvention,
    ) -> Result<(), SensorError> {
        let poses = poses.to_poses()?;
        let all: Vec<usize> = (0..self.stamps.len()).collect();
        let env_ids = env_ids.unwrap_or(&all);
        self.expected.check_envs(env_ids)?;
        for (&env, pose) in env_ids.iter().zip(one_each("poses", &poses, env_ids.len())?) {
            self.parent_from_camera[env] = convention.to_optical(pose);
        }
        Ok(())
    }
}

impl Sensor for RayCasterCamera {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.expected.check(state)?;
        let mut due = std::mem::take(&mut self.due);
        due.clear();
        due.extend((0..state.num_envs()).filter(|&env| self.phases.is_due(env, state.step[env])));
        due.iter().for_each(|&env| self.frame_counts[env] += 1);
        self.shoot(&due, state);
        self.due = due;
        Ok(())
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.expected.check(state)?;
        self.expected.check_envs(env_ids)?;
        for &env in env_ids {
            self.phases.reset(env, state.step[env]);
            self.frame_counts[env] = 0;
        }
        self.shoot_anew(env_ids, state);
        Ok(())
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.expected.check(state)?;
        self.expected.check_envs(env_ids)?;
        self.shoot_anew(env_ids, state);
        Ok(())
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.phases.due_in(step.iter().copied())
    }
}

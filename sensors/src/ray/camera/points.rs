//! Point clouds of ray-caster cameras, as for [`Camera`](crate::camera::Camera).

use super::sensor::RayCasterCamera;
use crate::camera::PointFrame;
use crate::camera::point_cloud::{hits_of, unproject};
use crate::error::SensorError;
use crate::sampling::Sampled;
use kinetoscope_scene::Pose;
use ndarray::{Array2, Array3};

impl RayCasterCamera {
    /// Returns the points of all pixels in `frame` \[m\], shape (N, H * W, 3), row by row from the top left. Each point
    /// is on the ray through the pixel center, at the measured distance, noise included. Misses (mask 0) are (+inf,
    /// +inf, +inf).
    pub fn points(&self, frame: PointFrame) -> Array3<f32> {
        let (height, width) = self.image_shape();
        let count = self.sampler().num_envs();
        let mut points = Array3::from_elem((count, height * width, 3), f32::INFINITY);
        if let Some(flat) = points.as_slice_mut() {
            flat.chunks_exact_mut(3 * height * width)
                .enumerate()
                .for_each(|(env, flat)| self.unproject(env, frame, flat));
        }
        points
    }

    /// Returns the point at every pixel of environment `env` \[m\], shape (H, W, 3), as in [`points`](Self::points).
    ///
    /// # Errors
    ///
    /// An environment that does not exist.
    pub fn point_map(&self, env: usize, frame: PointFrame) -> Result<Array3<f32>, SensorError> {
        self.sampler().check_envs(&[env])?;
        let (height, width) = self.image_shape();
        let mut points = Array3::from_elem((height, width, 3), f32::INFINITY);
        if let Some(flat) = points.as_slice_mut() {
            self.unproject(env, frame, flat);
        }
        Ok(points)
    }

    /// Returns the points seen in environment `env` \[m\], shape (points, 3): the hits of
    /// [`point_map`](Self::point_map), row by row from the top left.
    ///
    /// # Errors
    ///
    /// Same as [`point_map`](Self::point_map).
    pub fn point_cloud(&self, env: usize, frame: PointFrame) -> Result<Array2<f32>, SensorError> {
        Ok(hits_of(self.point_map(env, frame)?.view()))
    }

    fn unproject(&self, env: usize, frame: PointFrame, points: &mut [f32]) {
        let taken = self.viewpoint(env);
        let pose = if frame == PointFrame::World { taken.world_from_camera } else { Pose::identity() };
        unproject(&taken.intrinsics, &pose, self.image_shape().1, self.depths(env), points);
    }
}

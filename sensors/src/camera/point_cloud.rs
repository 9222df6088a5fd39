//! Depth pictures, turned back into points.

use super::channel::Depth;
use super::sensor::Camera;
use crate::error::SensorError;
use ndarray::{Array2, Array3, Axis};

/// The frame that points are given in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PointFrame {
    /// The camera's optical frame: x right, y down, z forward.
    #[default]
    Camera,
    /// The environment's frame.
    World,
}

impl Camera {
    /// The point at every pixel of environment `env` \[m\], shape (H, W, 3): the depth along the ray through the pixel's
    /// centre. (+inf, +inf, +inf) where nothing was hit.
    ///
    /// # Errors
    ///
    /// As [`channel`](Self::channel) of [`Depth`], and an environment that the camera does not see.
    pub fn point_map(&self, env: usize, frame: PointFrame) -> Result<Array3<f32>, SensorError> {
        let (row, (height, width)) = (self.row(env)?, self.image_shape());
        let depth = self.channel::<Depth>()?;
        let depth = depth.index_axis(Axis(0), row);
        let view = self.view(env)?;
        let [fx, fy, cx, cy] = [view.fx, view.fy, view.cx, view.cy].map(f64::from);
        let pose = self.world_from_camera(row).filter(|_| frame == PointFrame::World).unwrap_or_default();
        let mut points = Array3::from_elem((height, width, 3), f32::INFINITY);
        for (((v, u), &depth), mut point) in depth.indexed_iter().zip(points.lanes_mut(Axis(2))) {
            if !self.is_hit(depth) {
                continue;
            }
            let z = f64::from(depth);
            let (x, y) = ((u as f64 + 0.5 - cx) / fx, (v as f64 + 0.5 - cy) / fy);
            let at = pose * nalgebra::Point3::new(x * z, y * z, z);
            for (to, from) in point.iter_mut().zip(at.iter()) {
                *to = *from as f32;
            }
        }
        Ok(points)
    }

    /// The points that environment `env` shows \[m\], shape (points, 3): those of [`point_map`](Self::point_map) where
    /// something was hit, row by row from the top left.
    ///
    /// # Errors
    ///
    /// As [`point_map`](Self::point_map).
    pub fn point_cloud(&self, env: usize, frame: PointFrame) -> Result<Array2<f32>, SensorError> {
        let map = self.point_map(env, frame)?;
        let points: Vec<[f32; 3]> =
            map.rows().into_iter().map(|p| [p[0], p[1], p[2]]).filter(|p| p[0].is_finite()).collect();
        Ok(Array2::from(points))
    }
}

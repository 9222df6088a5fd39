//! Depth pictures, turned back into points.

use super::channel::Depth;
use super::intrinsics::PixelIntrinsics;
use super::sensor::Camera;
use crate::error::SensorError;
use ndarray::{Array2, Array3, ArrayView3, Axis};
use scene::Pose;

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
        if let Some(points) = points.as_slice_mut() {
            let depths = depth.iter().map(|&depth| self.is_hit(depth).then_some(depth));
            unproject(&PixelIntrinsics { fx, fy, cx, cy }, &pose, width, depths, points);
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
        Ok(seen(map.view()))
    }
}

/// Writes the points of a picture of `width` pixels per row to `points`, three numbers each: depths \[m\] along the rays
/// through the centres of the pixels, in the frame that `pose` maps to. Where there is no depth, nothing is written.
pub(crate) fn unproject(
    lens: &PixelIntrinsics,
    pose: &Pose,
    width: usize,
    depths: impl Iterator<Item = Option<f32>>,
    points: &mut [f32],
) {
    for (k, (depth, point)) in depths.zip(points.chunks_exact_mut(3)).enumerate() {
        let Some(depth) = depth else { continue };
        let (u, v, z) = ((k % width) as f64 + 0.5, (k / width) as f64 + 0.5, f64::from(depth));
        let (x, y) = ((u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy);
        let at = pose * nalgebra::Point3::new(x * z, y * z, z);
        for (to, from) in point.iter_mut().zip(at.iter()) {
            *to = *from as f32;
        }
    }
}

/// The points of a map that are there, shape (points, 3).
pub(crate) fn seen(map: ArrayView3<'_, f32>) -> Array2<f32> {
    let points = map.rows().into_iter().map(|p| [p[0], p[1], p[2]]).filter(|p| p[0].is_finite());
    Array2::from(points.collect::<Vec<[f32; 3]>>())
}

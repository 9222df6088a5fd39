//! Point clouds from depth images.

use super::sensor::Camera;
use crate::error::SensorError;
use kinetoscope_render::PixelIntrinsics;
use kinetoscope_render::frame::{Depth, Distance};
use kinetoscope_scene::Pose;
use ndarray::{Array2, Array3, ArrayView3, Axis};

/// Reference frame of points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PointFrame {
    /// Optical frame of the camera: x right, y down, z forward.
    #[default]
    Camera,
    /// Frame of the environment.
    World,
}

impl Camera {
    /// Returns the point at every pixel of environment `env` \[m\], shape (H, W, 3); (+inf, +inf, +inf) where nothing
    /// was hit. A point is on the ray through the pixel center, at the measured depth along the optical axis. If rays
    /// of the lens do not all go forward ([`Lens::is_forward`](kinetoscope_render::lens::Lens::is_forward)), the point
    /// is at the measured distance.
    ///
    /// # Errors
    ///
    /// Same as [`channel`](Self::channel) for [`Depth`], or for [`Distance`] if distances are needed, and an
    /// environment that the camera does not see.
    pub fn point_map(&self, env: usize, frame: PointFrame) -> Result<Array3<f32>, SensorError> {
        let (row, (height, width)) = (self.row(env)?, self.image_shape());
        let rays = self.rays_of(row);
        let along = match rays {
            Some(rays) if !rays.is_forward() => self.channel::<Distance>()?,
            _ => self.channel::<Depth>()?,
        };
        let along = along.index_axis(Axis(0), row);
        let view = self.view(env)?;
        let [fx, fy, cx, cy] = [view.fx, view.fy, view.cx, view.cy].map(f64::from);
        let pose = self.world_from_camera(row).filter(|_| frame == PointFrame::World).unwrap_or_default();
        let mut points = Array3::from_elem((height, width, 3), f32::INFINITY);
        if let Some(points) = points.as_slice_mut() {
            let along = along.iter().map(|&along| self.is_hit(along).then_some(along));
            match rays {
                Some(rays) => unproject_along(|at| rays.direction(0, at).map(f64::from), &pose, width, along, points),
                None => unproject(&PixelIntrinsics { fx, fy, cx, cy }, &pose, width, along, points),
            }
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
        let map = self.point_map(env, frame)?;
        Ok(hits_of(map.view()))
    }
}

/// Writes the points of an image of `width` pixels per row to `points`, three numbers each. `depths` \[m\] are along
/// the optical axis, and `pose` maps the optical frame to the frame of the points. Pixels without a depth are not
/// written.
pub(crate) fn unproject(
    lens: &PixelIntrinsics,
    pose: &Pose,
    width: usize,
    depths: impl Iterator<Item = Option<f32>>,
    points: &mut [f32],
) {
    let ray = |[x, y]: [usize; 2]| {
        let (u, v) = (x as f64 + 0.5, y as f64 + 0.5);
        [(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, 1.0]
    };
    unproject_along(ray, pose, width, depths, points);
}

/// Writes points along rays of the optical frame, given in multiples of the ray vector; `None` leaves the point
/// unchanged.
fn unproject_along(
    ray: impl Fn([usize; 2]) -> [f64; 3],
    pose: &Pose,
    width: usize,
    along: impl Iterator<Item = Option<f32>>,
    points: &mut [f32],
) {
    for (k, (along, point)) in along.zip(points.chunks_exact_mut(3)).enumerate() {
        let Some(along) = along.map(f64::from) else { continue };
        let [x, y, z] = ray([k % width, k / width]);
        let at = pose * nalgebra::Point3::new(x * along, y * along, z * along);
        for (to, from) in point.iter_mut().zip(at.iter()) {
            *to = *from as f32;
        }
    }
}

/// Returns the finite points of a map, in the frame of the map \[m\], shape (points, 3).
pub(crate) fn hits_of(map: ArrayView3<'_, f32>) -> Array2<f32> {
    let points = map.rows().into_iter().map(|p| [p[0], p[1], p[2]]).filter(|p| p[0].is_finite());
    Array2::from(points.collect::<Vec<[f32; 3]>>())
}

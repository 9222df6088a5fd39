//! Images of a ray-caster camera, computed from its hits.

use super::pixels::Pixels;
use super::sensor::ImageViewpoint;
use crate::camera::CameraConvention;
use kinetoscope_render::PixelIntrinsics;
use kinetoscope_scene::pose::{from_row, to_row};
use ndarray::{Array2, Array3, Array4, ArrayView2, ArrayView3, ArrayView4};

/// Images of one measurement in all environments.
#[derive(Clone, Debug)]
pub struct RayImages {
    pub(super) viewpoints: Vec<ImageViewpoint>,
    pub(super) depth: Array3<f32>,
    pub(super) distance: Array3<f32>,
    pub(super) normal: Array4<f32>,
    pub(super) mask: Array3<i32>,
}

impl RayImages {
    /// Depth along the optical axis, shape (N, H, W) \[m\]; misses have the configured value.
    pub fn depth(&self) -> ArrayView3<'_, f32> {
        self.depth.view()
    }

    /// Distance along the ray of the pixel, shape (N, H, W) \[m\]; misses have the configured value.
    pub fn distance(&self) -> ArrayView3<'_, f32> {
        self.distance.view()
    }

    /// Unit normals of the hit surfaces, facing the camera, in world axes, shape (N, H, W, 3); 0 for a miss.
    pub fn normal(&self) -> ArrayView4<'_, f32> {
        self.normal.view()
    }

    /// Mask ids, shape (N, H, W); 0 for a miss.
    pub fn mask(&self) -> ArrayView3<'_, i32> {
        self.mask.view()
    }

    /// Intrinsic matrices `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]` \[pixels\], shape (N, 3, 3). The corner of the first
    /// pixel is at (0, 0).
    pub fn intrinsic_matrices(&self) -> Array3<f64> {
        Array3::from_shape_fn((self.viewpoints.len(), 3, 3), |(env, i, j)| {
            self.viewpoints[env].intrinsics.matrix()[(i, j)]
        })
    }

    /// Camera poses in the environment at the measurement, rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7).
    pub fn pose_w(&self, convention: CameraConvention) -> Array2<f64> {
        let row = |taken: &ImageViewpoint| to_row(&convention.pose_from_optical(&taken.world_from_camera));
        Array2::from(self.viewpoints.iter().map(row).collect::<Vec<[f64; 7]>>())
    }

    /// Computes the images of an environment from sampled values; `miss` is the depth and distance of a miss.
    pub(super) fn compute(
        &mut self,
        env: usize,
        [distances, normals, ids, poses, lenses]: [ArrayView2<'_, f64>; 5],
        pixels: &Pixels,
        miss: f32,
    ) {
        let intrinsics =
            PixelIntrinsics { fx: lenses[(env, 0)], fy: lenses[(env, 1)], cx: lenses[(env, 2)], cy: lenses[(env, 3)] };
        let world_from_camera = from_row(&std::array::from_fn(|k| poses[(env, k)]));
        self.viewpoints[env] = ImageViewpoint { world_from_camera, intrinsics };
        for k in 0..pixels.width * pixels.height {
            let at = (env, k / pixels.width, k % pixels.width);
            let id = ids[(env, k)] as i32;
            let (depth, distance) = if id == 0 {
                (miss, miss)
            } else {
                let distance = distances[(env, k)];
                ((distance * pixels.direction(&intrinsics, k)[2]) as f32, distance as f32)
            };
            (self.depth[at], self.distance[at], self.mask[at]) = (depth, distance, id);
            for axis in 0..3 {
                self.normal[(at.0, at.1, at.2, axis)] = normals[(env, 3 * k + axis)] as f32;
            }
        }
    }
}

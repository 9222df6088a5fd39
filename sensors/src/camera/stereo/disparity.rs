//! How far apart the eyes of a pair see the same point.

use super::sensor::StereoCamera;
use crate::camera::error::CameraError;
use crate::error::SensorError;
use kinetoscope_render::frame::Depth;
use ndarray::{Array1, Array3, ArrayView3, Axis};

/// Lengths and angles smaller than this part of the baseline, or this many rad, are rounding.
pub(super) const ROUNDING: f64 = 1e-9;

/// Disparities, and of which pictures they are.
#[derive(Clone, Debug, Default)]
pub(super) struct DisparityMap {
    /// \[pixels\], shape (N, H, W).
    pixels: Array3<f32>,
    draws: u64,
    stamps: Array1<f64>,
}

impl StereoCamera {
    /// Disparities \[pixels\], f32, shape (N, H, W): for every pixel of the left eye, how much farther left the right eye
    /// sees the same point, d = fx b / z with the focal length fx, the baseline b = `left_to_right_pos.x` and the depth z of
    /// the left eye (so that z = fx b / d). The point is at (u - d, v) in the right eye's picture, and at
    /// (u - d + cx_right - cx_left, v) where principal points differ. 0 where nothing was hit, which is where infinitely far
    /// points are, whatever [`depth_miss`](crate::camera::CameraCfg::depth_miss) says.
    ///
    /// It is of the depth that the left eye measures, at every pixel: exact where that is, and with its noise, its holes and its
    /// imperfections where it has some (so an error of depth e is one of about d e / z of disparity). Nothing is matched: it says
    /// nothing of whether the right eye sees the point, which something may be in the way of.
    ///
    /// Draws the left eye's pictures if nobody has yet.
    ///
    /// # Errors
    ///
    /// [`CameraError::NotRectified`] where the eyes are not parallel and side by side, or their lenses differ;
    /// [`CameraError::PinholeOnly`] where either has a lens that is no pinhole; [`CameraError::ChannelOff`] where the left eye
    /// does not measure depth; what reading the depth says.
    pub fn disparity(&self) -> Result<ArrayView3<'_, f32>, SensorError> {
        let baseline = self.baseline()?;
        let depth = self.left().depth()?;
        let update = |map: &mut DisparityMap| {
            self.update_disparities(map, baseline, depth);
            Ok::<(), SensorError>(())
        };
        Ok(self.disparities.get_or_update(|| Ok(DisparityMap::default()), update)?.pixels.view())
    }

    /// [`disparity`](Self::disparity) of the pictures that arrived last, as [`Camera::arrived`](crate::camera::Camera::arrived) has their
    /// depth; made when asked.
    ///
    /// # Errors
    ///
    /// As [`disparity`](Self::disparity).
    pub fn arrived_disparity(&self) -> Result<Array3<f32>, SensorError> {
        let baseline = self.baseline()?;
        let matrices = self.left().arrived_intrinsic_matrices();
        let mut pixels = self.left().arrived::<Depth>()?.to_owned();
        for (row, mut picture) in pixels.axis_iter_mut(Axis(0)).enumerate() {
            let scale = f64::from(matrices[(row, 0, 0)] as f32) * baseline;
            picture.mapv_inplace(|z| if self.left().is_hit(z) { (scale / f64::from(z)) as f32 } else { 0.0 });
        }
        Ok(pixels)
    }

    /// Whether there is a [`disparity`](Self::disparity): whether the eyes are parallel and side by side, their lenses are equal,
    /// and the left one measures depth.
    pub fn has_disparity(&self) -> bool {
        self.left().channels().depth && self.baseline().is_ok()
    }

    /// Where the right eye is along x \[m\], if there is a disparity: if rows of the pictures of both are the same.
    fn baseline(&self) -> Result<f64, CameraError> {
        self.left().must_be_pinhole("disparity")?;
        self.right().must_be_pinhole("disparity")?;
        let t = self.rig.left_from_right.translation.vector;
        let angle = self.rig.left_from_right.rotation.angle();
        let wrong = |what, value, expected: String| Err(CameraError::NotRectified { what, value, expected });
        if angle.abs() > ROUNDING {
            return wrong("the angle between the eyes [rad]", angle, "0".into());
        }
        if t.x <= 0.0 {
            return wrong("left_to_right_pos.x [m]", t.x, "positive".into());
        }
        for (what, value) in [("left_to_right_pos.y [m]", t.y), ("left_to_right_pos.z [m]", t.z)] {
            if value.abs() > ROUNDING * t.x {
                return wrong(what, value, "0".into());
            }
        }
        for row in 0..self.left().env_ids().len() {
            let (left, right) = (self.left().view_of(row), self.right().view_of(row));
            let lenses = [
                ("fx of the right eye", left.fx, right.fx),
                ("fy of the right eye", left.fy, right.fy),
                ("cy of the right eye", left.cy, right.cy),
            ];
            if let Some((what, left, right)) = lenses.into_iter().find(|(_, left, right)| left != right) {
                return wrong(what, f64::from(right), format!("the left eye's, {left}"));
            }
        }
        Ok(t.x)
    }

    fn update_disparities(&self, map: &mut DisparityMap, baseline: f64, depth: ArrayView3<'_, f32>) {
        let (draws, stamps) = (self.left().draws(), self.left().stamps());
        // Nothing was drawn since, nor is anything else shown.
        if map.draws == draws && map.stamps == stamps && map.pixels.dim() == depth.dim() {
            return;
        }
        if map.pixels.dim() != depth.dim() {
            map.pixels = Array3::zeros(depth.dim());
            map.stamps = Array1::zeros(stamps.len());
        }
        map.draws = draws;
        map.stamps.assign(&stamps);
        for (row, (mut to, from)) in map.pixels.axis_iter_mut(Axis(0)).zip(depth.axis_iter(Axis(0))).enumerate() {
            let scale = f64::from(self.left().view_of(row).fx) * baseline;
            to.zip_mut_with(&from, |to, &z| {
                *to = if self.left().is_hit(z) { (scale / f64::from(z)) as f32 } else { 0.0 };
            });
        }
    }
}

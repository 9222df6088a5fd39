//! Disparity of a stereo camera.

use super::sensor::StereoCamera;
use crate::camera::error::CameraError;
use crate::error::SensorError;
use kinetoscope_render::frame::Depth;
use ndarray::{Array1, Array3, ArrayView3, Axis};

/// Rounding tolerance: as a fraction of the baseline for lengths, in \[rad\] for angles.
pub(super) const ROUNDING: f64 = 1e-9;

/// Disparity image, and the version of the images that it was computed from.
#[derive(Clone, Debug, Default)]
pub(super) struct DisparityMap {
    /// \[pixels\], shape (N, H, W).
    pixels: Array3<f32>,
    render_count: u64,
    stamps: Array1<f64>,
}

impl StereoCamera {
    /// Disparities of the left image \[pixels\], f32, shape (N, H, W): how much farther left the right camera sees the
    /// same point.
    ///
    /// The disparity is d = fx b / z, so z = fx b / d. Here fx is the focal length, b = `left_to_right_pos.x` the
    /// baseline, and z the depth of the left camera. The point is at (u - d, v) in the right image; if principal points
    /// differ, it is at (u - d + cx_right - cx_left, v). Misses have the disparity 0 of infinitely far points, for
    /// every [`depth_miss`](crate::camera::CameraCfg::depth_miss).
    ///
    /// Disparities are computed from the measured depth of the left camera, with its noise, holes and imperfections. A
    /// depth error e gives a disparity error of about d e / z. There is no stereo matching: points that are occluded in
    /// the right image have a disparity too.
    ///
    /// Renders the left images if they were not read before.
    ///
    /// # Errors
    ///
    /// [`CameraError::NotRectified`] if the cameras are not parallel and side by side, or their fx, fy or cy differ;
    /// [`CameraError::PinholeOnly`] if either lens is not a pinhole; [`CameraError::ChannelOff`] if the left camera
    /// does not measure depth; errors of reading the depth.
    pub fn disparity(&self) -> Result<ArrayView3<'_, f32>, SensorError> {
        let baseline = self.baseline()?;
        let depth = self.left().depth()?;
        let update = |map: &mut DisparityMap| {
            self.update_disparity_map(map, baseline, depth);
            Ok::<(), SensorError>(())
        };
        Ok(self.disparities.get_or_update(|| Ok(DisparityMap::default()), update)?.pixels.view())
    }

    /// [`disparity`](Self::disparity) of the latest delivered images, from the depth of
    /// [`Camera::latest_delivered`](crate::camera::Camera::latest_delivered); computed at every call.
    ///
    /// # Errors
    ///
    /// Same as [`disparity`](Self::disparity).
    pub fn latest_delivered_disparity(&self) -> Result<Array3<f32>, SensorError> {
        let baseline = self.baseline()?;
        let matrices = self.left().latest_delivered_intrinsic_matrices();
        let mut pixels = self.left().latest_delivered::<Depth>()?.to_owned();
        for (row, mut image) in pixels.axis_iter_mut(Axis(0)).enumerate() {
            let scale = f64::from(matrices[(row, 0, 0)] as f32) * baseline;
            image.mapv_inplace(|z| if self.left().is_hit(z) { (scale / f64::from(z)) as f32 } else { 0.0 });
        }
        Ok(pixels)
    }

    /// True if [`disparity`](Self::disparity) is available: both lenses are pinholes, the cameras are parallel and side
    /// by side, their fx, fy and cy are equal, and the left camera measures depth.
    pub fn has_disparity(&self) -> bool {
        self.left().channels().depth && self.baseline().is_ok()
    }

    /// Returns the x position of the right camera from the left one \[m\]; an error if the images are not rectified.
    fn baseline(&self) -> Result<f64, CameraError> {
        self.left().require_pinhole("disparity")?;
        self.right().require_pinhole("disparity")?;
        let t = self.rig.left_from_right.translation.vector;
        let angle = self.rig.left_from_right.rotation.angle();
        let wrong = |what, value, expected: String| Err(CameraError::NotRectified { what, value, expected });
        if angle.abs() > ROUNDING {
            return wrong("the angle between the cameras [rad]", angle, "0".into());
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
                ("fx of the right camera", left.fx, right.fx),
                ("fy of the right camera", left.fy, right.fy),
                ("cy of the right camera", left.cy, right.cy),
            ];
            if let Some((what, left, right)) = lenses.into_iter().find(|(_, left, right)| left != right) {
                return wrong(what, f64::from(right), format!("{left}, as of the left camera"));
            }
        }
        Ok(t.x)
    }

    fn update_disparity_map(&self, map: &mut DisparityMap, baseline: f64, depth: ArrayView3<'_, f32>) {
        let (draws, stamps) = (self.left().render_count(), self.left().stamps());
        // No image was rendered, and no other frame is shown since.
        if map.render_count == draws && map.stamps == stamps && map.pixels.dim() == depth.dim() {
            return;
        }
        if map.pixels.dim() != depth.dim() {
            map.pixels = Array3::zeros(depth.dim());
            map.stamps = Array1::zeros(stamps.len());
        }
        map.render_count = draws;
        map.stamps.assign(&stamps);
        for (row, (mut to, from)) in map.pixels.axis_iter_mut(Axis(0)).zip(depth.axis_iter(Axis(0))).enumerate() {
            let scale = f64::from(self.left().view_of(row).fx) * baseline;
            to.zip_mut_with(&from, |to, &z| {
                *to = if self.left().is_hit(z) { (scale / f64::from(z)) as f32 } else { 0.0 };
            });
        }
    }
}

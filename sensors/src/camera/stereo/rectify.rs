//! Stereo rectification.

use super::disparity::ROUNDING;
use super::sensor::StereoCamera;
use crate::camera::error::CameraError;
use crate::camera::extrinsics::Poses;
use crate::error::SensorError;
use kinetoscope_render::{Intrinsics, PixelIntrinsics};
use kinetoscope_scene::Pose;
use nalgebra::{Matrix3, Matrix3x4, Unit, UnitQuaternion, Vector3};

/// Largest rotation of an optical axis by the rectification \[rad\], 80 degrees. Beyond it, the image center is at
/// least 5.7 focal lengths aside, outside any usual image.
const MAX_AXIS_ROTATION: f64 = 80.0 * std::f64::consts::PI / 180.0;

/// Stereo rectification: rotations and projections with which both images show a point in the same row. ROS calls them
/// R and P.
///
/// Both cameras get common axes, with x from the left camera to the right one. A point (x, y, z) of the rectified left
/// frame is at `(u, v) = (f x / z + cx, f y / z + cy)` in the rectified left image. In the rectified right image, the
/// point is `f b / z` farther left in the same row, with the baseline b.
///
/// Source: Bouguet's algorithm, as in OpenCV's `stereoRectify`. Each camera rotates by half of the angle between both,
/// then both rotate by the smallest angle that aligns the baseline with x. The choice of f and the principal points is
/// free, and differs from OpenCV:
///
/// - f is the smaller fy of both cameras, for both image axes.
/// - Both cameras get the same (cx, cy), so points at infinity have no disparity. (cx, cy) is the mean, over both
///   cameras, of the principal point that keeps the content at the raw principal point in place.
///
/// Lenses have no influence: R applies after a raw image is undistorted. Cameras that are parallel and side by side
/// with the same fx, fy and cy need no rotation. Each of them keeps its fx, fy, cx and cy; a difference of cx changes
/// the disparity.
#[derive(Clone, Debug, PartialEq)]
pub struct Rectification {
    /// R of the left and the right camera: from its optical frame to its rectified frame.
    pub rotations: [Matrix3<f64>; 2],
    /// P of the left and the right camera \[pixels\]: from points of the rectified *left* frame to the rectified
    /// images, with the center of the first pixel at (0.5, 0.5). In [`CameraInfo`](crate::camera::CameraInfo), the
    /// center is at (0, 0), so cx and cy are 0.5 less.
    pub projections: [Matrix3x4<f64>; 2],
}

impl Rectification {
    /// Computes the rectification of two cameras from their relative pose and their intrinsics (left, right).
    ///
    /// # Errors
    ///
    /// [`CameraError::NotRectifiable`] if the right camera is not to the right of the left one, or an optical axis
    /// would rotate by more than 80 degrees; [`CameraError::Pose`] and [`CameraError::Optics`] for invalid numbers.
    pub fn new(left_from_right: &Pose, [left, right]: [PixelIntrinsics; 2]) -> Result<Self, CameraError> {
        left_from_right.to_poses()?;
        [left, right].into_iter().try_for_each(|pixels| Intrinsics::from(pixels).to_pixels(1, 1).map(|_| ()))?;
        let (between, angle) = (left_from_right.translation.vector, left_from_right.rotation.angle());
        let is_level = angle <= ROUNDING && between.yz().amax() <= ROUNDING * between.x;
        // Compared in single precision, as images use it.
        let same = |of: fn(&PixelIntrinsics) -> f64| of(&left) as f32 == of(&right) as f32;
        if is_level && between.x > 0.0 && same(|k| k.fx) && same(|k| k.fy) && same(|k| k.cy) {
            let projections = [projection(&left, 0.0), projection(&right, between.x)];
            return Ok(Self { rotations: [Matrix3::identity(); 2], projections });
        }
        let reject = |what, value, expected| Err(CameraError::NotRectifiable { what, value, expected });
        let half = left_from_right.rotation.powf(0.5);
        let level = half.inverse() * between;
        if level.x <= 0.0 {
            return reject("the x offset of the right camera [m]", level.x, "positive");
        }
        let turn = rotation_to_x_axis(&level);
        let rotations = [turn * half.inverse(), turn * half];
        // Directions of the raw optical axes after the rotation.
        let axes = rotations.map(|rotation| rotation * Vector3::z());
        for (axis, what) in axes.iter().zip([
            "the rectifying rotation of the left camera [rad]",
            "the rectifying rotation of the right camera [rad]",
        ]) {
            let angle = axis.xy().norm().atan2(axis.z);
            if angle > MAX_AXIS_ROTATION {
                return reject(what, angle, "at most 1.396 (80 degrees)");
            }
        }
        let f = left.fy.min(right.fy);
        let mean = |axis: usize, of: fn(&PixelIntrinsics) -> f64| {
            let [a, b] = [(&left, axes[0]), (&right, axes[1])].map(|(eye, at)| of(eye) - f * at[axis] / at.z);
            0.5 * (a + b)
        };
        let common = PixelIntrinsics { fx: f, fy: f, cx: mean(0, |k| k.cx), cy: mean(1, |k| k.cy) };
        Ok(Self {
            rotations: rotations.map(|rotation| rotation.to_rotation_matrix().into_inner()),
            projections: [projection(&common, 0.0), projection(&common, between.norm())],
        })
    }
}

/// Returns P of a camera that is `beside` \[m\] to the right of the left one.
fn projection(pixels: &PixelIntrinsics, beside: f64) -> Matrix3x4<f64> {
    let mut projection = Matrix3x4::zeros();
    projection.fixed_columns_mut::<3>(0).copy_from(&pixels.matrix());
    // Not a product with -1: P of the left camera is 0, not -0.
    projection[(0, 3)] = 0.0 - pixels.fx * beside;
    projection
}

/// Returns the smallest rotation that maps a direction to x. The sine keeps its digits for small angles.
fn rotation_to_x_axis(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    let axis = direction.cross(&Vector3::x());
    let angle = axis.norm().atan2(direction.x);
    let axis = Unit::try_new(axis, 0.0);
    axis.map_or_else(UnitQuaternion::identity, |axis| UnitQuaternion::from_axis_angle(&axis, angle))
}

impl StereoCamera {
    /// Returns the rectification of the images of environment `env`.
    ///
    /// # Errors
    ///
    /// An environment that the cameras do not see, and [`CameraError::NotRectifiable`].
    pub fn rectification(&self, env: usize) -> Result<Rectification, SensorError> {
        let row = self.left().row(env)?;
        let pixels = [self.left(), self.right()].map(|eye| eye.viewpoints.row(row).pixels);
        Ok(Rectification::new(&self.rig.left_from_right, pixels)?)
    }
}

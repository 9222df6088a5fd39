//! How the pictures of a pair of eyes are turned so that both show a point in the same row.

use super::disparity::ROUNDING;
use super::sensor::StereoCamera;
use crate::camera::error::CameraError;
use crate::camera::extrinsics::Poses;
use crate::error::SensorError;
use kinetoscope_render::{Intrinsics, PixelIntrinsics};
use kinetoscope_scene::Pose;
use nalgebra::{Matrix3, Matrix3x4, Unit, UnitQuaternion, Vector3};

/// An optical axis is turned by this at most \[rad\], 80 degrees. Beyond it nothing of a usual picture is left: what was in its
/// middle is 5.7 focal lengths aside.
const MOST: f64 = 80.0 * std::f64::consts::PI / 180.0;

/// How the pictures of a pair of eyes are turned so that both show a point in the same row: what ROS calls R and P.
///
/// The eyes get common axes, x from the left eye to the right one. Then a point at (x, y, z) of the rectified frame of the left
/// eye is at (u, v) = (f x / z + cx, f y / z + cy) of the left rectified picture, and f b / z farther left in the same row of the
/// right one, where b is the distance of the eyes.
///
/// Source: Bouguet's algorithm as OpenCV's `stereoRectify` has it: either eye turns by half of the angle between both, then both by the
/// smallest angle that brings the line between them to x. Its way to choose f and the principal points is not taken over: they
/// are free, and here
///
/// - f is the smaller fy of both eyes, along both axes of the picture,
/// - (cx, cy) are common, so that points at infinity have no disparity, and such that what raw pictures have at their principal
///   points stays where it is, on the mean of both eyes.
///
/// Lenses do not matter: of a raw picture, R takes over after its distortion is undone. Eyes that are parallel and side by side with the
/// same fx, fy and cy are rectified as they are: nothing turns, and each keeps its fx, fy, cx and cy.
#[derive(Clone, Debug, PartialEq)]
pub struct Rectification {
    /// R of the left and the right eye: from its optical frame to its rectified one.
    pub rotations: [Matrix3<f64>; 2],
    /// P of the left and the right eye \[pixels\]: from points of the rectified frame of the *left* one to the rectified pictures,
    /// with the centre of the first pixel at (0.5, 0.5). In [`CameraInfo`](crate::camera::CameraInfo) it is at (0, 0).
    pub projections: [Matrix3x4<f64>; 2],
}

impl Rectification {
    /// Of eyes that stand so to each other, with these intrinsics (left, right).
    ///
    /// # Errors
    ///
    /// [`CameraError::NotRectifiable`] where the right eye is not to the right of the left one, or an eye would turn by more than
    /// 80 degrees; [`CameraError::Pose`] and [`CameraError::Optics`] for numbers that are none.
    pub fn of(left_from_right: &Pose, [left, right]: [PixelIntrinsics; 2]) -> Result<Self, CameraError> {
        left_from_right.to_poses()?;
        [left, right].into_iter().try_for_each(|pixels| Intrinsics::from(pixels).to_pixels(1, 1).map(|_| ()))?;
        let (between, angle) = (left_from_right.translation.vector, left_from_right.rotation.angle());
        let is_level = angle <= ROUNDING && between.yz().amax() <= ROUNDING * between.x;
        // As pictures have them, in single precision.
        let same = |of: fn(&PixelIntrinsics) -> f64| of(&left) as f32 == of(&right) as f32;
        if is_level && between.x > 0.0 && same(|k| k.fx) && same(|k| k.fy) && same(|k| k.cy) {
            let projections = [projection(&left, 0.0), projection(&right, between.x)];
            return Ok(Self { rotations: [Matrix3::identity(); 2], projections });
        }
        let refuse = |what, value, expected| Err(CameraError::NotRectifiable { what, value, expected });
        let half = left_from_right.rotation.powf(0.5);
        let level = half.inverse() * between;
        if level.x <= 0.0 {
            return refuse("how far the right eye is to the right of the left one [m]", level.x, "positive");
        }
        let turn = to_x(&level);
        let rotations = [turn * half.inverse(), turn * half];
        // Where the raw optical axes are then.
        let axes = rotations.map(|rotation| rotation * Vector3::z());
        for (axis, what) in axes.iter().zip([
            "the angle by which the left eye turns to be rectified [rad]",
            "the angle by which the right eye turns to be rectified [rad]",
        ]) {
            let angle = axis.xy().norm().atan2(axis.z);
            if angle > MOST {
                return refuse(what, angle, "at most 1.396 (80 degrees)");
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

/// P of an eye that is `beside` \[m\] to the right of the left one.
fn projection(pixels: &PixelIntrinsics, beside: f64) -> Matrix3x4<f64> {
    let mut projection = Matrix3x4::zeros();
    projection.fixed_columns_mut::<3>(0).copy_from(&pixels.matrix());
    // Not a product with -1: that of the left eye is 0, not -0.
    projection[(0, 3)] = 0.0 - pixels.fx * beside;
    projection
}

/// The smallest rotation that brings a direction to the right to x. By a sine, which keeps its digits where the angle is small.
fn to_x(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    let axis = direction.cross(&Vector3::x());
    let angle = axis.norm().atan2(direction.x);
    let axis = Unit::try_new(axis, 0.0);
    axis.map_or_else(UnitQuaternion::identity, |axis| UnitQuaternion::from_axis_angle(&axis, angle))
}

impl StereoCamera {
    /// How pictures of environment `env` are rectified.
    ///
    /// # Errors
    ///
    /// An environment that the eyes do not see, and [`CameraError::NotRectifiable`].
    pub fn rectification(&self, env: usize) -> Result<Rectification, SensorError> {
        let row = self.left().row(env)?;
        let pixels = [self.left(), self.right()].map(|eye| eye.viewpoints.row(row).pixels);
        Ok(Rectification::of(&self.rig.left_from_right, pixels)?)
    }
}

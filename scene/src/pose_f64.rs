//! Poses of ray casters: a rotation matrix and a translation in double precision.

use crate::vector::{add, dot};
use crate::{Pose, PoseF32};

/// A rigid transform in `f64`, row-major: `x -> rotation * x + translation`.
///
/// Variable names follow the algebra: `world_from_instance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseF64 {
    /// Rows of the rotation matrix.
    pub rotation: [[f64; 3]; 3],
    /// Translation \[m\].
    pub translation: [f64; 3],
}

impl Default for PoseF64 {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl From<&Pose> for PoseF64 {
    fn from(pose: &Pose) -> Self {
        let m = pose.to_homogeneous();
        Self { rotation: [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)])), translation: [0, 1, 2].map(|i| m[(i, 3)]) }
    }
}

impl From<&PoseF64> for PoseF32 {
    fn from(pose: &PoseF64) -> Self {
        Self {
            rotation: pose.rotation.map(|row| row.map(|x| x as f32)),
            translation: pose.translation.map(|x| x as f32),
        }
    }
}

impl PoseF64 {
    /// The identity.
    pub const IDENTITY: Self = Self { rotation: [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.]], translation: [0., 0., 0.] };

    /// A pure translation \[m\].
    pub const fn from_translation(translation: [f64; 3]) -> Self {
        Self { translation, ..Self::IDENTITY }
    }

    /// Rotates a direction from the source frame into the target frame: `rotation * v`.
    #[inline]
    pub fn rotate(&self, v: [f64; 3]) -> [f64; 3] {
        self.rotation.map(|r| dot(r, v))
    }

    /// Rotates a direction from the target frame into the source frame.
    #[inline]
    pub fn rotate_inverse(&self, v: [f64; 3]) -> [f64; 3] {
        let r = &self.rotation;
        [0, 1, 2].map(|j| r[0][j] * v[0] + r[1][j] * v[1] + r[2][j] * v[2])
    }

    /// Maps a point \[m\] from the source frame into the target frame: `rotation * p + translation`.
    #[inline]
    pub fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        add(self.rotate(p), self.translation)
    }

    /// Maps a point \[m\] from the target frame into the source frame.
    #[inline]
    pub fn apply_inverse(&self, p: [f64; 3]) -> [f64; 3] {
        let t = self.translation;
        self.rotate_inverse([p[0] - t[0], p[1] - t[1], p[2] - t[2]])
    }

    /// True if every number is finite.
    pub fn is_finite(&self) -> bool {
        self.rotation.iter().flatten().chain(&self.translation).all(|x| x.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::from_xyz_rpy;
    use nalgebra::Point3;

    #[test]
    fn maps() {
        let pose = from_xyz_rpy([20.0, -3.0, 0.5], [0.3, -1.1, 2.0]);
        let (exact, p) = (PoseF64::from(&pose), [0.3, -7.0, 2.5]);
        let mapped: [f64; 3] = (pose * Point3::from(p)).coords.into();
        for k in 0..3 {
            assert!((exact.apply(p)[k] - mapped[k]).abs() < 1e-14);
            assert!((exact.apply_inverse(mapped)[k] - p[k]).abs() < 1e-14);
            assert!((PoseF32::from(&exact).apply(p.map(|x| x as f32))[k] - mapped[k] as f32).abs() < 1e-5);
        }
        assert!(exact.is_finite() && !PoseF64::from_translation([0.0, f64::NAN, 0.0]).is_finite());
    }
}

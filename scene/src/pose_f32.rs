//! Poses of the renderer: a rotation matrix and a translation in single precision.

use crate::Pose;
use crate::vector::{add, cross, dot};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// A rigid transform in `f32`, row-major: `x -> rotation * x + translation`.
///
/// Variable names follow the algebra: `world_from_instance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseF32 {
    /// Rows of the rotation matrix.
    pub rotation: [[f32; 3]; 3],
    /// Translation \[m\].
    pub translation: [f32; 3],
}

impl Default for PoseF32 {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl From<&PoseF32> for Pose {
    fn from(pose: &PoseF32) -> Self {
        let rows = pose.rotation.map(|row| row.map(f64::from));
        let rotation = Matrix3::from_fn(|row, column| rows[row][column]);
        let translation = Vector3::from(pose.translation.map(f64::from));
        // Normalized in double precision, because the matrix is in single precision.
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
        Self::from_parts(translation.into(), UnitQuaternion::new_normalize(rotation.into_inner()))
    }
}

impl From<&Pose> for PoseF32 {
    fn from(pose: &Pose) -> Self {
        let m = pose.to_homogeneous();
        Self {
            rotation: [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)] as f32)),
            translation: [0, 1, 2].map(|i| m[(i, 3)] as f32),
        }
    }
}

impl PoseF32 {
    /// The identity.
    pub const IDENTITY: Self = Self { rotation: [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.]], translation: [0., 0., 0.] };

    /// A pure translation \[m\].
    pub const fn from_translation(translation: [f32; 3]) -> Self {
        Self { translation, ..Self::IDENTITY }
    }

    /// Rotates a direction from the source frame into the target frame: `rotation * v`.
    pub fn rotate(&self, v: [f32; 3]) -> [f32; 3] {
        self.rotation.map(|r| dot(r, v))
    }

    /// Rotates a direction from the target frame into the source frame.
    pub fn rotate_inverse(&self, v: [f32; 3]) -> [f32; 3] {
        let r = &self.rotation;
        [0, 1, 2].map(|j| r[0][j] * v[0] + r[1][j] * v[1] + r[2][j] * v[2])
    }

    /// Maps a point \[m\] from the source frame into the target frame: `rotation * p + translation`.
    pub fn apply(&self, p: [f32; 3]) -> [f32; 3] {
        add(self.rotate(p), self.translation)
    }

    /// Maps a point \[m\] from the target frame into the source frame.
    pub fn apply_inverse(&self, p: [f32; 3]) -> [f32; 3] {
        let t = self.translation;
        self.rotate_inverse([p[0] - t[0], p[1] - t[1], p[2] - t[2]])
    }

    /// Returns `self⁻¹ * other`, computed in double precision, so that close poses far from the origin keep their
    /// digits.
    pub fn inverse_times(&self, other: &Self) -> Self {
        let a = self.rotation.map(|r| r.map(f64::from));
        let b = other.rotation.map(|r| r.map(f64::from));
        let d = [0, 1, 2].map(|i| f64::from(other.translation[i]) - f64::from(self.translation[i]));
        let column = |j: usize, v: [f64; 3]| a[0][j] * v[0] + a[1][j] * v[1] + a[2][j] * v[2];
        Self {
            rotation: [0, 1, 2].map(|i| [0, 1, 2].map(|j| column(i, [b[0][j], b[1][j], b[2][j]]) as f32)),
            translation: [0, 1, 2].map(|i| column(i, d) as f32),
        }
    }

    /// True if every number is finite and the matrix is a rotation, within 1e-3.
    pub fn is_rigid(&self) -> bool {
        let r = &self.rotation;
        let cross = cross(r[0], r[1]);
        let near = |x: f32, y: f32| (x - y).abs() < 1e-3;
        self.translation.iter().all(|t| t.is_finite())
            && near(dot(r[0], r[0]), 1.)
            && near(dot(r[1], r[1]), 1.)
            && near(dot(r[2], r[2]), 1.)
            && near(dot(r[0], r[1]), 0.)
            && near(dot(r[0], r[2]), 0.)
            && near(dot(r[1], r[2]), 0.)
            && near(dot(cross, r[2]), 1.)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::from_xyz_rpy;
    use nalgebra::Point3;

    /// Agreement with the same maps in double precision. Numbers of size 5 are rounded to 6e-8 of themselves, a few
    /// times.
    #[test]
    fn maps() {
        let pose = from_xyz_rpy([2.0, -3.0, 0.5], [0.3, -1.1, 2.0]);
        let own = PoseF32::from(&pose);
        let v = [0.7_f32, -0.2, 1.5];
        let vector = Vector3::from(v.map(f64::from));
        let near = |found: [f32; 3], expected: Vector3<f64>| {
            assert!((Vector3::from(found.map(f64::from)) - expected).norm() < 2e-6, "{found:?}, expected {expected}");
        };
        near(own.rotate(v), pose * vector);
        near(own.rotate_inverse(v), pose.rotation.inverse() * vector);
        near(own.apply(v), (pose * Point3::from(vector)).coords);
        near(own.apply_inverse(v), pose.inverse_transform_point(&Point3::from(vector)).coords);
        assert!(
            (own.rotate(v)[0] - own.rotate_inverse(v)[0]).abs() > 0.1,
            "control: rotation and inverse rotation differ"
        );
    }

    #[test]
    fn round_trip() {
        // Half turns too, whose quaternions have w = 0 and do not follow from the trace.
        for turn in [[0.3, -1.1, 2.0], [std::f64::consts::PI, 0.0, 0.0], [0.0, 0.0, std::f64::consts::PI], [0.0; 3]] {
            let pose = from_xyz_rpy([2.0, -3.0, 0.5], turn);
            let again = Pose::from(&PoseF32::from(&pose));
            // Single precision: nine numbers of at most 1, each to 6e-8.
            assert!(again.rotation.angle_to(&pose.rotation) < 5e-7, "{again}, was {pose}");
            assert!((again.translation.vector - pose.translation.vector).norm() < 5e-7);
            assert!((again.rotation.quaternion().norm() - 1.0).abs() < 1e-15);
        }
    }

    /// Two poses 100 km from the origin and 2 m apart: the spacing of f32 there is 8 mm, but their difference is exact.
    #[test]
    fn far_out() {
        let turn = from_xyz_rpy([0.0; 3], [0.4, 0.2, -0.9]);
        let at = |x: f32| PoseF32 { translation: [x, 65_536.0, 0.0], ..PoseF32::from(&turn) };
        let (a, b) = (at(131_072.0), at(131_074.0));
        let between = a.inverse_times(&b);
        let expected = turn.inverse() * Vector3::new(2.0, 0.0, 0.0);
        assert!((Vector3::from(between.translation.map(f64::from)) - expected).norm() < 1e-6, "{between:?}");
        for (i, row) in between.rotation.iter().enumerate() {
            for (j, x) in row.iter().enumerate() {
                assert!((x - if i == j { 1.0 } else { 0.0 }).abs() < 1e-6, "{between:?}");
            }
        }
    }

    #[test]
    fn not_rigid() {
        let good = PoseF32::from(&from_xyz_rpy([1.0, 2.0, 3.0], [0.3, -1.1, 2.0]));
        assert!(good.is_rigid() && PoseF32::IDENTITY.is_rigid());
        assert!(!PoseF32::from_translation([f32::NAN, 0.0, 0.0]).is_rigid());
        for (what, rotation) in [
            ("mirror", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]),
            ("scaled", [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]]),
            ("sheared", [[1.0, 0.3, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
            ("sheared in the last row", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [5.0, 0.0, 1.0]]),
            ("no number", [[f32::NAN; 3]; 3]),
        ] {
            assert!(!PoseF32 { rotation, ..PoseF32::IDENTITY }.is_rigid(), "{what}");
        }
    }
}

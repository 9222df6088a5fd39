//! Poses, and all conversions between quaternion orders.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// A rigid transform: translation \[m\] and rotation.
///
/// Variable names follow the algebra: `world_from_link * link_from_camera`.
pub type Pose = Isometry3<f64>;

/// Normalized unit quaternion from `[w, x, y, z]`; NaN for a zero quaternion.
pub fn from_wxyz(q: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]))
}

/// Normalized unit quaternion from `[x, y, z, w]` (ROS, SciPy); NaN for a zero quaternion.
pub fn from_xyzw(q: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(q[3], q[0], q[1], q[2]))
}

/// Components `[w, x, y, z]` of a rotation.
pub fn to_wxyz(q: &UnitQuaternion<f64>) -> [f64; 4] {
    [q.w, q.i, q.j, q.k]
}

/// Pose from fixed-axis roll, pitch, yaw \[rad\] (URDF `rpy`) and a translation \[m\] (URDF `xyz`).
pub fn from_xyz_rpy(xyz: [f64; 3], rpy: [f64; 3]) -> Pose {
    Pose::from_parts(Translation3::from(Vector3::from(xyz)), UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]))
}

/// Row `[x, y, z, qw, qx, qy, qz]` of a pose; x, y, z in meters.
pub fn to_row(pose: &Pose) -> [f64; 7] {
    let (t, q) = (pose.translation.vector, pose.rotation);
    [t.x, t.y, t.z, q.w, q.i, q.j, q.k]
}

/// Pose from a row `[x, y, z, qw, qx, qy, qz]`; x, y, z in meters. The quaternion is normalized; a zero quaternion
/// gives NaN.
pub fn from_row(row: &[f64; 7]) -> Pose {
    Pose::from_parts(Translation3::new(row[0], row[1], row[2]), from_wxyz([row[3], row[4], row[5], row[6]]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quarter turn about z takes x to y: its quaternion is cos 45° and sin 45° about z.
    #[test]
    fn orders_of_quaternions() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        // Inputs of any length are normalized.
        for scale in [1.0, 3.0] {
            let turns =
                [from_wxyz([scale * half, 0.0, 0.0, scale * half]), from_xyzw([0.0, 0.0, scale * half, scale * half])];
            for turn in turns {
                assert!((turn * Vector3::x() - Vector3::y()).norm() < 1e-15, "{turn}");
                assert!((turn.norm() - 1.0).abs() < 1e-15);
            }
        }
        // Four different numbers, each at its position. Control: the other order is another rotation.
        let [w, x, y, z] = [0.1, 0.5, 0.7, 0.5];
        assert_eq!(to_wxyz(&from_xyzw([x, y, z, w])), to_wxyz(&from_wxyz([w, x, y, z])));
        assert!(from_xyzw([w, x, y, z]).angle_to(&from_wxyz([w, x, y, z])) > 0.5);
    }
}

//! Interpolation between two poses.

use kinetoscope_scene::vector::{V3, add_scaled, sub};
use kinetoscope_scene::{PoseF32, PoseF64};

/// The time of the second pose; the first pose has the time 0.
pub(crate) const END_TIME: f64 = 1.0;

/// Motion between two poses. The origin moves straight at constant speed. The axes rotate the shorter way, by a
/// normalized blend of unit quaternions (nlerp). Between poses 0.5 rad apart, that differs from a steady rotation by at
/// most 1 mrad; it needs no cosine, which differs from machine to machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    to: PoseF64,
    origins: [V3; 2],
    /// Quaternions w, x, y, z; `None` without rotation.
    rotation: Option<[[f64; 4]; 2]>,
}

/// Converts a pose to double precision.
pub(crate) fn pose_to_f64(pose: &PoseF32) -> PoseF64 {
    PoseF64 { rotation: pose.rotation.map(|r| r.map(f64::from)), translation: pose.translation.map(f64::from) }
}

/// Converts a pose to double precision and orthonormalizes its rotation to the last digits. With a rotation in single
/// precision, a transform and its inverse move a point by 1e-7 of its coordinates, so a surface would not contain its
/// own points.
pub(crate) fn orthonormalized(pose: &PoseF32) -> PoseF64 {
    let PoseF64 { mut rotation, translation } = pose_to_f64(pose);
    // The nearest rotation, by Newton's iteration R (3 - R'R) / 2: an error of e becomes one of e². Axis-aligned
    // rotations keep their bits. Source: Higham, Computing the polar decomposition, 1986.
    for _ in 0..3 {
        let r = rotation;
        let product = |i: usize, j: usize| (0..3).map(|k| r[k][i] * r[k][j]).sum::<f64>();
        let half = [0, 1, 2].map(|i| [0, 1, 2].map(|j| 0.5 * (if i == j { 3.0 } else { 0.0 } - product(i, j))));
        rotation = r.map(|row| [0, 1, 2].map(|j| (0..3).map(|k| row[k] * half[k][j]).sum()));
    }
    PoseF64 { rotation, translation }
}

impl Motion {
    /// The motion between two poses; `None` between equal ones.
    pub(crate) fn between(from: &PoseF32, to: &PoseF32) -> Option<Self> {
        if from == to {
            return None;
        }
        let (a, b) = (orthonormalized(from), orthonormalized(to));
        let turn = (from.rotation != to.rotation).then(|| {
            let (p, q) = (quaternion(&a.rotation), quaternion(&b.rotation));
            // The nearer one of the two quaternions of a rotation.
            let sign = if p.iter().zip(q).map(|(x, y)| x * y).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
            [p, q.map(|x| sign * x)]
        });
        Some(Self { to: b, origins: [a.translation, b.translation], rotation: turn })
    }

    /// Pose in the world at a time from 0 to [`END_TIME`].
    pub(crate) fn at(&self, time: f64) -> PoseF64 {
        let [from, to] = self.origins;
        let translation = add_scaled(from, time, sub(to, from));
        let rotation = self.rotation.map_or(self.to.rotation, |[p, q]| {
            let blend = [0, 1, 2, 3].map(|k| p[k] + time * (q[k] - p[k]));
            matrix(blend)
        });
        PoseF64 { rotation, translation }
    }

    /// A box in the world that contains, at every time, a box given in the moving frame, enlarged by the factor
    /// `larger`.
    pub(super) fn bounds(&self, [lo, hi]: [V3; 2], larger: f64) -> [V3; 2] {
        let [a, b] = self.origins;
        let reach = match self.rotation {
            None => self.to.rotation.map(|r| {
                let middle = (0..3).map(|k| 0.5 * r[k] * (lo[k] + hi[k])).sum::<f64>();
                let half = (0..3).map(|k| 0.5 * r[k].abs() * (hi[k] - lo[k])).sum::<f64>();
                [middle - larger * half, middle + larger * half]
            }),
            Some(_) => {
                // In any orientation, the farthest corner has the same distance from the origin.
                let corner = [0, 1, 2].map(|k| lo[k].abs().max(hi[k].abs()));
                let far = larger * corner.iter().map(|x| x * x).sum::<f64>().sqrt();
                [[-far, far]; 3]
            }
        };
        let pad = |x: f64| 1e-9 * x.abs();
        let low = [0, 1, 2].map(|k| a[k].min(b[k]) + reach[k][0]);
        let high = [0, 1, 2].map(|k| a[k].max(b[k]) + reach[k][1]);
        [low.map(|x| x - pad(x)), high.map(|x| x + pad(x))]
    }
}

/// The unit quaternion w, x, y, z of a rotation. Source: Shepperd, Quaternion from rotation matrix, 1978.
fn quaternion(r: &[V3; 3]) -> [f64; 4] {
    let trace = r[0][0] + r[1][1] + r[2][2];
    let squares = [trace, r[0][0], r[1][1], r[2][2]];
    let largest = (1..4).fold(0, |best, k| if squares[k] > squares[best] { k } else { best });
    let skew = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]];
    let mut q = [0.0; 4];
    if largest == 0 {
        q = [1.0 + trace, skew[0], skew[1], skew[2]];
    } else {
        let i = largest - 1;
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        q[0] = skew[i];
        q[1 + i] = 1.0 + r[i][i] - r[j][j] - r[k][k];
        q[1 + j] = r[j][i] + r[i][j];
        q[1 + k] = r[k][i] + r[i][k];
    }
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    q.map(|x| x / length)
}

/// The rotation of a quaternion w, x, y, z of any length but 0.
fn matrix(q: [f64; 4]) -> [V3; 3] {
    let s = 2.0 / q.iter().map(|x| x * x).sum::<f64>();
    let [w, x, y, z] = q;
    [
        [1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
        [s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)],
        [s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_scene::Pose;
    use nalgebra::{UnitQuaternion, Vector3};

    fn pose(at: [f64; 3], axis: [f64; 3]) -> Pose {
        Pose::from_parts(at.into(), UnitQuaternion::from_scaled_axis(Vector3::from(axis)))
    }

    /// Compares with nalgebra's spherical interpolation, for poses with each of Shepperd's four kinds of matrices.
    #[test]
    fn interpolation() {
        let far = 3.1;
        for start in [[0.1, 0.2, -0.3], [far, 0.0, 0.0], [0.0, far, 0.1], [0.1, 0.0, -far]] {
            for (angle, tolerance) in [(0.5, 1e-3), (0.05, 1e-6)] {
                let (a, b) = (pose([1.0, -2.0, 0.5], start), pose([1.5, -2.0, 0.25], start));
                let b = b * UnitQuaternion::from_scaled_axis(Vector3::new(0.6, -0.48, 0.64) * angle);
                let motion = Motion::between(&PoseF32::from(&a), &PoseF32::from(&b)).unwrap();
                for time in [0.0, 0.2, 0.5, 0.9, 1.0] {
                    let (here, expected) = (motion.at(time), PoseF64::from(&a.lerp_slerp(&b, time)));
                    // Poses are single precision.
                    assert!((0..3).all(|i| (here.translation[i] - expected.translation[i]).abs() < 1e-6));
                    let pairs = here.rotation.as_flattened().iter().zip(expected.rotation.as_flattened());
                    let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    assert!(off < tolerance + 1e-6, "{start:?} {angle} {time}: {off}");
                }
            }
        }
        // A control: half a turn is not steady.
        let motion = Motion::between(&PoseF32::IDENTITY, &PoseF32::from(&pose([0.0; 3], [0.0, 0.0, 2.8]))).unwrap();
        assert!((motion.at(0.2).rotation[0][0] - 0.56f64.cos()).abs() > 0.03);
        assert!(Motion::between(&PoseF32::IDENTITY, &PoseF32::IDENTITY).is_none());
    }

    #[test]
    fn bounds() {
        let bounds = [[-0.2, 0.1, -0.5], [0.3, 0.4, 0.6]];
        for axis in [[0.0; 3], [0.3, -0.2, 0.4], [0.0, 2.5, 0.0]] {
            let (a, b) = (pose([1.0, 0.0, -1.0], [0.2, 0.1, 0.0]), pose([0.5, 0.3, -0.2], [0.2, 0.1, 0.0]));
            let b = b * UnitQuaternion::from_scaled_axis(Vector3::from(axis));
            let motion = Motion::between(&PoseF32::from(&a), &PoseF32::from(&b)).unwrap();
            let [lo, hi] = motion.bounds(bounds, 1.0 + 1e-6);
            for step in 0..=20 {
                let pose = motion.at(f64::from(step) / 20.0);
                for corner in 0..8 {
                    let at = pose.apply([0, 1, 2].map(|k| bounds[corner >> k & 1][k]));
                    assert!((0..3).all(|k| lo[k] <= at[k] && at[k] <= hi[k]), "{axis:?}, {step}");
                }
            }
        }
    }
}

//! Conversion of a rotation to roll, pitch, yaw, exact to rounding even where the pitch is a right angle.

use nalgebra::UnitQuaternion;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Fixed-axis roll, pitch, yaw \[rad\].
///
/// The textbook formula takes an arc sine of the pitch and loses half of the digits near a right angle, where many
/// robots have joints. With the half-angle products of `q = qz(yaw) qy(pitch) qx(roll)`:
/// `x + z = (c - s) sin(a)`, `w - y = (c - s) cos(a)`, `x - z = (c + s) sin(b)`, `w + y = (c + s) cos(b)` where `a =
/// (roll + yaw)/2`, `b = (roll - yaw)/2`, `c, s = cos, sin(pitch/2)`. This gives three arc tangents, each well
/// conditioned in its contribution to the rotation.
pub(super) fn rpy_of(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let (w, x, y, z) = (rotation.w, rotation.i, rotation.j, rotation.k);
    let (a, b) = ((x + z).atan2(w - y), (x - z).atan2(w + y));
    let pitch = 2.0 * (x - z).hypot(w + y).atan2((x + z).hypot(w - y)) - FRAC_PI_2;
    [wrap(a + b), pitch, wrap(a - b)]
}

fn wrap(angle: f64) -> f64 {
    match angle {
        a if a > PI => a - TAU,
        a if a < -PI => a + TAU,
        a => a,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rebuilt() {
        let steps = [-PI, -3.0, -FRAC_PI_2, -1.0, -1e-9, 0.0, 1e-9, 0.3, FRAC_PI_2 - 5e-12, FRAC_PI_2, 2.0, PI];
        let (right, near) = (FRAC_PI_2, FRAC_PI_2 - 5e-12);
        let pitches = [-right, -near, -1.0, -1e-12, 0.0, 1e-6, 0.7, right - 3e-8, near, right];
        for roll in steps {
            for pitch in pitches {
                for yaw in steps {
                    let q = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
                    let [r, p, y] = rpy_of(&q);
                    let back = UnitQuaternion::from_euler_angles(r, p, y);
                    let error = 1.0 - q.coords.dot(&back.coords).abs();
                    let vector = (q.inverse() * back).vector().norm();
                    assert!(error < 1e-15 && vector < 2e-15, "{roll} {pitch} {yaw}: {vector:e}");
                }
            }
        }
        assert_eq!(rpy_of(&UnitQuaternion::identity()), [0.0; 3]);
    }
}

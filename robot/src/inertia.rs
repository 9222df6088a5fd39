//! Mass properties of rigid bodies: transforming, combining, checking and repairing them.
//!
//! MuJoCo rejects a model with physically impossible inertias, and many URDF files have some. [`RigidInertia`] combines
//! links (parallel-axis theorem), finds principal axes, reports faults, and makes the smallest repair.
//!
//! A tensor `I` belongs to a rigid body if and only if the second moment of its mass, `Σ = ∫ r rᵀ dm`, is positive
//! semidefinite, where `I = tr(Σ) 1 - Σ` and so `Σ = tr(I)/2 1 - I`. In principal axes with moments A, B, C the moments
//! of Σ are `(B + C - A)/2`, `(A + C - B)/2`, `(A + B - C)/2`: this is the triangle inequality, and it implies that A,
//! B, C are not negative. Source: Wensing, Kim, Slotine, "Linear Matrix Inequalities for Physically Consistent Inertial
//! Parameter Identification", IEEE Robotics and Automation Letters 3(1), 2018, section III.

use crate::description::Inertial;
use kinetoscope_scene::Pose;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Smallest mass of a moving body that MuJoCo accepts \[kg\]. Source: `mjMINVAL`.
const MUJOCO_MIN_MASS: f64 = 1e-15;
/// Smallest principal moment that MuJoCo accepts \[kg m²\]. Source: `mjEPS` in user_util.h, the threshold for
/// `fullinertia`. The threshold for other moving bodies is `mjMINVAL` = 1e-15; the stricter value allows both ways of
/// writing an inertia.
const MUJOCO_MIN_MOMENT: f64 = 1e-14;
/// Mass given to a body without mass \[kg\]: one milligram, nine decades above MuJoCo's minimum and negligible on a
/// robot.
const REPAIR_MASS: f64 = 1e-6;
/// Smallest thickness t of a repaired body \[m\]: the second moment across a sheet of this thickness is m t²/12.
const REPAIR_THICKNESS: f64 = 1e-3;
/// Floor of a repaired second moment \[kg m²\]. Two of them add up to a principal moment of 200 times MuJoCo's minimum.
const REPAIR_SECOND_MOMENT: f64 = 1e-12;
/// Smallest ratio of repaired second moments. A smaller ratio is lost in the rounding of the tensor.
const REPAIR_RATIO: f64 = 1e-9;
/// Tolerated relative error of the eigenvalues of a 3x3 matrix. A plate has A + B = C exactly and must stay valid.
const ROUNDING: f64 = 1e-12;

/// Mass properties of a rigid body in some frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidInertia {
    /// Mass \[kg\].
    pub mass: f64,
    /// Center of mass in the frame \[m\].
    pub com: Vector3<f64>,
    /// Inertia tensor \[kg m²\] about the center of mass, in the axes of the frame.
    pub inertia: Matrix3<f64>,
}

/// Reason why MuJoCo rejects the mass properties of a moving body.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InertiaFault {
    /// A number or a principal moment is infinite or not a number.
    #[error("mass, center of mass or inertia is not finite")]
    NotFinite,
    /// The mass is negative, zero, or too small for MuJoCo.
    #[error("the mass {mass} kg is not positive")]
    MassNotPositive {
        /// The mass \[kg\].
        mass: f64,
    },
    /// The tensor differs from its transpose by more than rounding.
    #[error("the inertia tensor is not symmetric")]
    NotSymmetric,
    /// A principal moment is negative, zero, or too small for MuJoCo.
    #[error("the smallest principal moment {smallest:.6e} kg m² is not positive")]
    NotPositiveDefinite {
        /// The smallest principal moment \[kg m²\].
        smallest: f64,
    },
    /// The two smaller principal moments do not add up to the largest.
    #[error(
        "principal moments {a:.6e} + {b:.6e} < {c:.6e} kg m²: they violate the triangle inequality of a rigid body"
    )]
    Triangle {
        /// Smallest principal moment \[kg m²\].
        a: f64,
        /// Middle principal moment \[kg m²\].
        b: f64,
        /// Largest principal moment \[kg m²\].
        c: f64,
    },
}

impl RigidInertia {
    /// Body without mass: the neutral element of [`combine`](Self::combine).
    pub const ZERO: Self =
        Self { mass: 0.0, com: Vector3::new(0.0, 0.0, 0.0), inertia: Matrix3::new(0., 0., 0., 0., 0., 0., 0., 0., 0.) };

    /// Mass properties of an `<inertial>`, in the link frame.
    pub fn from_inertial(inertial: &Inertial) -> Self {
        let in_com_axes = Self { mass: inertial.mass, com: Vector3::zeros(), inertia: inertial.inertia };
        in_com_axes.transformed(&inertial.link_from_com)
    }

    /// Transforms mass properties from frame `a` to frame `b`.
    #[must_use]
    pub fn transformed(&self, b_from_a: &Pose) -> Self {
        let rotation = b_from_a.rotation.to_rotation_matrix();
        Self {
            mass: self.mass,
            com: b_from_a.rotation * self.com + b_from_a.translation.vector,
            inertia: rotation.matrix() * self.inertia * rotation.matrix().transpose(),
        }
    }

    /// Combines two rigidly connected bodies, given in the same frame.
    ///
    /// With d between the centers of mass: `I = I₁ + I₂ + m₁ m₂ / (m₁ + m₂) (d·d 1 - d dᵀ)` (parallel-axis theorem,
    /// twice). If the masses add up to zero, the inertias are added and the center of mass of `self` is kept.
    #[must_use]
    pub fn combine(&self, other: &Self) -> Self {
        let mass = self.mass + other.mass;
        if mass == 0.0 {
            return Self { mass, com: self.com, inertia: self.inertia + other.inertia };
        }
        let d = other.com - self.com;
        let reduced_mass = self.mass * other.mass / mass;
        Self {
            mass,
            com: self.com + d * (other.mass / mass),
            inertia: self.inertia + other.inertia + second_moment_to_inertia(&(d * d.transpose() * reduced_mass)),
        }
    }

    /// Principal moments C >= B >= A \[kg m²\], largest first (as MuJoCo sorts them), and the rotation R
    /// `frame_from_principal`: `inertia = R diag(C, B, A) Rᵀ`. R is right-handed, also for equal moments. A tensor that
    /// is already diagonal and sorted gives the identity.
    ///
    /// MuJoCo requires A + B >= C without a tolerance. For a thin plate, rounding of the eigenvalues may violate this
    /// inequality by up to 1e-12 C. The middle moment B is then raised until the inequality holds. Write these numbers
    /// to the MJCF (`diaginertia`, `quat`) rather than the tensor, which MuJoCo would round again.
    ///
    /// Only the symmetric part of the tensor is used. All elements must be finite; otherwise the result is meaningless.
    pub fn principal(&self) -> (Vector3<f64>, UnitQuaternion<f64>) {
        let (mut moments, axes) = sorted_eigen(&symmetric_part(&self.inertia));
        let missing = moments[0] - (moments[1] + moments[2]);
        // Infinite moments of a tensor whose numbers are close to the largest ones have no next number to end at.
        if missing > 0.0 && missing <= ROUNDING * moments[0] && missing.is_finite() {
            while moments[1] + moments[2] < moments[0] {
                moments[1] = moments[1].next_up();
            }
        }
        (moments, axes)
    }

    /// Checks that MuJoCo accepts a moving body with these mass properties, written as [`principal`](Self::principal)
    /// returns them.
    ///
    /// # Errors
    ///
    /// The first of: a number that is not finite, a mass below 1e-15 kg, a tensor that is not symmetric (beyond
    /// 1e-12 of its largest element), a principal moment below 1e-14 kg m², A + B < C.
    pub fn check(&self) -> Result<(), InertiaFault> {
        let finite = self.mass.is_finite()
            && self.com.iter().all(|x| x.is_finite())
            && self.inertia.iter().all(|x| x.is_finite());
        if !finite {
            return Err(InertiaFault::NotFinite);
        }
        if self.mass < MUJOCO_MIN_MASS {
            return Err(InertiaFault::MassNotPositive { mass: self.mass });
        }
        if (self.inertia - self.inertia.transpose()).amax() > ROUNDING * self.inertia.amax() {
            return Err(InertiaFault::NotSymmetric);
        }
        let (moments, _) = self.principal();
        if has_overflow(&moments) {
            return Err(InertiaFault::NotFinite);
        }
        let [c, b, a] = [moments[0], moments[1], moments[2]];
        if a < MUJOCO_MIN_MOMENT {
            return Err(InertiaFault::NotPositiveDefinite { smallest: a });
        }
        if a + b < c {
            return Err(InertiaFault::Triangle { a, b, c });
        }
        Ok(())
    }

    /// Returns the nearest mass properties that MuJoCo accepts, and a sentence that describes the changes. Where
    /// [`check`](Self::check) finds no fault, the mass properties are unchanged and the sentence is empty.
    ///
    /// 1. Numbers that are not finite become 0; the tensor becomes its symmetric part.
    /// 2. A mass below 1e-15 kg becomes 1e-6 kg; the inertia stays (a rotor given by its inertia alone).
    /// 3. Principal axes are kept. A second moment of the mass (module documentation) below the floor `f = max(m t²/12,
    ///    1e-12 kg m², 1e-9 of the largest)`, t = 1 mm, becomes f: the body is at least as thick as a sheet of 1 mm.
    ///    For a violated triangle inequality A + B < C this adds `(C - A - B)/2 + f` to A and to B and leaves C
    ///    unchanged. A body without inertia gets 2 f about every axis. The rest of the mass distribution stays.
    ///
    /// MuJoCo's own `balanceinertia` makes all three moments equal instead: for moments 3, 0, 0 it removes two thirds
    /// of the largest.
    pub fn repaired(&self) -> (Self, String) {
        let Err(fault) = self.check() else {
            return (*self, String::new());
        };
        let finite_or_zero = |x: f64| if x.is_finite() { x } else { 0.0 };
        let mut fixed = Self {
            mass: finite_or_zero(self.mass),
            com: self.com.map(finite_or_zero),
            inertia: symmetric_part(&self.inertia.map(finite_or_zero)),
        };
        let mut done = vec![format!("{fault}")];
        if fixed.mass != self.mass || fixed.com != self.com || self.inertia.iter().any(|x| !x.is_finite()) {
            done.push("numbers that are not finite were set to 0".to_owned());
        }
        if has_overflow(&sorted_eigen(&fixed.inertia).0) {
            fixed.inertia = Matrix3::zeros();
            done.push("the inertia, whose principal moments are too large for a number, was set to 0".to_owned());
        }
        if fixed.mass < MUJOCO_MIN_MASS {
            fixed.mass = REPAIR_MASS;
            done.push(format!("the mass was set to {REPAIR_MASS} kg"));
        }
        if fixed.check().is_err() {
            let (before, axes) = sorted_eigen(&fixed.inertia);
            let second = before.map(|moment| before.sum() / 2.0 - moment);
            let floor = (fixed.mass * REPAIR_THICKNESS * REPAIR_THICKNESS / 12.0)
                .max(REPAIR_SECOND_MOMENT)
                .max(REPAIR_RATIO * second.max());
            let second = second.map(|s| s.max(floor));
            let after = second.map(|s| second.sum() - s);
            let rotation = axes.to_rotation_matrix();
            fixed.inertia =
                symmetric_part(&(rotation.matrix() * Matrix3::from_diagonal(&after) * rotation.matrix().transpose()));
            done.push(format!(
                "the principal moments ({:.6e}, {:.6e}, {:.6e}) were set to ({:.6e}, {:.6e}, {:.6e}) kg m²",
                before[0], before[1], before[2], after[0], after[1], after[2]
            ));
        } else if fault == InertiaFault::NotSymmetric {
            done.push("the symmetric part was taken".to_owned());
        }
        (fixed, done.join("; "))
    }
}

/// Inertia tensor `tr(Σ) 1 - Σ` of a body with the second moment Σ.
fn second_moment_to_inertia(second_moment: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::from_diagonal_element(second_moment.trace()) - second_moment
}

/// True if the moments or their sum are no finite numbers.
fn has_overflow(moments: &Vector3<f64>) -> bool {
    !moments.sum().is_finite()
}

fn symmetric_part(m: &Matrix3<f64>) -> Matrix3<f64> {
    (m + m.transpose()) * 0.5
}

/// Eigenvalues, largest first, and the rotation whose columns are their eigenvectors.
///
/// Cyclic Jacobi rotations: the vectors stay orthonormal to rounding whatever the eigenvalues, equal ones included, and
/// small eigenvalues keep their relative accuracy. Source: Golub, Van Loan, Matrix Computations, 4th edition, 8.5. A
/// matrix of zeros or subnormal numbers gives its unsorted diagonal and no rotation.
fn sorted_eigen(symmetric: &Matrix3<f64>) -> (Vector3<f64>, UnitQuaternion<f64>) {
    // A power of two, so that scaling does not round; without it, products of entries near 1e-160 vanish.
    let scale = symmetric.amax().log2().floor().exp2();
    if !(scale.is_normal() && scale.recip().is_normal()) {
        return (symmetric.diagonal(), UnitQuaternion::identity());
    }
    let mut a = symmetric / scale;
    let mut v = Matrix3::identity();
    // Convergence is quadratic: 3x3 matrices take four or five sweeps.
    for _ in 0..32 {
        let mut rotated = false;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[(p, q)].abs() <= f64::EPSILON * f64::EPSILON * (a[(p, p)].abs() + a[(q, q)].abs())
                || a[(p, q)].abs() < f64::MIN_POSITIVE
            {
                continue;
            }
            rotated = true;
            let theta = (a[(q, q)] - a[(p, p)]) / (2.0 * a[(p, q)]);
            let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let c = t.hypot(1.0).recip();
            let s = t * c;
            let mut j = Matrix3::identity();
            (j[(p, p)], j[(q, q)], j[(p, q)], j[(q, p)]) = (c, c, s, -s);
            a = j.transpose() * a * j;
            (a[(p, q)], a[(q, p)]) = (0.0, 0.0);
            v *= j;
        }
        if !rotated {
            break;
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| a[(j, j)].total_cmp(&a[(i, i)]));
    let mut axes = Matrix3::from_columns(&order.map(|i| v.column(i).into_owned()));
    if axes.determinant() < 0.0 {
        axes.set_column(2, &-axes.column(2));
    }
    let moments = Vector3::from(order.map(|i| a[(i, i)] * scale));
    (moments, UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tensor(ixx: f64, ixy: f64, ixz: f64, iyy: f64, iyz: f64, izz: f64) -> Matrix3<f64> {
        Matrix3::new(ixx, ixy, ixz, ixy, iyy, iyz, ixz, iyz, izz)
    }

    fn body(mass: f64, inertia: Matrix3<f64>) -> RigidInertia {
        RigidInertia { mass, com: Vector3::zeros(), inertia }
    }

    fn diagonal(mass: f64, a: f64, b: f64, c: f64) -> RigidInertia {
        body(mass, Matrix3::from_diagonal(&Vector3::new(a, b, c)))
    }

    /// Mass properties of a uniform box. Source: I_xx = m (y² + z²) / 12.
    fn box_inertia(mass: f64, size: Vector3<f64>, com: Vector3<f64>) -> RigidInertia {
        let s = size.component_mul(&size) * (mass / 12.0);
        RigidInertia { com, ..diagonal(mass, s.y + s.z, s.x + s.z, s.x + s.y) }
    }

    fn rebuilt(moments: &Vector3<f64>, axes: &UnitQuaternion<f64>) -> Matrix3<f64> {
        let r = axes.to_rotation_matrix();
        r.matrix() * Matrix3::from_diagonal(moments) * r.matrix().transpose()
    }

    /// True if MuJoCo's checks of `diaginertia` pass: exact comparisons, in double precision.
    fn mujoco_accepts(b: &RigidInertia) -> bool {
        let (i, _) = b.principal();
        b.mass >= 1e-15 && i.min() >= 1e-15 && i[0] + i[1] >= i[2] && i[0] + i[2] >= i[1] && i[1] + i[2] >= i[0]
    }

    #[test]
    fn half_boxes() {
        let half = Vector3::new(0.5, 0.2, 0.1);
        let left = box_inertia(1.5, half, Vector3::new(-0.25, 0.0, 0.0));
        let right = box_inertia(1.5, half, Vector3::new(0.25, 0.0, 0.0));
        let whole = box_inertia(3.0, Vector3::new(1.0, 0.2, 0.1), Vector3::zeros());
        let fused = left.combine(&right);
        assert!((fused.inertia - whole.inertia).amax() < 1e-15);
        assert!(fused.com.amax() < 1e-15);
        assert_eq!(fused.mass, 3.0);
        assert_eq!(RigidInertia::ZERO.combine(&left), left);
        assert_eq!(left.combine(&RigidInertia::ZERO), left);
    }

    #[test]
    fn principal_axes() {
        let turn = UnitQuaternion::from_euler_angles(0.3, -1.1, 2.0);
        for moments in [[3.0, 2.0, 1.5], [2.0, 2.0, 1.0], [2.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1e-9, 1e-9, 1e-12]] {
            for turn in [turn, UnitQuaternion::identity(), UnitQuaternion::from_euler_angles(1e-9, 0.0, 1e-12)] {
                let given = Vector3::from(moments);
                let m = symmetric_part(&rebuilt(&given, &turn));
                let (found, axes) = body(1.0, m).principal();
                assert!((found - given).amax() < 4e-15 * given[0], "{found} {given}");
                assert!(found[0] >= found[1] && found[1] >= found[2]);
                assert!((rebuilt(&found, &axes) - m).amax() < 4e-15 * given[0]);
                assert!((axes.norm() - 1.0).abs() < 1e-15);
            }
        }
        let (_, axes) = diagonal(1.0, 3.0, 2.0, 1.5).principal();
        assert_eq!(axes, UnitQuaternion::identity());
        let (moments, axes) = diagonal(1.0, 1.5, 2.0, 3.0).principal();
        assert_eq!(moments, Vector3::new(3.0, 2.0, 1.5));
        assert!((rebuilt(&moments, &axes).diagonal() - Vector3::new(1.5, 2.0, 3.0)).amax() < 1e-15);
    }

    #[test]
    fn thin_plates() {
        let mut faults = 0;
        let mut unsnapped = 0;
        for k in 0..2000 {
            let k = f64::from(k);
            let turn = UnitQuaternion::from_euler_angles(0.1 * k, 0.37 * k, 0.71 * k);
            let (a, b) = (1e-4 * (1.0 + k.sin().abs()), 1e-3 * (1.0 + k.cos().abs()));
            let plate = body(1.0, rebuilt(&Vector3::new(a + b, b, a), &turn));
            let (raw, _) = sorted_eigen(&symmetric_part(&plate.inertia));
            unsnapped += usize::from(raw[1] + raw[2] < raw[0]);
            faults += usize::from(plate.check().is_err() || !mujoco_accepts(&plate));
        }
        assert!(unsnapped > 100, "control: rounding matters: {unsnapped}");
        assert_eq!(faults, 0);
    }

    #[test]
    fn faults() {
        assert_eq!(diagonal(1.0, 1.0, 1.0, 1.0).check(), Ok(()));
        assert!(matches!(diagonal(f64::NAN, 1.0, 1.0, 1.0).check(), Err(InertiaFault::NotFinite)));
        assert!(matches!(diagonal(0.0, 1.0, 1.0, 1.0).check(), Err(InertiaFault::MassNotPositive { .. })));
        assert!(matches!(diagonal(1.0, 1.0, 1.0, 0.0).check(), Err(InertiaFault::NotPositiveDefinite { .. })));
        assert_eq!(diagonal(1.0, 1.0, 4.0, 2.0).check(), Err(InertiaFault::Triangle { a: 1.0, b: 2.0, c: 4.0 }));
        let skewed = body(1.0, Matrix3::new(1.0, 0.1, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0));
        assert_eq!(skewed.check(), Err(InertiaFault::NotSymmetric));
        assert_eq!(skewed.repaired().0.inertia, tensor(1.0, 0.05, 0.0, 1.0, 0.0, 1.0));
    }

    /// The five links of the ANYmal C model (`anymal_c_simple_description`) that MuJoCo refuses: four depth cameras
    /// with the same numbers, and the hatch.
    #[test]
    fn links_of_anymal_c() {
        let camera = tensor(0.000637051, 0.000484569, 0.000424211, 0.000929402, 5.138e-06, 0.000484569);
        let hatch = Matrix3::from_element(0.001);
        for (mass, inertia) in [(0.16043, camera), (0.142, hatch)] {
            let broken = body(mass, inertia);
            assert!(broken.check().is_err());
            let (fixed, what) = broken.repaired();
            assert!(what.contains("principal moments"), "{what}");
            fixed.check().unwrap();
            assert!(mujoco_accepts(&fixed));
            assert_eq!(fixed.mass, mass);
            // No inertia is removed: the added inertia is positive semidefinite.
            let added = sorted_eigen(&symmetric_part(&(fixed.inertia - inertia))).0;
            assert!(added.min() > -1e-18, "{added}");
            // The axes are kept.
            let commutator = fixed.inertia * inertia - inertia * fixed.inertia;
            assert!(commutator.amax() < 1e-20);
        }
        // Moments 3e-3, 0, 0: two are raised to half the largest, but for the thickness floor of 1.2e-8.
        let (moments, _) = body(0.142, hatch).repaired().0.principal();
        let floor = 0.142 * 1e-6 / 12.0;
        assert!((moments - Vector3::new(3.0e-3, 1.5e-3 + floor, 1.5e-3 + floor)).amax() < 1e-17);
    }

    #[test]
    fn every_broken_body() {
        let huge = [0.0, -0.0, 1e-300, 1e-20, 1e-9, 1.0, 1e6, -1.0, -1e-9, f64::NAN, f64::INFINITY, f64::MIN_POSITIVE];
        for mass in huge {
            for a in huge {
                for b in huge {
                    for (c, off) in huge.iter().flat_map(|&c| [(c, 0.0), (c, 1e-3), (c, 1.0)]) {
                        let broken = body(mass, tensor(a, off, 0.5 * off, b, -off, c));
                        let (fixed, what) = broken.repaired();
                        assert_eq!(fixed.check(), Ok(()), "{broken:?} -> {fixed:?}: {what}");
                        assert!(mujoco_accepts(&fixed), "{broken:?} -> {fixed:?}");
                        assert_eq!(what.is_empty(), broken.check().is_ok());
                        assert_eq!(fixed.repaired().1, "", "a repaired inertia is valid");
                    }
                }
            }
        }
    }

    #[test]
    fn rotors_and_points() {
        // LF_FOOT of ANYmal C is sound: long and thin, A = 8.0e-5, B ≈ C.
        let foot = tensor(0.00317174097, 2.63048e-06, 6.815581e-05, 0.00317174092, 6.815583e-05, 8.319196e-05);
        assert_eq!(body(0.25, foot).repaired(), (body(0.25, foot), String::new()));
        let (fixed, what) = diagonal(0.0, 1e-3, 1e-3, 1e-3).repaired();
        assert_eq!(fixed, diagonal(1e-6, 1e-3, 1e-3, 1e-3));
        assert!(what.contains("the mass was set"), "{what}");
        let (point, _) = diagonal(1.2, 0.0, 0.0, 0.0).repaired();
        assert!((point.principal().0 - Vector3::repeat(2e-7)).amax() < 1e-20);
    }

    /// Root cause: principal moments above the largest number are infinite, and the middle one was raised for ever.
    #[test]
    fn moments_above_the_largest_number() {
        for element in [8e307, 1.7e308] {
            let huge = body(1.0, Matrix3::from_element(element));
            assert_eq!(huge.check(), Err(InertiaFault::NotFinite));
            let (repaired, done) = huge.repaired();
            assert!(mujoco_accepts(&repaired) && repaired.inertia.iter().all(|x| x.is_finite()), "{repaired:?}");
            assert!(done.contains("too large for a number") && !done.contains("not finite were set"), "{done}");
        }
    }
}

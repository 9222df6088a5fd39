//! The drive law as MuJoCo's own actuator: `force = clamp(kp ctrl - kp q - kd v)`, evaluated at the start of the step.
//!
//! The law is explicit, so it is stable only for time steps small against the joint's inertia: see [`stable_timestep`].

use super::gains::{Gains, Target};
use super::plan::{JointPlan, mass_matrix_at_start};
use super::table::Drive;
use kinetoscope_mujoco as mj;
use kinetoscope_robot::description::RobotDescription;
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use nalgebra::{DMatrix, DVector};

/// Sets the control so that the actuator's force is the drive law: `ctrl = q* + (kd v* + tau_ff) / kp`.
///
/// With `kp = 0`, the actuator's gain is `kd`, and `ctrl = v* + tau_ff / kd`. With `kp = kd = 0`, the gain is 1, and
/// `ctrl = tau_ff`. `mjcf::robot` writes the gain.
pub(super) fn apply(drive: &Drive, gains: &Gains, target: &Target, data: &mut mj::Data) {
    data.ctrl_mut()[drive.ctrl] = control(gains, target);
}

/// Control that [`apply`] sets.
pub(crate) fn control(gains: &Gains, target: &Target) -> f64 {
    if gains.kp > 0.0 {
        target.position + (gains.kd * target.velocity + target.feedforward) / gains.kp
    } else if gains.kd > 0.0 {
        target.velocity + target.feedforward / gains.kd
    } else {
        target.feedforward
    }
}

/// Integration of an actuator's damping in MuJoCo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// At the start of the step: integrator Euler, and saturated actuators of `implicitfast` on 4.x.
    Explicit,
    /// At the end of the step: integrators `implicit` and `implicitfast`. Stiffness stays at the start.
    ImplicitDamping,
}

/// Returns the largest time step \[s\] at which the law is stable in MuJoCo; infinite without gains, and 0 if no step
/// is stable (a mass matrix that is not positive definite). `damping` is the damping of the joints, which MuJoCo
/// integrates at the end of the step in both schemes.
///
/// The explicit step `(M + h B) (v' - v) = -h (Kp q + Kd v + B v)`, `q' = q + h v'` is stable exactly while
/// `4 M + 2 h B - 2 h Kd - h² Kp` is positive definite; with Kd at the end of the step like B, while
/// `4 M + 2 h (B + Kd) - h² Kp` is. To see it, seek `q = z^n u`, multiply by `u*` from the left and apply the Jury
/// criterion to the scalar equation. The bound follows from bisection.
pub fn stable_timestep(
    scheme: Scheme,
    mass_matrix: &DMatrix<f64>,
    kp: &DVector<f64>,
    kd: &DVector<f64>,
    damping: &DVector<f64>,
) -> f64 {
    let implicit = match scheme {
        Scheme::Explicit => damping - kd,
        Scheme::ImplicitDamping => damping + kd,
    };
    if kp.iter().chain(kd.iter()).all(|&k| k == 0.0) || mass_matrix.is_empty() {
        return f64::INFINITY;
    }
    let stable = |h: f64| {
        let margin = 4.0 * mass_matrix + DMatrix::from_diagonal(&(2.0 * h * &implicit - h * h * kp));
        margin.cholesky().is_some()
    };
    // Bracket in decades, then bisect in the logarithm: the result ranges from 1e-10 s (stiff fingers) to seconds.
    let (mut low, mut high) = (1e-14_f64, 1e3_f64);
    if !stable(low) {
        return 0.0;
    }
    if stable(high) {
        return f64::INFINITY;
    }
    while high / low > 1.0 + 1e-9 {
        let middle = (low * high).sqrt();
        if stable(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Returns [`stable_timestep`] \[s\] of a robot's drives at its start positions, with mimic joints coupled to their
/// drivers; `None` if the dynamics of the description cannot be computed.
pub fn stable_timestep_of(
    scheme: Scheme,
    description: &RobotDescription,
    plans: &[JointPlan],
    floating_base: bool,
) -> Option<f64> {
    let start = mass_matrix_at_start(description, plans, floating_base).ok()?;
    let n = start.matrix.nrows();
    let (mut kp, mut kd, mut damping) = (DVector::zeros(n), DVector::zeros(n), DVector::zeros(n));
    // A follower moves with its driver, `q = C u`: inertia and damping add to those of the driver.
    let mut coupling = DMatrix::identity(n, n);
    for (plan, &column) in plans.iter().zip(&start.columns) {
        damping[column] = plan.damping;
        if let Some(actuator) = plan.actuator {
            kp[column] = actuator.kp;
            kd[column] = actuator.kd;
        }
        let Some((driver, multiplier, _)) = plan.mimic else { continue };
        let driver = plans.iter().position(|p| p.joint == driver)?;
        coupling[(column, column)] = 0.0;
        coupling[(column, start.columns[driver])] = multiplier;
    }
    let free: Vec<usize> = (0..n).filter(|&i| coupling[(i, i)] != 0.0).collect();
    let coupling = coupling.select_columns(&free);
    let mass_matrix = coupling.transpose() * &start.matrix * &coupling;
    let damping = (coupling.transpose() * DMatrix::from_diagonal(&damping) * &coupling).diagonal();
    Some(stable_timestep(scheme, &mass_matrix, &kp.select_rows(&free), &kd.select_rows(&free), &damping))
}

/// Returns a warning if drives that are evaluated at the start of a step (MuJoCo's actuators and explicit models) are
/// unstable at the MuJoCo time step `dt` \[s\], at the start positions. In `plans`, only such drives may have gains.
/// `None` also if the dynamics cannot be computed.
pub fn warn_if_unstable(
    description: &RobotDescription,
    plans: &[JointPlan],
    floating_base: bool,
    dt: f64,
) -> Option<Diagnostic> {
    let largest = stable_timestep_of(Scheme::Explicit, description, plans, floating_base)?;
    (dt >= largest).then(|| {
        Diagnostic::new(
            DiagnosticKind::ActuatorUnstable,
            None,
            format!(
                "robot {:?}: explicit actuators with these gains and torque-speed lines are stable below a time step of \
                 {largest:.3e} s at the start positions, but the time step is {dt} s; use DriveModel::Implicit, smaller gains \
                 or more substeps",
                description.name
            ),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For one joint, `h² kp + 2 h kd = 4 M` has the positive root `h = (sqrt(kd² + 4 M kp) - kd) / kp`; implicit
    /// damping turns the sign of kd. The simulated recurrences decay just below the bound and grow just above it.
    #[test]
    fn stable_timestep_of_one_joint() {
        let (m, kp, kd) = (0.3, 200.0, 4.0_f64);
        for (scheme, sign) in [(Scheme::Explicit, 1.0), (Scheme::ImplicitDamping, -1.0)] {
            let expected = ((kd * kd + 4.0 * m * kp).sqrt() - sign * kd) / kp;
            let found = stable_timestep(
                scheme,
                &DMatrix::from_element(1, 1, m),
                &DVector::from_element(1, kp),
                &DVector::from_element(1, kd),
                &DVector::zeros(1),
            );
            assert!((found / expected - 1.0).abs() < 1e-6, "{scheme:?}: {found} {expected}");
            for (factor, decays) in [(0.99, true), (1.01, false)] {
                let h = factor * found;
                let (mut q, mut v) = (1.0, 0.0);
                for _ in 0..5000 {
                    v = match scheme {
                        Scheme::Explicit => v - h / m * (kp * q + kd * v),
                        Scheme::ImplicitDamping => (m * v - h * kp * q) / (m + h * kd),
                    };
                    q += h * v;
                }
                assert_eq!(q.abs() + h * v.abs() < 1.0, decays, "{scheme:?}, factor {factor}: q {q:e}");
            }
        }
    }
}

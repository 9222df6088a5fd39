//! Order of convergence: e(h) = C hᵖ, so p = log₂(e(2h)/e(h)). The reference solution is that of the same equations in
//! much smaller steps: the order shows the rate of convergence, and other laws, in closed form, show the limit.

use crate::articulated::double_pendulum_energy;
use crate::lab::*;
use kinetoscope::sim::Integrator;
use std::f64::consts::{FRAC_PI_2, LN_2};

/// Initial angles \[rad\] and velocities \[rad/s\] of the double pendulum's joints.
pub(super) const START: ([f64; 2], [f64; 2]) = ([FRAC_PI_2, 0.3], [1.0, -2.0]);
/// Duration of the motion \[s\].
pub(super) const TIME: f64 = 0.512;
/// Time step of the reference solution \[s\].
pub(super) const FINE: f64 = 1.25e-4;

/// Angles of a double pendulum after half a second.
pub(super) fn double_pendulum(integrator: Integrator, dt: f64) -> Vec<f64> {
    let mut lab = Lab::new(SimulationManagerCfg { integrator, ..with_dt(dt, earth()) });
    let robot = lab.mechanism(&double_pendulum_energy::text());
    lab.write_joints(robot, &START.0, &START.1);
    lab.run(TIME);
    lab.q(robot)
}

/// Errors (h, e) of the solutions `of(h)` against the reference solution `reference`.
pub(super) fn errors(steps: &[f64], reference: &[f64], of: impl Fn(f64) -> Vec<f64>) -> Vec<[f64; 2]> {
    let error = |h: f64| of(h).iter().zip(reference).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    steps.iter().map(|&h| [h, error(h)]).collect()
}

/// The order from the last two errors, whose steps differ by a factor of two.
pub(super) fn order(errors: &[[f64; 2]]) -> f64 {
    let [[coarse, large], [fine, small]] = [errors[errors.len() - 2], errors[errors.len() - 1]];
    (large / small).ln() / (coarse / fine).ln()
}

/// Tolerance of the order `of_law`: the deviation of the order of an explicitly written integrator, and the effect of
/// rounding on the errors.
pub(super) fn order_tolerance(explicit_steps: &[[f64; 2]], of_law: f64, rounding: f64) -> f64 {
    // log₂(e₁/e₂): the relative error of the larger error is smaller.
    let smallest = explicit_steps[explicit_steps.len() - 1][1];
    (order(explicit_steps) - of_law).abs() + 2.0 * rounding / smallest / LN_2
}

/// The reference solution: RK4 in steps of an eighth of a millisecond, with an error of 1e-12.
pub(super) fn reference() -> Vec<f64> {
    double_pendulum(Integrator::Rk4, FINE)
}

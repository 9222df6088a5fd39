//! How fast an answer gets better with the step: e(h) = C hᵖ, so p = log₂(e(2h)/e(h)). The answer is
//! that of the same equations in much smaller steps: an order says how an integrator converges, and other laws, in closed
//! form, where to.

use crate::articulated::double_pendulum_energy;
use crate::lab::*;
use kinetoscope::sim::Integrator;
use std::f64::consts::{FRAC_PI_2, LN_2};

/// Angles of the joints of the double pendulum \[rad\], and their velocities \[rad/s\], at the start.
pub(super) const START: ([f64; 2], [f64; 2]) = ([FRAC_PI_2, 0.3], [1.0, -2.0]);
/// How long it swings \[s\].
pub(super) const TIME: f64 = 0.512;
/// The steps of the answer \[s\].
pub(super) const FINE: f64 = 1.25e-4;

/// Angles of a double pendulum half a second after it was let go from the horizontal, moving.
pub(super) fn double_pendulum(integrator: Integrator, dt: f64) -> Vec<f64> {
    let mut lab = Lab::new(SimulationManagerCfg { integrator, ..with_dt(dt, earth()) });
    let robot = lab.mechanism(&double_pendulum_energy::text());
    lab.write_joints(robot, &START.0, &START.1);
    lab.run(TIME);
    lab.q(robot)
}

/// Errors at the steps against an answer: (h, e).
pub(super) fn errors(steps: &[f64], answer: &[f64], of: impl Fn(f64) -> Vec<f64>) -> Vec<[f64; 2]> {
    let error = |h: f64| of(h).iter().zip(answer).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    steps.iter().map(|&h| [h, error(h)]).collect()
}

/// The order between the last two of the errors, whose steps halve.
pub(super) fn order(errors: &[[f64; 2]]) -> f64 {
    let [[coarse, large], [fine, small]] = [errors[errors.len() - 2], errors[errors.len() - 1]];
    (large / small).ln() / (coarse / fine).ln()
}

/// What the order `of_law` may be off by: that of the errors of an integrator whose steps are written out, and what rounding
/// changes errors by.
pub(super) fn off(written_out: &[[f64; 2]], of_law: f64, rounding: f64) -> f64 {
    // log₂(e₁/e₂): the larger of the two errors is off by less of itself.
    let smallest = written_out[written_out.len() - 1][1];
    (order(written_out) - of_law).abs() + 2.0 * rounding / smallest / LN_2
}

/// The answer: RK4 in steps of an eighth of a millisecond, off by 1e-12.
pub(super) fn reference() -> Vec<f64> {
    double_pendulum(Integrator::Rk4, FINE)
}

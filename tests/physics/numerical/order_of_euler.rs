//! Semi-implicit Euler is of order 1: half the step, half the error, on a double pendulum that swings wide.
//!
//! Tolerance: C h (1 + D h): the next term, at h = 0.5 ms and rates of 10 rad/s, is 1 % of the ratio, 0.02 of the order.
//! Control: Runge-Kutta has another.

use super::convergence::{double_pendulum, errors, order, reference};
use crate::law::law;
use kinetoscope::prelude::*;

#[test]
fn holds() {
    law(module_path!(), "e(h) = C h", |m| {
        let (steps, answer) = ([4e-3, 2e-3, 1e-3, 5e-4], reference());
        let euler = errors(&steps, &answer, |h| double_pendulum(Integrator::Euler, h));
        let implicit = errors(&steps, &answer, |h| double_pendulum(Integrator::Implicit, h));
        let coarse = [1.6e-2, 8e-3, 4e-3, 2e-3];
        let runge_kutta = errors(&coarse, &answer, |h| double_pendulum(Integrator::Rk4, h));
        m.row("order", "", 1.0, order(&euler), (0.02, "the next term of the error"));
        m.control("order", "with Runge-Kutta", order(&runge_kutta));
        let curves = [("Euler", euler), ("implicit", implicit), ("RK4", runge_kutta)];
        m.plot("Double pendulum after 0.512 s", ["step [s]", "error of the angles [rad]"], true, &curves);
    });
}

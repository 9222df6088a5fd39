//! Semi-implicit Euler is of order 1: half the step, half the error, on a double pendulum with large swings.
//!
//! Tolerance: the next terms of C h (1 + D h + ...), from the explicit steps of
//! [`double_pendulum`](super::double_pendulum), and rounding. The error itself equals that of these steps up to
//! rounding. Control: Runge-Kutta.

use super::convergence::{double_pendulum, errors, order, order_tolerance, reference};
use super::double_pendulum::{self as written_out, Method, rounding};
use crate::law::law;
use kinetoscope::sim::Integrator;

#[test]
fn holds() {
    law(module_path!(), "e(h) = C h", |m| {
        let (steps, answer) = ([4e-3, 2e-3, 1e-3, 5e-4], reference());
        let euler = errors(&steps, &answer, |h| double_pendulum(Integrator::Euler, h));
        let implicit = errors(&steps, &answer, |h| double_pendulum(Integrator::Implicit, h));
        let coarse = [1.6e-2, 8e-3, 4e-3, 2e-3];
        let runge_kutta = errors(&coarse, &answer, |h| double_pendulum(Integrator::Rk4, h));
        let expected = written_out::errors(&steps, Method::Euler);
        let next = (order_tolerance(&expected, 1.0, rounding(5e-4)), "the next terms of the error");
        m.row("order", "", 1.0, order(&euler), next);
        m.control("order", "with Runge-Kutta", order(&runge_kutta));
        m.row("error at 0.5 ms", "rad", expected[3][1], euler[3][1], (rounding(5e-4), "rounding of its steps"));
        m.control("error at 0.5 ms", "with implicit", implicit[3][1]);
        let curves = [("Euler", euler), ("implicit", implicit), ("RK4", runge_kutta)];
        m.plot("Double pendulum after 0.512 s", ["step [s]", "error of the angles [rad]"], true, &curves);
    });
}

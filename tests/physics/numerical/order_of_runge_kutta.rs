//! The classical Runge-Kutta integrator is of order 4: half the step, a sixteenth of the error.
//!
//! Tolerance: the next terms of the error, from the explicit steps of [`double_pendulum`](super::double_pendulum), and
//! rounding. The error itself equals that of these steps up to rounding. Control: Euler.

use super::convergence::{double_pendulum, errors, order, order_tolerance, reference};
use super::double_pendulum::{self as written_out, Method, rounding};
use crate::law::law;
use kinetoscope::sim::Integrator;

#[test]
fn holds() {
    law(module_path!(), "e(h) = C h⁴", |m| {
        let (steps, answer) = ([4e-3, 2e-3], reference());
        let found = errors(&steps, &answer, |h| double_pendulum(Integrator::Rk4, h));
        let expected = written_out::errors(&steps, Method::RungeKutta);
        let next = (order_tolerance(&expected, 4.0, rounding(2e-3)), "the next terms of the error");
        m.row("order", "", 4.0, order(&found), next);
        let euler = errors(&steps, &answer, |h| double_pendulum(Integrator::Euler, h));
        m.control("order", "with Euler", order(&euler));
        m.row("error at 2 ms", "rad", expected[1][1], found[1][1], (rounding(2e-3), "rounding of its steps"));
        m.control("error at 2 ms", "with Euler", euler[1][1]);
    });
}

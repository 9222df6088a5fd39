//! The classical Runge-Kutta integrator is of order 4: half the step, a sixteenth of the error.
//!
//! Tolerance: the next term, D h at rates of up to 15 rad/s and h = 1 ms, is 1.5 % of the ratio and 0.022 of the order. The
//! error itself: (λ h)⁴/120 per radian, with λ = 10/s and 5 rad, 7e-9. Control: Euler.

use super::convergence::{double_pendulum, errors, order, reference};
use crate::law::law;
use kinetoscope::prelude::*;

#[test]
fn holds() {
    law(module_path!(), "e(h) = C h⁴", |m| {
        let answer = reference();
        let found = errors(&[2e-3, 1e-3], &answer, |h| double_pendulum(Integrator::Rk4, h));
        m.row("order", "", 4.0, order(&found), (0.022, "the next term of the error"));
        let euler = errors(&[4e-3, 2e-3], &answer, |h| double_pendulum(Integrator::Euler, h));
        m.control("order", "with Euler", order(&euler));
        m.row("error at 2 ms", "rad", 0.0, found[0][1], (7e-9, "(λ h)⁴/120 per radian, λ = 10/s"));
        m.control("error at 2 ms", "with Euler", euler[1][1]);
    });
}

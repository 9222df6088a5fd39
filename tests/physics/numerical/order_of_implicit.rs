//! The integrators that are implicit in velocity are of order 1, too: `implicit`, and on 4.x `implicitfast`, which leaves
//! the Coriolis terms out of the derivative and not out of the answer.
//!
//! Tolerance: as for `order_of_euler`, 0.02.

use super::convergence::{double_pendulum, errors, order, reference};
use crate::law::law;
use kinetoscope::prelude::*;
use kinetoscope::sim::mj::{TARGET, Target};

#[test]
fn holds() {
    law(module_path!(), "e(h) = C h", |m| {
        let (steps, answer) = ([1e-3, 5e-4], reference());
        let mut integrators = vec![("implicit", Integrator::Implicit)];
        if TARGET == Target::V4 {
            integrators.push(("implicitfast", Integrator::ImplicitFast));
        }
        for (name, integrator) in integrators {
            let found = errors(&steps, &answer, |h| double_pendulum(integrator, h));
            let quantity = format!("order of {name}");
            m.row(&quantity, "", 1.0, order(&found), (0.02, "the next term of the error"));
            let other = errors(&[4e-3, 2e-3], &answer, |h| double_pendulum(Integrator::Rk4, h));
            m.control(&quantity, "with Runge-Kutta", order(&other));
        }
        m.lines_differ("implicitfast is an integrator of 4.x");
    });
}

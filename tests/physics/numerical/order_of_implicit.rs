//! The velocity-implicit integrators are of order 1 too: `implicit`, and on 4.x `implicitfast`. The latter leaves the
//! Coriolis terms out of the derivative but not out of the forces: without damping it equals Euler.
//!
//! Tolerance: as for `order_of_euler`.

use super::convergence::{double_pendulum, errors, order, order_tolerance, reference};
use super::double_pendulum::{self as written_out, Method, rounding};
use crate::law::law;
use kinetoscope::mujoco::{BUILD_VERSION, SupportedVersion};
use kinetoscope::sim::Integrator;

#[test]
fn holds() {
    law(module_path!(), "e(h) = C h", |m| {
        let (steps, answer) = ([1e-3, 5e-4], reference());
        let mut integrators = vec![("implicit", Integrator::Implicit, Method::Implicit)];
        if BUILD_VERSION == SupportedVersion::V4 {
            integrators.push(("implicitfast", Integrator::ImplicitFast, Method::Euler));
        }
        for (name, integrator, same) in integrators {
            let found = errors(&steps, &answer, |h| double_pendulum(integrator, h));
            let expected = written_out::errors(&steps, same);
            let quantity = format!("order of {name}");
            let next = (order_tolerance(&expected, 1.0, rounding(5e-4)), "the next terms of the error");
            m.row(&quantity, "", 1.0, order(&found), next);
            let other = errors(&[4e-3, 2e-3], &answer, |h| double_pendulum(Integrator::Rk4, h));
            m.control(&quantity, "with Runge-Kutta", order(&other));
            let quantity = format!("error of {name} at 0.5 ms");
            m.row(&quantity, "rad", expected[1][1], found[1][1], (rounding(5e-4), "rounding of its steps"));
            m.control(&quantity, "at 1 ms", found[0][1]);
        }
        m.versions_differ("implicitfast is an integrator of 4.x");
    });
}

//! RK4 of the orientation of a free body. Orientations do not add: within a step, 4.x advances them by a
//! Runge-Kutta-Munthe-Kaas method of order 4; 2.2.2 adds angular velocities of different axes, which leaves order 2.
//!
//! Tolerance: the next terms of the error, from the explicit steps of [`free_rotation`](super::free_rotation) for
//! either version, and rounding of half a digit of a quaternion in each step.

use super::convergence::{errors, order, order_tolerance};
use super::free_rotation;
use crate::lab::*;
use kinetoscope::mujoco::{BUILD_VERSION, SupportedVersion};
use kinetoscope::sim::Integrator;

const MOMENTS: [f64; 3] = [0.01, 0.02, 0.025];
const SPIN: [f64; 3] = [4.0, 1.0, 5.5];
const TIME: f64 = 1.024;
/// Time step of the reference solution \[s\]. Its error is 1e-11 with order 4; with order 2 a thousandth of the
/// smallest error below.
const FINE: f64 = 2.5e-4;

/// The quaternion of a free body after 1.024 s.
fn orientation(integrator: Integrator, dt: f64) -> Vec<f64> {
    let mut lab = Lab::new(SimulationManagerCfg { integrator, ..with_dt(dt, weightless()) });
    let robot = lab.free(&urdf(&[Link::new("body", 1.0, MOMENTS)], &[]), [0.0; 3]);
    lab.write_root_velocity(robot, [0.0; 3], SPIN);
    lab.run(TIME);
    lab.root(robot).rotation.coords.as_slice().to_vec()
}

#[test]
fn holds() {
    law(module_path!(), "e(h) = C h⁴ (4.x), C h² (2.2.2)", |m| {
        let (of_law, corrected) = if BUILD_VERSION == SupportedVersion::V4 { (4.0, true) } else { (2.0, false) };
        let answer = orientation(Integrator::Rk4, FINE);
        let steps = [6.4e-2, 3.2e-2, 1.6e-2, 8e-3];
        let found = errors(&steps, &answer, |h| orientation(Integrator::Rk4, h));
        let euler = errors(&steps, &answer, |h| orientation(Integrator::Euler, h));
        let written_out = |h| free_rotation::orientation(MOMENTS, SPIN, TIME, h, corrected);
        let expected = errors(&steps, &written_out(FINE), written_out);
        let rounding = (TIME / 8e-3 + TIME / FINE) * f64::EPSILON / 2.0;
        let next = (order_tolerance(&expected, of_law, rounding), "the next terms of the error");
        m.row("order", "", of_law, order(&found), next);
        m.control("order", "with Euler", order(&euler));
        let (is, was) = (found[3][1], expected[3][1]);
        m.row("error at 8 ms", "", was, is, (2.0 * rounding, "rounding of its steps"));
        m.control("error at 8 ms", "at 16 ms", found[2][1]);
        let curves = [("RK4", found), ("Euler", euler)];
        m.plot("Torque-free top after 1.024 s", ["step [s]", "error of the quaternion"], true, &curves);
        m.versions_differ("4.x integrates orientations with order 4 since its RK4 was mended; 2.2.2 has order 2");
    });
}

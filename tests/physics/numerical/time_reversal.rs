//! Time reversal: a double pendulum swings for a second, its velocities are reversed, and after another second it is at
//! its start, at rest.
//!
//! Tolerance: the error of 1000 RK4 steps forward and 1000 back, from the explicit steps of
//! [`double_pendulum`](super::double_pendulum). It is smaller than the error of the single steps: RK4 is of even order,
//! so the backward step cancels the first error term of the forward step. Rounding adds half a digit of each state
//! variable in each step, propagated to the end. Control: Euler, whose error is not canceled.

use super::double_pendulum::{Method, RodState, integrate};
use crate::articulated::double_pendulum_energy;
use crate::lab::*;

const START: [f64; 2] = [1.3, -0.4];
const STEP: f64 = 1e-3;
const STEPS: usize = 1_000;

/// Largest errors of the angles and of the velocities.
fn errors((q, v): ([f64; 2], [f64; 2])) -> [f64; 2] {
    [max_or_nan((q[0] - START[0]).abs(), (q[1] - START[1]).abs()), max_or_nan(v[0].abs(), v[1].abs())]
}

/// Angles and velocities of the joints after the way forth and back.
fn final_state(cfg: SimulationManagerCfg) -> ([f64; 2], [f64; 2]) {
    let mut lab = Lab::new(with_dt(STEP, cfg));
    let robot = lab.mechanism(&double_pendulum_energy::text());
    let pair = |of: Vec<f64>| [of[0], of[1]];
    lab.write_joints(robot, &START, &[0.0, 0.0]);
    lab.run(1.0);
    let (q, v) = (lab.q(robot), lab.v(robot));
    lab.write_joints(robot, &q, &[-v[0], -v[1]]);
    lab.run(1.0);
    (pair(lab.q(robot)), pair(lab.v(robot)))
}

/// The same with explicit steps: errors of the angles \[rad\] and velocities \[rad/s\], including the bound of
/// rounding.
fn error_bound() -> [f64; 2] {
    // A backward step equals a forward step of the pendulum with reversed velocities.
    let sizes = [[STEP; STEPS], [-STEP; STEPS]].concat();
    let (end, rounding) = integrate(RodState::from_joints(START, [0.0; 2]), Method::RungeKutta, &sizes);
    let left = errors(end.joints());
    [left[0] + rounding[0], left[1] + rounding[1]]
}

#[test]
fn holds() {
    law(module_path!(), "x(t, -v(t)) after t = x(0)", |m| {
        let ([q, v], [euler_q, euler_v]) = (errors(final_state(rk4(earth()))), errors(final_state(earth())));
        let [left_q, left_v] = error_bound();
        let why = "what 2000 steps of RK4 leave, and rounding";
        m.row("largest error of an angle", "rad", 0.0, q, (left_q, why));
        m.row("largest error of a velocity", "rad/s", 0.0, v, (left_v, why));
        m.control("largest error of an angle", "with Euler", euler_q);
        m.control("largest error of a velocity", "with Euler", euler_v);
    });
}

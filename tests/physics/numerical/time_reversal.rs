//! Mechanics runs backwards as well: a double pendulum swings for a second, its velocities are turned round, and after
//! another second it is where it started, at rest.
//!
//! Tolerance: RK4's (λ h)⁴/120 per radian, with λ = 10/s and 20 rad 1.7e-9, times what a second of a pendulum that swings
//! wide makes of it, some e³: 3e-8 rad, and ten times that in velocities. Euler is of order 1.

use crate::articulated::double_pendulum_energy;
use crate::lab::*;
use crate::law::{law, worse};
use kinetoscope::prelude::*;

const START: [f64; 2] = [1.3, -0.4];

/// Largest errors of the angles and of the velocities.
fn returned(cfg: SimulationManagerCfg) -> [f64; 2] {
    let mut lab = Lab::new(cfg);
    let robot = lab.mechanism(&double_pendulum_energy::text());
    lab.write_joints(robot, &START, &[0.0, 0.0]);
    lab.run(1.0);
    let (q, v) = (lab.q(robot), lab.v(robot));
    lab.write_joints(robot, &q, &[-v[0], -v[1]]);
    lab.run(1.0);
    let (q, v) = (lab.q(robot), lab.v(robot));
    [worse((q[0] - START[0]).abs(), (q[1] - START[1]).abs()), worse(v[0].abs(), v[1].abs())]
}

#[test]
fn holds() {
    law(module_path!(), "x(t, -v(t)) after t = x(0)", |m| {
        let ([q, v], [euler_q, euler_v]) = (returned(rk4(earth())), returned(earth()));
        m.row("largest error of an angle", "rad", 0.0, q, (3e-8, "RK4 at 1 ms"));
        m.row("largest error of a velocity", "rad/s", 0.0, v, (3e-7, "RK4 at 1 ms, times 10 rad/s"));
        m.control("largest error of an angle", "with Euler", euler_q);
        m.control("largest error of a velocity", "with Euler", euler_v);
    });
}

//! A falling body. Semi-implicit Euler gives v(n) = -g h n and z(n) = z(0) - h Σ g h k = z(0) - g h² n (n + 1)/2
//! exactly; a Runge-Kutta step of a constant acceleration is exact too: z(t) = z(0) - g t²/2.
//!
//! Tolerance: rounding, 1000 sums of numbers below 10, each off by at most 1e-15.

use crate::lab::*;

/// Height after a second of fall from 6 m.
fn height(cfg: SimulationManagerCfg) -> f64 {
    let mut lab = Lab::new(cfg);
    let robot = lab.free(&urdf(&[Link::brick("body", 2.0, [0.1, 0.2, 0.3])], &[]), [0.0, 0.0, 6.0]);
    lab.run(1.0);
    lab.root(robot).position.z
}

#[test]
fn holds() {
    law(module_path!(), "Euler: z = z0 - g t (t + h)/2; RK4: z = z0 - g t²/2", |m| {
        let rounding = (1e-12, "rounding of 1000 sums");
        m.row("height after 1 s, Euler", "m", 6.0 - G * 1.001 / 2.0, height(earth()), rounding);
        m.row("height after 1 s, RK4", "m", 6.0 - G / 2.0, height(rk4(earth())), rounding);
        m.control("height after 1 s, Euler", "without gravity", height(weightless()));
        m.control("height after 1 s, RK4", "with the other integrator", height(earth()));
    });
}

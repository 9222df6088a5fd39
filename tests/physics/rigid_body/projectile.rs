//! A thrown body. Semi-implicit Euler gives v(n) = v0 + a h n and x(n) = x0 + v0 h n + a h² n (n + 1)/2 exactly. With
//! v0z = g h (N + 1)/2 the body returns to its height after N steps, at the range v0x N h. It is highest when its
//! velocity changes sign, after n = (N + 1)/2 steps (or half a step off), at v0z²/(2 g) minus the effect of half a
//! step.
//!
//! Tolerance: rounding, 1200 sums of numbers below 10.

use crate::lab::*;

const STEPS: u32 = 1201;
const THROW: [f64; 2] = [3.0, -2.0];

/// Position after the steps, and the greatest height.
fn flight(cfg: SimulationManagerCfg) -> ([f64; 3], f64) {
    let mut lab = Lab::new(cfg);
    let robot = lab.free(&urdf(&[Link::brick("body", 0.7, [0.1, 0.2, 0.3])], &[]), [0.0; 3]);
    let up = G * lab.dt() * f64::from(STEPS + 1) / 2.0;
    lab.write_root_velocity(robot, [THROW[0], THROW[1], up], [0.0; 3]);
    let mut apex = 0.0_f64;
    lab.run_with(STEPS, |_, sim| apex = max_or_nan(apex, root(sim, robot).position.z));
    (lab.root(robot).position.into(), apex)
}

#[test]
fn holds() {
    law(module_path!(), "range: v0x t with t = 2 v0z/g - h; apex: v0z²/(2 g) - v0z h/2", |m| {
        let rounding = (1e-12, "rounding of 1201 sums");
        let ([x, y, z], apex) = flight(earth());
        let (h, n) = (1e-3, f64::from(STEPS));
        m.row("range along x", "m", THROW[0] * n * h, x, rounding);
        m.row("range along y", "m", THROW[1] * n * h, y, rounding);
        m.row("height after the flight", "m", 0.0, z, rounding);
        let up = G * h * (n + 1.0) / 2.0;
        // The heights at n = (N + 1)/2 - 1 and (N + 1)/2 are equal: v(n) = 0 at the second.
        m.row("apex", "m", up * up / (2.0 * G) - up * h / 2.0, apex, rounding);
        let (place, high) = flight(weightless());
        m.control("height after the flight", "without gravity", place[2]);
        m.control("apex", "without gravity", high);
        let long = flight(with_dt(2e-3, earth())).0;
        m.control("range along x", "with twice the step", long[0]);
        m.control("range along y", "with twice the step", long[1]);
    });
}

//! A rod hinged at one end falls from the horizontal: θ'' = m g L/2/(m L²/3) = 3 g/(2 L). Its tip falls with 3/2 g,
//! faster than a free body. Energy: ω² = 3 g sin θ/L at the angle θ below the horizontal.
//!
//! Tolerance of the first step: 20 roundings of half a digit between the file and the velocity of the tip. Tolerance
//! after 0.4 s: the error of the classical Runge-Kutta method, from its steps for this equation written without MuJoCo,
//! and rounding of four half digits in each of 400 steps.

use crate::lab::*;

const LENGTH: f64 = 1.4;

/// Acceleration of the tip in the first step, and angle and velocity after 0.4 s.
fn fall(moment: f64) -> [f64; 3] {
    let text = {
        let rod = Link::new("rod", 0.6, [1e-4, moment, moment]).at([LENGTH / 2.0, 0.0, 0.0]);
        let links = [base(), rod, Link::new("tip", 0.0, [0.0; 3])];
        let end = Joint::fixed("end", ["rod", "tip"]).at([LENGTH, 0.0, 0.0]);
        urdf(&links, &[Joint::hinge("hinge", ["base", "rod"], [0.0, 1.0, 0.0]), end])
    };
    let fallen = |cfg: SimulationManagerCfg, seconds: f64| {
        let mut lab = Lab::new(cfg);
        let robot = lab.mechanism(&text);
        lab.run(seconds);
        let tip = lab.sim.robot(robot).link_velocity("tip").unwrap();
        (tip[(0, 2)], lab.q(robot)[0], lab.v(robot)[0])
    };
    let (velocity, angle, _) = fallen(earth(), 1e-3);
    let (_, q, v) = fallen(rk4(earth()), 0.4);
    // The tip has rotated by the angle of the step.
    [velocity / 1e-3 / angle.cos(), q, v]
}

/// Relative error of ω against √(3 g sin θ/L) after 0.4 s by the classical Runge-Kutta method.
fn runge_kutta() -> f64 {
    let h = 1e-3;
    let rate = |[angle, velocity]: [f64; 2]| [velocity, 1.5 * G / LENGTH * angle.cos()];
    let moved = |[q, v]: [f64; 2], [dq, dv]: [f64; 2], h: f64| [q + h * dq, v + h * dv];
    let mut x = [0.0, 0.0];
    for _ in 0..400 {
        let a = rate(x);
        let b = rate(moved(x, a, 0.5 * h));
        let c = rate(moved(x, b, 0.5 * h));
        let d = rate(moved(x, c, h));
        x = [0, 1].map(|k: usize| x[k] + h / 6.0 * (a[k] + 2.0 * b[k] + 2.0 * c[k] + d[k]));
    }
    x[1] / (3.0 * G * x[0].sin() / LENGTH).sqrt() - 1.0
}

#[test]
fn holds() {
    law(module_path!(), "tip: a = 3/2 g; ω² = 3 g sin θ/L", |m| {
        let moment = 0.6 * LENGTH * LENGTH / 12.0;
        let [tip, angle, velocity] = fall(moment);
        m.row("acceleration of the tip", "m/s²", -1.5 * G, tip, (10.0 * f64::EPSILON * 1.5 * G, "rounding"));
        let of_law = |angle: f64, velocity: f64| velocity / (3.0 * G * angle.sin() / LENGTH).sqrt();
        let steps = runge_kutta().abs() + 400.0 * 4.0 * f64::EPSILON / 2.0;
        m.row("velocity after 0.4 s, of √(3 g sin θ/L)", "", 1.0, of_law(angle, velocity), (steps, "RK4"));
        // A point mass at the middle: the angular acceleration is g/(L/2), and the tip falls with 2 g.
        let [light, point_angle, point_velocity] = fall(1e-3 * moment);
        m.control("acceleration of the tip", "with the mass in the middle", light);
        let other = of_law(point_angle, point_velocity);
        m.control("velocity after 0.4 s, of √(3 g sin θ/L)", "with the mass in the middle", other);
    });
}

//! Two equal pendulums, one below the other, have two modes: ω² = (2 ∓ √2) g/L. In these modes the lower pendulum
//! swings ±√2 as far as the upper, both angles measured from the vertical. A motion started in one mode stays in that
//! mode: θ₁ = ε cos ω t.
//!
//! Tolerance: the motion is linear up to ε² of itself, which shifts ω t by about ε² ω t: 2e-7 of ε = 1e-4 rad; 1e-6.

use crate::lab::*;

const LENGTH: f64 = 0.5;
const SMALL: f64 = 1e-4;

/// Angles from the vertical after 2 s, started with the lower angle at `ratio` times the upper.
fn final_angles(ratio: f64) -> [f64; 2] {
    let bob = |name| Link::point(name, 0.7, [0.0, 0.0, -LENGTH]);
    let upper = Joint::hinge("upper", ["base", "a"], [0.0, 1.0, 0.0]);
    let lower = Joint::hinge("lower", ["a", "b"], [0.0, 1.0, 0.0]).at([0.0, 0.0, -LENGTH]);
    let mut lab = Lab::new(rk4(earth()));
    let robot = lab.mechanism(&urdf(&[base(), bob("a"), bob("b")], &[upper, lower]));
    lab.write_joints(robot, &[SMALL, (ratio - 1.0) * SMALL], &[0.0, 0.0]);
    lab.run(2.0);
    let q = lab.q(robot);
    [q[0], q[0] + q[1]]
}

#[test]
fn holds() {
    law(module_path!(), "ω² = (2 ∓ √2) g/L with θ₂/θ₁ = ±√2", |m| {
        let root = 2.0_f64.sqrt();
        for (name, sign) in [("slow", 1.0), ("fast", -1.0)] {
            let omega = ((2.0 - sign * root) * G / LENGTH).sqrt();
            let [upper, lower] = final_angles(sign * root);
            let swing = SMALL * (2.0 * omega).cos();
            let linear = (1e-6 * SMALL, "terms of third order, ε² ω t");
            m.row(&format!("upper angle after 2 s, {name} mode"), "rad", swing, upper, linear);
            m.row(&format!("lower angle after 2 s, {name} mode"), "rad", sign * root * swing, lower, linear);
            let [off_upper, off_lower] = final_angles(sign * 1.4);
            m.control(&format!("upper angle after 2 s, {name} mode"), "started 1 % off the mode", off_upper);
            m.control(&format!("lower angle after 2 s, {name} mode"), "started 1 % off the mode", off_lower);
        }
    });
}

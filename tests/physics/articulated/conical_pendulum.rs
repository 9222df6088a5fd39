//! A conical pendulum: Ω² = g/(L cos θ) keeps its angle. The pivot consists of a hinge about the vertical, carried by a
//! weightless ring, and a horizontal hinge.
//!
//! Tolerance: the moments of ring and bob are the same about all axes, so they do not affect a steady motion. Rounding
//! of 3000 sums of up to 13 rad, 2e-15 each: 1e-11.

use crate::lab::*;

const LENGTH: f64 = 0.8;
const ANGLE: f64 = 0.9;

/// Angle about the vertical and angle of the cone after 3 s, started with the share `part` of the steady velocity.
fn final_angles(part: f64) -> [f64; 2] {
    let omega = part * (G / (LENGTH * ANGLE.cos())).sqrt();
    let mut lab = Lab::new(rk4(earth()));
    let links = [base(), Link::point("ring", 1e-6, [0.0; 3]), Link::point("bob", 1.3, [0.0, 0.0, -LENGTH])];
    let round = Joint::hinge("round", ["base", "ring"], [0.0, 0.0, 1.0]);
    let robot = lab.mechanism(&urdf(&links, &[round, Joint::hinge("cone", ["ring", "bob"], [0.0, 1.0, 0.0])]));
    lab.write_joints(robot, &[0.0, ANGLE], &[omega, 0.0]);
    lab.run(3.0);
    let q = lab.q(robot);
    [q[0], q[1]]
}

#[test]
fn holds() {
    law(module_path!(), "Ω² = g/(L cos θ)", |m| {
        let omega = (G / (LENGTH * ANGLE.cos())).sqrt();
        let ([round, cone], [slow, low]) = (final_angles(1.0), final_angles(0.95));
        let rounding = (1e-11, "rounding of 3000 steps");
        m.row("angle gone round in 3 s", "rad", 3.0 * omega, round, rounding);
        m.row("angle of the cone after 3 s", "rad", ANGLE, cone, rounding);
        m.control("angle gone round in 3 s", "5 % slower", slow);
        m.control("angle of the cone after 3 s", "5 % slower", low);
    });
}

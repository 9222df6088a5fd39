//! A heavy symmetric top on a point, leaning by θ, that precesses steadily with Ω needs the spin ω₃ about its axis with
//! `m g l = Ω (I₃ ω₃ - I₁ Ω cos θ)`, I₁ being the moment across the axis about the point. It then goes on so: the lean stays,
//! and after t the top has gone round by Ω t. The point is three hinges (precession, lean, spin) with rings between them.
//!
//! Tolerance: the rings' moments are the same about all axes, so that they have no gyroscopic torque, and nothing else in a
//! steady motion; RK4 of a motion that is steady; rounding of 2000 sums of up to 300 rad, 1e-13 each: 1e-10.

use crate::lab::*;

const MASS: f64 = 0.5;
const ARM: f64 = 0.1;
const LEAN: f64 = 1.0;
const PRECESSION: f64 = 2.0;
/// Across and along the axis, about the centre of mass.
const MOMENTS: [f64; 2] = [1.2e-3, 2e-3];

/// Angle gone round and lean after 2 s of a top whose spin is `share` of what is steady.
fn spun(share: f64) -> [f64; 2] {
    let across = MOMENTS[0] + MASS * ARM * ARM;
    let steady = (MASS * G * ARM / PRECESSION + across * PRECESSION * LEAN.cos()) / MOMENTS[1];
    let ring = |name| Link::point(name, 1e-6, [0.0; 3]);
    let top = Link::new("top", MASS, [MOMENTS[0], MOMENTS[0], MOMENTS[1]]).at([0.0, 0.0, ARM]);
    let joints = [
        Joint::hinge("precession", ["base", "ring"], [0.0, 0.0, 1.0]),
        Joint::hinge("lean", ["ring", "fork"], [1.0, 0.0, 0.0]),
        Joint::hinge("spin", ["fork", "top"], [0.0, 0.0, 1.0]),
    ];
    let mut lab = Lab::new(rk4(earth()));
    let robot = lab.mechanism(&urdf(&[base(), ring("ring"), ring("fork"), top], &joints));
    // ω₃ is the spin of the joint and what the precession has along the axis.
    let spin = share * steady - PRECESSION * LEAN.cos();
    lab.write_joints(robot, &[0.0, LEAN, 0.0], &[PRECESSION, 0.0, spin]);
    lab.run(2.0);
    let q = lab.q(robot);
    [q[0], q[1]]
}

#[test]
fn holds() {
    law(module_path!(), "m g l = Ω (I₃ ω₃ - I₁ Ω cos θ)", |m| {
        let ([round, lean], [slow, falls]) = (spun(1.0), spun(0.5));
        let rings = (1e-10, "rounding of 2000 steps");
        m.row("angle gone round in 2 s", "rad", PRECESSION * 2.0, round, rings);
        m.row("lean after 2 s", "rad", LEAN, lean, rings);
        m.control("angle gone round in 2 s", "with half of the spin", slow);
        m.control("lean after 2 s", "with half of the spin", falls);
    });
}

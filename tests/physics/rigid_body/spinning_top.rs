//! A heavy symmetric top on a point, tilted by θ, precesses steadily with Ω if the spin ω₃ about its axis satisfies `m
//! g l = Ω (I₃ ω₃ - I₁ Ω cos θ)`, where I₁ is the moment across the axis about the point. The tilt then stays constant,
//! and after t the top has precessed by Ω t. The point is modeled by three hinges (precession, tilt, spin) with rings
//! between them.
//!
//! Tolerance: the rings' moments are the same about all axes, so they have no gyroscopic torque and no effect on a
//! steady motion. RK4 of a steady motion; rounding of 2000 sums of up to 300 rad, 1e-13 each: 1e-10.

use crate::lab::*;

const MASS: f64 = 0.5;
const ARM: f64 = 0.1;
const LEAN: f64 = 1.0;
const PRECESSION: f64 = 2.0;
/// Moments across and along the axis, about the center of mass \[kg m²\].
const MOMENTS: [f64; 2] = [1.2e-3, 2e-3];

/// Precession angle and tilt after 2 s of a top with the fraction `share` of the steady spin.
fn precession_and_tilt(share: f64) -> [f64; 2] {
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
    // ω₃ is the velocity of the spin joint plus the component of the precession along the axis.
    let spin = share * steady - PRECESSION * LEAN.cos();
    lab.write_joints(robot, &[0.0, LEAN, 0.0], &[PRECESSION, 0.0, spin]);
    lab.run(2.0);
    let q = lab.q(robot);
    [q[0], q[1]]
}

#[test]
fn holds() {
    law(module_path!(), "m g l = Ω (I₃ ω₃ - I₁ Ω cos θ)", |m| {
        let ([round, lean], [slow, falls]) = (precession_and_tilt(1.0), precession_and_tilt(0.5));
        let rings = (1e-10, "rounding of 2000 steps");
        m.row("angle gone round in 2 s", "rad", PRECESSION * 2.0, round, rings);
        m.row("lean after 2 s", "rad", LEAN, lean, rings);
        m.control("angle gone round in 2 s", "with half of the spin", slow);
        m.control("lean after 2 s", "with half of the spin", falls);
    });
}

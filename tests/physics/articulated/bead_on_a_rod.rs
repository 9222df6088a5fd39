//! A bead on a rod that rotates with Ω moves outward: r'' = Ω² r, so r = r₀ cosh Ω t, and the rotation of the rod takes
//! the torque 2 m r r' Ω. The rod is a platform of 1e6 kg m², which the bead hardly slows.
//!
//! Tolerance: the platform loses m (r² - r₀²)/I of Ω, 2e-6. The relative effect on the radius is Ω t tanh(Ω t) times
//! this: 1e-5 of r.

use crate::lab::*;

const PLATFORM: f64 = 1e6;
const MASS: f64 = 0.5;
const SPIN: f64 = 3.0;
const START: f64 = 0.2;

/// Radius and radial velocity after 1 s, and the angular momentum lost by the platform \[kg m²/s\].
fn radial_motion(spin: f64) -> [f64; 3] {
    let links = [base(), Link::new("platform", 1e3, [PLATFORM; 3]), Link::point("bead", MASS, [0.0; 3])];
    let turn = Joint::hinge("turn", ["base", "platform"], [0.0, 0.0, 1.0]);
    let rail = Joint::slide("rail", ["platform", "bead"], [1.0, 0.0, 0.0]);
    let mut lab = Lab::new(rk4(weightless()));
    let robot = lab.mechanism(&urdf(&links, &[turn, rail]));
    lab.write_joints(robot, &[0.0, START], &[spin, 0.0]);
    lab.run(1.0);
    let (q, v) = (lab.q(robot), lab.v(robot));
    [q[1], v[1], PLATFORM * (spin - v[0])]
}

#[test]
fn holds() {
    law(module_path!(), "r = r₀ cosh Ω t; ∫ 2 m r r' Ω dt = m (r² - r₀²) Ω", |m| {
        let [r, v, lost] = radial_motion(SPIN);
        let (radius, speed) = (START * SPIN.cosh(), START * SPIN * SPIN.sinh());
        let platform = (1e-5 * speed, "what the platform loses of Ω");
        m.row("radius after 1 s", "m", radius, r, platform);
        m.row("velocity after 1 s", "m/s", speed, v, platform);
        let torque = MASS * (radius * radius - START * START) * SPIN;
        // ω is 3 with 16 digits, times 1e6 kg m².
        let within = (1e-4 * torque, "rounding of ω times I");
        m.row("angular momentum that the platform lost", "kg m²/s", torque, lost, within);
        let [still, no_speed, kept] = radial_motion(0.0);
        m.control("radius after 1 s", "without the turn", still);
        m.control("velocity after 1 s", "without the turn", no_speed);
        m.control("angular momentum that the platform lost", "without the turn", kept);
    });
}

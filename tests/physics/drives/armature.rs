//! Rotor inertia J adds to the inertia of its own joint only: a torque τ accelerates a wheel by τ/(I + J). For two
//! wheels on one shaft, the second on the first, the torque τ of the second accelerates both by
//!
//! ```text
//! (I₁ + I₂) a₁ + I₂ a₂ = 0,   I₂ a₁ + (I₂ + J) a₂ = τ
//! ```
//!
//! The rotor has no weight: the sag of a driven lever is m g l cos q/k with and without it.
//!
//! Tolerance: constant accelerations, summed over 100 steps, to rounding; for the sag, e^-20 of the initial distance of
//! 0.1 rad.

use super::wheel::{MOMENT, Wheel};
use crate::lab::*;

const ROTOR: f64 = 0.02;
const SECOND: f64 = 0.03;
const TORQUE: f64 = 0.7;
const STIFFNESS: f64 = 50.0;

fn with_rotor(rotor: f64, drive: DriveCfg) -> DriveCfg {
    DriveCfg { armature: rotor.into(), ..drive }
}

/// Acceleration of one wheel, and of two coupled wheels of which only the second has a rotor.
fn accelerations(rotor: f64) -> [f64; 3] {
    let mut wheel = Wheel::new(weightless(), with_rotor(rotor, passive()));
    wheel.set_effort(TORQUE);
    wheel.lab.run(0.1);
    let z = [0.0, 0.0, 1.0];
    let links = [base(), Link::new("first", 1.0, [MOMENT; 3]), Link::new("second", 1.0, [SECOND; 3])];
    let joints = [Joint::hinge("a", ["base", "first"], z), Joint::hinge("b", ["first", "second"], z)];
    let mut lab = Lab::new(weightless());
    let drive = DriveCfg { armature: [("b", rotor)].into(), ..passive() };
    let robot = lab.robot(&urdf(&links, &joints), RobotCfg { drive, ..RobotCfg::default() });
    lab.set_joint_efforts(robot, &[0.0, TORQUE]);
    lab.run(0.1);
    let v = lab.v(robot);
    [wheel.v(), v[0], v[1]].map(|v| v / 0.1)
}

/// Position error of a lever's drive under its weight, as gravity torque over k \[rad\], and the angle.
fn sag(rotor: f64, mass: f64) -> [f64; 2] {
    let lever = Link::new("lever", mass, [0.01; 3]).at([0.3, 0.0, 0.0]);
    let mut lab = Lab::new(earth());
    let text = urdf(&[base(), lever], &[Joint::hinge("pivot", ["base", "lever"], [0.0, -1.0, 0.0])]);
    let drive = with_rotor(rotor, implicit(STIFFNESS, 10.0));
    let robot = lab.robot(&text, RobotCfg { drive, ..RobotCfg::default() });
    lab.run(5.0);
    let q = lab.q(robot)[0];
    [-q, q]
}

#[test]
fn holds() {
    law(module_path!(), "τ = (I + J) q''; m g l cos q = k (q* - q)", |m| {
        let ([alone, first, second], [bare, bare_first, bare_second]) = (accelerations(ROTOR), accelerations(0.0));
        let rounding = (1e-10, "rounding of 100 sums over 0.1 s");
        m.row("acceleration of a wheel", "rad/s²", TORQUE / (MOMENT + ROTOR), alone, rounding);
        let felt = (SECOND + ROTOR) * (MOMENT + SECOND) - SECOND * SECOND;
        m.row("acceleration of the first of two", "rad/s²", -SECOND * TORQUE / felt, first, rounding);
        m.row("acceleration of the second of two", "rad/s²", (MOMENT + SECOND) * TORQUE / felt, second, rounding);
        m.control("acceleration of a wheel", "without the rotor", bare);
        m.control("acceleration of the first of two", "without the rotor", bare_first);
        m.control("acceleration of the second of two", "without the rotor", bare_second);
        let ([found, angle], [heavy, _]) = (sag(ROTOR, 1.0), sag(ROTOR, 1.1));
        let expected = G * 0.3 * angle.cos() / STIFFNESS;
        m.row("sag of a lever", "rad", expected, found, (1e-9, "e^-20 of the way is left"));
        m.control("sag of a lever", "where the rotor had weight", heavy);
    });
}

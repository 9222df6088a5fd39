//! A skater pulls in the arms: a mass on a rotating platform is pulled inward along a rail, without external torque.
//! The angular momentum ω (I + m r²) is conserved, and the energy grows by the work done.
//!
//! Final radius: the spring k with the target a holds the mass on its circle, k (r - a) = m ω² r, which with ω = L/(I +
//! m r²) is one equation for r.
//!
//! Tolerance: RK4, (ω h)⁴ per radian: 1e-8 of ω, and as much of r. After 10 s, e^-35 of the motion is left.

use crate::lab::*;
use kinetoscope::sim::DriveModel;

const PLATFORM: f64 = 0.2;
const MASS: f64 = 1.5;

/// Angular velocity and radius after 10 s; the mass starts at 0.5 m with 2 rad/s, with its target at 0.1 m.
fn pulled_in(stiffness: f64) -> [f64; 2] {
    let links = [base(), Link::new("platform", 2.0, [0.1, 0.1, PLATFORM]), Link::point("mass", MASS, [0.0; 3])];
    let turn = Joint::hinge("turn", ["base", "platform"], [0.0, 0.0, 1.0]);
    let rail = Joint::slide("rail", ["platform", "mass"], [1.0, 0.0, 0.0]);
    let drive = DriveCfg {
        model: DriveModel::Actuator,
        stiffness: [("turn", 0.0), ("rail", stiffness)].into(),
        damping: [("turn", 0.0), ("rail", 0.3 * stiffness)].into(),
        ..DriveCfg::default()
    };
    let mut lab = Lab::new(rk4(weightless()));
    let robot = lab.robot(&urdf(&links, &[turn, rail]), RobotCfg { drive, ..RobotCfg::default() });
    lab.write_joints(robot, &[0.0, 0.5], &[2.0, 0.0]);
    lab.sim.robot_mut(robot).set_qpos_target(&row(&[0.0, 0.1]), None, None).unwrap();
    lab.run(10.0);
    [lab.v(robot)[0], lab.q(robot)[1]]
}

#[test]
fn holds() {
    law(module_path!(), "ω (I + m r²) = const", |m| {
        let [omega, radius] = pulled_in(300.0);
        let momentum = 2.0 * (PLATFORM + MASS * 0.25);
        let spin = |r: f64| momentum / (PLATFORM + MASS * r * r);
        // The right side changes by a fifth of the change of r, so the iteration converges.
        let end = (0..200).fold(0.1, |r, _| 300.0 * 0.1 / (300.0 - MASS * spin(r).powi(2)));
        let expected = spin(end);
        let left = pulled_in(0.0);
        m.row("radius, drawn in", "m", end, radius, (1e-8 * end, "RK4: (ω h)⁴ per radian"));
        m.control("radius, drawn in", "with the mass left where it is", left[1]);
        m.row("angular velocity, drawn in", "rad/s", expected, omega, (1e-8 * expected, "RK4: (ω h)⁴ per radian"));
        m.control("angular velocity, drawn in", "with the mass left where it is", left[0]);
    });
}

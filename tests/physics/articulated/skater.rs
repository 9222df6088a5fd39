//! A skater pulls in the arms: a mass on a turning platform is drawn in along a rail, and nothing turns the platform from
//! outside: ω (I + m r²) stays, and the energy grows by the work that is done.
//!
//! Tolerance: RK4, (ω h)⁴ per radian: 1e-8 of ω.

use crate::lab::*;
use crate::law::law;
use crate::urdf::{Joint, Link, base, urdf};
use kinetoscope::prelude::*;

const PLATFORM: f64 = 0.2;
const MASS: f64 = 1.5;

/// Angular velocity and radius after 3 s; the mass starts at 0.5 m with 2 rad/s, and is drawn to 0.1 m.
fn drawn(stiffness: f64) -> [f64; 2] {
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
    lab.sim.robot_mut(robot).set_qpos(&row(&[0.0, 0.1]), None, None).unwrap();
    lab.run(3.0);
    [lab.v(robot)[0], lab.q(robot)[1]]
}

#[test]
fn holds() {
    law(module_path!(), "ω (I + m r²) = const", |m| {
        let [omega, radius] = drawn(300.0);
        let expected = 2.0 * (PLATFORM + MASS * 0.25) / (PLATFORM + MASS * radius * radius);
        m.row("angular velocity, drawn in", "rad/s", expected, omega, (1e-7 * expected, "RK4: (ω h)⁴ per radian"));
        m.control("angular velocity, drawn in", "with the mass left where it is", drawn(0.0)[0]);
    });
}

//! The rotor of a gyroscope: a yaw drive rotates with Ω, a pitch drive holds the rotor level, and the rotor spins with
//! ω about its axis, which rotates with the yaw. The angular momentum I ω rotates with it: dL/dt = Ω x I ω, a torque I
//! ω Ω about the pitch axis.
//!
//! Tolerance: the pitch drive sags by δ = τ/kp = 1.2e-4 rad, so that the wrist's other moments leave their principal
//! axes: I Ω² δ = 5e-6 N m. The yaw drive has settled after 2 s.

use crate::lab::*;

const ROTOR: f64 = 0.02;
const YAW: f64 = 1.5;
const SPIN: f64 = 40.0;

/// Efforts of the yaw and the pitch drive after `seconds`, and the spin of the rotor.
fn efforts_and_spin(yaw: f64, spin: f64, seconds: f64) -> [f64; 3] {
    let across = 0.6 * ROTOR;
    let links = [
        base(),
        Link::new("yaw_link", 1.0, [0.01; 3]),
        Link::new("pitch_link", 1.0, [0.01; 3]),
        Link::new("rotor", 1.0, [ROTOR, across, across]),
    ];
    let joints = [
        Joint::hinge("yaw", ["base", "yaw_link"], [0.0, 0.0, 1.0]),
        Joint::hinge("pitch", ["yaw_link", "pitch_link"], [0.0, 1.0, 0.0]),
        Joint::hinge("spin", ["pitch_link", "rotor"], [1.0, 0.0, 0.0]),
    ];
    let drive = DriveCfg {
        stiffness: [("yaw", 0.0), ("pitch", 1e4), ("spin", 0.0)].into(),
        damping: [("yaw", 1e3), ("pitch", 1e3), ("spin", 0.0)].into(),
        ..DriveCfg::default()
    };
    let mut lab = Lab::new(weightless());
    let robot = lab.robot(&urdf(&links, &joints), RobotCfg { drive, ..RobotCfg::default() });
    lab.write_joints(robot, &[0.0; 3], &[yaw, 0.0, spin]);
    lab.sim.robot_mut(robot).set_qvel_target(&row(&[yaw, 0.0, 0.0]), None, None).unwrap();
    lab.run(seconds);
    let effort = lab.effort(robot);
    [effort[0], effort[1], lab.v(robot)[2]]
}

#[test]
fn holds() {
    law(module_path!(), "τ = I ω Ω across yaw and spin", |m| {
        let [yaw, pitch, spin] = efforts_and_spin(YAW, SPIN, 2.0);
        let torque = ROTOR * SPIN * YAW;
        m.row("effort of the pitch drive", "N m", torque, pitch, (1e-5, "I Ω² times the sag"));
        m.row("effort of the yaw drive", "N m", 0.0, yaw, (1e-6, "what is left of the start"));
        m.row("spin of the rotor", "rad/s", SPIN, spin, (1e-3, "the pitch sags by 1e-4 rad while it turns"));
        m.control("effort of the yaw drive", "5 ms after the start", efforts_and_spin(YAW, SPIN, 5e-3)[0]);
        let still = efforts_and_spin(YAW, 0.0, 2.0);
        m.control("effort of the pitch drive", "without spin", still[1]);
        m.control("spin of the rotor", "without spin", still[2]);
        m.control("effort of the pitch drive", "turned the other way", efforts_and_spin(-YAW, SPIN, 2.0)[1]);
    });
}

//! The gains of an acceleration drive are multiplied by the joint's effective inertia at the start, so that heavy and
//! light loads move alike: v' = (v + h k (q* - q))/(1 + h d + h² k). In a chain the effective inertia is 1/(M⁻¹)ᵢᵢ,
//! with the other joints free: in the first step, an explicit drive accelerates its joint by k (q* - q).
//!
//! Tolerance: rounding of 100 steps.

use super::wheel::{Wheel, hinge};
use crate::lab::*;
use kinetoscope::sim::DriveType;

const STIFFNESS: f64 = 90.0;
const DAMPING: f64 = 15.0;
const AIM: f64 = 0.4;

/// Position of a wheel of this moment after 0.1 s.
fn wheel(drive_type: DriveType, moment: f64) -> f64 {
    let drive = DriveCfg { drive_type, ..implicit(STIFFNESS, DAMPING) };
    let mut wheel = Wheel::on(weightless(), drive, hinge(), moment);
    wheel.set_target_position(AIM);
    wheel.lab.run(0.1);
    wheel.q()
}

/// Acceleration of joint `which` of two levers in the first step, with a target for this joint only.
fn lever(drive_type: DriveType, which: usize) -> f64 {
    let y = [0.0, 1.0, 0.0];
    let rod =
        |name: &str, mass: f64| Link::brick(name, mass, [0.4, 0.05, 0.05]).at([0.2, 0.0, 0.0]).without_collision();
    let elbow = Joint::hinge("b", ["upper", "lower"], y).at([0.4, 0.0, 0.0]);
    let text = urdf(&[base(), rod("upper", 2.0), rod("lower", 1.0)], &[Joint::hinge("a", ["base", "upper"], y), elbow]);
    let mut lab = Lab::new(weightless());
    let drive = DriveCfg { drive_type, ..explicit(STIFFNESS, 0.0) };
    let init_qpos = vec![("b".into(), 0.7)];
    let robot = lab.robot(&text, RobotCfg { drive, init_qpos, ..RobotCfg::default() });
    let mut aim = [0.0, 0.7];
    aim[which] += AIM;
    lab.sim.robot_mut(robot).set_qpos_target(&row(&aim), None, None).unwrap();
    lab.run(1e-3);
    lab.v(robot)[which] / 1e-3
}

#[test]
fn holds() {
    law(module_path!(), "q'' = k (q* - q) + d (v* - v), whatever the inertia", |m| {
        let (mut q, mut v, h) = (0.0, 0.0, 1e-3);
        for _ in 0..100 {
            v = (v + h * STIFFNESS * (AIM - q)) / (1.0 + h * DAMPING + h * h * STIFFNESS);
            q += h * v;
        }
        for moment in [0.005, 0.5, 50.0] {
            let quantity = format!("position after 0.1 s, {moment} kg m²");
            let found = wheel(DriveType::Acceleration, moment);
            m.row(&quantity, "rad", q, found, (1e-11, "rounding of 100 steps"));
            m.control(&quantity, "with gains that are torques", wheel(DriveType::Force, moment));
        }
        for (which, name) in ["shoulder", "elbow"].into_iter().enumerate() {
            let quantity = format!("acceleration of the {name}");
            let found = lever(DriveType::Acceleration, which);
            m.row(&quantity, "rad/s²", STIFFNESS * AIM, found, (1e-9, "rounding of a step of 1 ms"));
            m.control(&quantity, "with gains that are torques", lever(DriveType::Force, which));
        }
    });
}

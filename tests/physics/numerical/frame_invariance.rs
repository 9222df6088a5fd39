//! Isotropy of space: with gravity and the base both rotated, and the base translated, a robot's joints move as before.
//!
//! Tolerance: rounding of both runs, half a digit of each state variable in each step, propagated to the end by the
//! explicit steps of [`double_pendulum`](super::double_pendulum).

use super::double_pendulum::{Method, RodState, integrate};
use crate::articulated::double_pendulum_energy;
use crate::lab::*;
use nalgebra::{Translation3, UnitQuaternion, Vector3};

const START: ([f64; 2], [f64; 2]) = ([1.0, 0.5], [0.0, 1.0]);

/// Joint angles after a second, with gravity rotated by `gravity` and the base by `base`.
fn final_angles(gravity: UnitQuaternion<f64>, base: UnitQuaternion<f64>) -> Vec<f64> {
    let mut lab = Lab::new(SimulationManagerCfg { gravity: gravity * Vector3::new(0.0, 0.0, -G), ..earth() });
    let init_pose = Pose::from_parts(Translation3::new(3.0, -2.0, 1.0), base);
    let text = double_pendulum_energy::text();
    let robot = lab.robot(&text, RobotCfg { drive: passive(), init_pose, ..RobotCfg::default() });
    lab.write_joints(robot, &START.0, &START.1);
    lab.run(1.0);
    lab.q(robot)
}

#[test]
fn holds() {
    law(module_path!(), "q(t; R g, R base) = q(t; g, base)", |m| {
        let (none, turn) = (UnitQuaternion::identity(), UnitQuaternion::from_euler_angles(0.7, -1.1, 2.0));
        let (there, here, half) = (final_angles(turn, turn), final_angles(none, none), final_angles(none, turn));
        let (_, [rounding, _]) = integrate(RodState::from_joints(START.0, START.1), Method::Euler, &[1e-3; 1_000]);
        for (k, (&here, (&there, &half))) in here.iter().zip(there.iter().zip(&half)).enumerate() {
            let quantity = format!("angle {}", k + 1);
            m.row(&quantity, "rad", here, there, (2.0 * rounding, "rounding, and what it grows to"));
            m.control(&quantity, "with only the base turned", half);
        }
    });
}

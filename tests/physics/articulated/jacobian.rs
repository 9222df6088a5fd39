//! Jacobians compared with differences of poses: J e_j = (p(q + ε e_j) - p(q - ε e_j))/2ε, with the rotation vector of
//! R(q + ε) R(q - ε)⁻¹ for the angular part. The poses are those of the simulation after writing the joint positions.
//!
//! Tolerance: ε²/6 of third derivatives of order 1 m, and 1e-16/ε of rounding: 1e-9 with ε = 1e-5; the law allows 1e-8.

use super::test_robots::{EARTH, KINDS, Kind, TestRobot};
use crate::lab::row;
use crate::law::{law, max_or_nan};
use kinetoscope::robot::kinematics::TipFrame;
use kinetoscope::scene::pose::from_row;

const STEP: f64 = 1e-5;

/// The largest error of the linear and of the angular part; the joint positions are off by `shift` in the Jacobian.
fn errors(kind: Kind, shift: f64) -> [f64; 2] {
    let mut subject = TestRobot::new(kind, EARTH);
    let last = match kind {
        Kind::Arm => subject.lab.sim.robot(subject.robot).link_names().last().unwrap().to_string(),
        Kind::Merged => "right_finger".to_string(),
    };
    let mut worst = [0.0_f64; 2];
    for k in 0..4 {
        let q = subject.sample_values(0.6, k);
        let at: Vec<f64> = q.iter().map(|q| q + shift).collect();
        let robot = subject.lab.sim.robot(subject.robot);
        let jacobian = robot.jacobian(TipFrame::from(last.as_str()), Some(row(&at).view()), None).unwrap();
        for j in 0..subject.dof() {
            let [low, high] = [-STEP, STEP].map(|step| {
                let mut moved = q.clone();
                moved[j] += step;
                let mut robot = subject.lab.sim.robot_mut(subject.robot);
                robot.write_qpos(&row(&moved), None, None).unwrap();
                let pose = robot.read().link_pose(&last).unwrap();
                from_row(&std::array::from_fn(|k| pose[(0, k)]))
            });
            let linear = (high.translation.vector - low.translation.vector) / (2.0 * STEP);
            let angular = (high.rotation * low.rotation.inverse()).scaled_axis() / (2.0 * STEP);
            for axis in 0..3 {
                worst[0] = max_or_nan(worst[0], (jacobian[(0, axis, j)] - linear[axis]).abs());
                worst[1] = max_or_nan(worst[1], (jacobian[(0, 3 + axis, j)] - angular[axis]).abs());
            }
        }
    }
    worst
}

#[test]
fn holds() {
    law(module_path!(), "J e_j = ∂(pose)/∂q_j", |m| {
        for (kind, name) in KINDS {
            let (there, elsewhere) = (errors(kind, 0.0), errors(kind, 0.05));
            for (k, part) in ["linear", "angular"].into_iter().enumerate() {
                let quantity = format!("largest error of the {part} part, {name}");
                m.row(&quantity, "", 0.0, there[k], (1e-8, "differences: ε²/6 and rounding/ε"));
                m.control(&quantity, "with the Jacobian of positions 0.05 off", elsewhere[k]);
            }
        }
    });
}

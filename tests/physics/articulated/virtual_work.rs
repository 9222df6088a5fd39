//! Virtual work: a force F at the center of mass of a link and a torque T on the link are balanced by the efforts -Jᵀ
//! (F, T), where J is the Jacobian of that point, so that nothing accelerates. J of the link's frame needs the torque
//! T + c x F, because the force acts at the center of mass.
//!
//! Tolerance: as for the mass matrix; 1e-9 of accelerations.

use super::test_robots::{KINDS, Kind, TestRobot, max_difference};
use crate::lab::row;
use crate::law::{law, max_or_nan};
use kinetoscope::robot::kinematics::TipFrame;
use nalgebra::Vector3;

/// The largest acceleration with the share `part` of the efforts applied.
fn largest_acceleration(kind: Kind, part: f64) -> f64 {
    let mut worst = 0.0_f64;
    for k in 0..4 {
        let mut subject = TestRobot::new(kind, Vector3::zeros());
        let link = match kind {
            Kind::Arm => "link6".to_string(),
            Kind::Merged => "right_finger".to_string(),
        };
        let (q, still) = (subject.sample_values(0.5, k), vec![0.0; subject.dof()]);
        let (force, torque) = (Vector3::new(3.0, -5.0, 2.0), Vector3::new(0.4, 0.1, -0.3));
        // The effort of each joint that balances the wrench, from the Jacobian of the link's frame.
        let robot = subject.lab.sim.robot(subject.robot);
        let jacobian = robot.jacobian(TipFrame::from(link.as_str()), Some(row(&q).view()), None).unwrap();
        let id = robot.link_id(&link).unwrap();
        let com = robot.description().link(id).inertial.as_ref().unwrap().link_from_com.translation.vector;
        let fk = robot.compute_fk(&row(&q), TipFrame::from(link.as_str()), None).unwrap();
        let turn = kinetoscope::scene::pose::from_row(&std::array::from_fn(|k| fk[(0, k)])).rotation;
        let about_frame = torque + (turn * com).cross(&force);
        let hold: Vec<f64> = (0..subject.dof())
            .map(|j| {
                let column = |first: usize, v: &Vector3<f64>| -> f64 {
                    (0..3).map(|axis| jacobian[(0, first + axis, j)] * v[axis]).sum()
                };
                -part * (column(0, &force) + column(3, &about_frame))
            })
            .collect();
        subject.lab.set_link_wrench(subject.robot, &link, force, torque);
        worst = max_or_nan(worst, max_difference(&subject.accelerations(&q, &still, &hold), &still));
    }
    worst
}

#[test]
fn holds() {
    law(module_path!(), "τ = -Jᵀ (F, T) holds a wrench", |m| {
        for (kind, name) in KINDS {
            let quantity = format!("largest acceleration, {name}");
            m.row(
                &quantity,
                "rad/s²",
                0.0,
                largest_acceleration(kind, 1.0),
                (1e-9, "rounding times the condition of M"),
            );
            m.control(&quantity, "with 1 % less effort", largest_acceleration(kind, 0.99));
        }
    });
}

//! A torque on a body whose inertia is given in rotated axes, away from its origin, and with products. One step from
//! rest gives ω = h R I⁻¹ Rᵀ τ with I = Q I_file Qᵀ, where Q is the rotation of `<inertial><origin rpy>`. The center of
//! mass stays at rest, so that the frame's origin moves with ω x (-R c).
//!
//! Tolerance: rounding of the principal axes, 1e-12 of the largest component, which is below 1.

use crate::lab::*;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

const TORQUE: [f64; 3] = [0.7, -1.1, 0.4];

/// Angular velocity and velocity of the origin after the step.
fn step_with_torque(link: &Link, turn: UnitQuaternion<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let mut lab = Lab::new(weightless());
    let robot = lab.free(&urdf(std::slice::from_ref(link), &[]), [0.0; 3]);
    let pose = Pose::from_parts(nalgebra::Translation3::new(0.5, 0.6, 0.7), turn);
    lab.sim.robot_mut(robot).write_root_pose(&pose_row(&pose), None).unwrap();
    lab.set_link_wrench(robot, "body", Vector3::zeros(), TORQUE.into());
    lab.run(1e-3);
    let root = lab.root(robot);
    (root.angular_velocity, root.velocity)
}

#[test]
fn holds() {
    law(module_path!(), "ω = h R (Q I Qᵀ)⁻¹ Rᵀ τ and v = ω x (-R c) after one step from rest", |m| {
        let inertia = Matrix3::new(0.02, 0.004, -0.003, 0.004, 0.03, 0.002, -0.003, 0.002, 0.024);
        let body = Link { inertia, rpy: [0.4, -0.7, 1.1], ..Link::new("body", 1.7, [0.0; 3]).at([0.05, -0.02, 0.03]) };
        let turn = UnitQuaternion::from_euler_angles(-0.5, 0.9, 2.1);
        // URDF's rpy are nalgebra's Euler angles: about the fixed x, then y, then z axis.
        let q = Rotation3::from_euler_angles(0.4, -0.7, 1.1);
        let r = turn.to_rotation_matrix();
        let about = r.matrix() * q.matrix() * inertia * q.matrix().transpose() * r.matrix().transpose();
        let spin = 1e-3 * about.try_inverse().unwrap() * Vector3::from(TORQUE);
        let velocity = spin.cross(&-(r * Vector3::from(body.com)));
        let (found, at_origin) = step_with_torque(&body, turn);
        let (untilted, _) = step_with_torque(&Link { rpy: [0.0; 3], ..body.clone() }, turn);
        let (_, central) = step_with_torque(&Link { com: [0.0; 3], ..body.clone() }, turn);
        let rounding = (1e-12, "rounding of principal axes");
        for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
            m.row(&format!("angular velocity, {axis}"), "rad/s", spin[k], found[k], rounding);
            m.control(&format!("angular velocity, {axis}"), "without the turn of the inertia", untilted[k]);
            m.row(&format!("velocity of the origin, {axis}"), "m/s", velocity[k], at_origin[k], rounding);
            m.control(&format!("velocity of the origin, {axis}"), "with the mass in the origin", central[k]);
        }
    });
}

//! Links that fixed joints hold are one body: m = Σ m, c = Σ m c/m, and I = Σ (R I Rᵀ + m (|d|² 1 - d dᵀ)) about c, d being
//! from c to each centre. By how it moves: a torque τ for one step from rest gives ω = h I⁻¹ τ, a force F in its centre of
//! mass v = h F/m and no turn.
//!
//! Tolerance: rounding of the principal axes, 1e-12.

use crate::lab::*;
use crate::law::law;
use crate::urdf::{Joint, Link, urdf};
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

const TORQUE: [f64; 3] = [0.5, -0.8, 1.1];
const FORCE: [f64; 3] = [4.0, 5.0, -6.0];

/// A link, and its frame in the root's.
fn parts() -> Vec<(Link, [f64; 3], [f64; 3])> {
    let inertia = |s: f64| s * Matrix3::new(3.0, 0.4, -0.2, 0.4, 2.5, 0.3, -0.2, 0.3, 2.0);
    let link =
        |name: &str, mass, s, com, rpy| Link { inertia: inertia(s), rpy, ..Link::new(name, mass, [0.0; 3]).at(com) };
    vec![
        (link("trunk", 3.0, 0.02, [0.02, 0.0, -0.05], [0.2, 0.3, -0.4]), [0.0; 3], [0.0; 3]),
        (link("head", 1.2, 0.004, [0.0, 0.03, 0.1], [-0.6, 0.1, 0.9]), [0.1, 0.0, 0.4], [0.3, -0.2, 0.5]),
        (link("tail", 0.7, 0.002, [-0.1, 0.0, 0.02], [0.0, 1.2, 0.0]), [-0.5, 0.1, 0.1], [-0.1, 0.7, -1.3]),
    ]
}

fn isometry(xyz: [f64; 3], rpy: [f64; 3]) -> Isometry3<f64> {
    let turn = Rotation3::from_euler_angles(rpy[0], rpy[1], rpy[2]);
    Isometry3::from_parts(Translation3::from(Vector3::from(xyz)), UnitQuaternion::from_rotation_matrix(&turn))
}

/// Mass, centre of mass and inertia about it; `steiner` of the parallel-axis terms.
fn composed(steiner: f64) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let bodies: Vec<(f64, Vector3<f64>, Matrix3<f64>)> = parts()
        .into_iter()
        .map(|(link, xyz, rpy)| {
            let root_from_com = isometry(xyz, rpy) * isometry(link.com, link.rpy);
            let r = root_from_com.rotation.to_rotation_matrix();
            (link.mass, root_from_com.translation.vector, r.matrix() * link.inertia * r.matrix().transpose())
        })
        .collect();
    let mass: f64 = bodies.iter().map(|b| b.0).sum();
    let com = bodies.iter().map(|b| b.0 * b.1).sum::<Vector3<f64>>() / mass;
    let about = |(m, c, i): &(f64, Vector3<f64>, Matrix3<f64>)| {
        let d = c - com;
        i + steiner * *m * (Matrix3::identity() * d.norm_squared() - d * d.transpose())
    };
    (mass, com, bodies.iter().map(about).sum())
}

#[test]
fn holds() {
    law(module_path!(), "I = Σ (R I Rᵀ + m (|d|² 1 - d dᵀ)), c = Σ m c/Σ m", |m| {
        let joint = |(link, xyz, rpy): &(Link, [f64; 3], [f64; 3])| {
            Joint::fixed(&format!("to {}", link.name), ["trunk", &link.name]).at(*xyz).turned(*rpy)
        };
        let joints: Vec<Joint> = parts().iter().skip(1).map(joint).collect();
        let links: Vec<Link> = parts().into_iter().map(|part| part.0).collect();
        let moved = |force: [f64; 3], torque: [f64; 3]| {
            let mut lab = Lab::new(weightless());
            let robot = lab.free(&urdf(&links, &joints), [1.0, 2.0, 3.0]);
            let com = lab.sim.robot(robot).get_root_com_position();
            let com = Vector3::new(com[(0, 0)], com[(0, 1)], com[(0, 2)]) - Vector3::new(1.0, 2.0, 3.0);
            lab.push_link(robot, "head", force.into(), torque.into());
            lab.run(1e-3);
            let root = lab.root(robot);
            (com, root.velocity, root.spin, lab.sim.robot(robot).total_mass())
        };
        let (mass, com, inertia) = composed(1.0);
        let (found_com, _, spin, found_mass) = moved([0.0; 3], TORQUE);
        let (_, velocity, turn, _) = moved(FORCE, [0.0; 3]);
        let expected = 1e-3 * inertia.try_inverse().unwrap() * Vector3::from(TORQUE);
        let dropped = 1e-3 * composed(0.0).2.try_inverse().unwrap() * Vector3::from(TORQUE);
        let rounding = (1e-12, "rounding of principal axes");
        m.row("mass", "kg", mass, found_mass, rounding);
        m.control("mass", "without the tail", mass - 0.7);
        for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
            m.row(&format!("centre of mass, {axis}"), "m", com[k], found_com[k], rounding);
            m.control(&format!("centre of mass, {axis}"), "of the trunk alone", parts()[0].0.com[k]);
            m.row(&format!("angular velocity by a torque, {axis}"), "rad/s", expected[k], spin[k], rounding);
            m.control(&format!("angular velocity by a torque, {axis}"), "without parallel-axis terms", dropped[k]);
            m.row(&format!("velocity by a force, {axis}"), "m/s", 1e-3 * FORCE[k] / mass, velocity[k], rounding);
            m.control(
                &format!("velocity by a force, {axis}"),
                "with the mass of the trunk alone",
                1e-3 * FORCE[k] / 3.0,
            );
        }
        m.row("turn by a force in the centre of mass", "rad/s", 0.0, turn.norm(), rounding);
        m.control("turn by a force in the centre of mass", "with a torque", spin.norm());
    });
}

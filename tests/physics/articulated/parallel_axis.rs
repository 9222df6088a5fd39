//! Links connected by fixed joints, in one file or in several merged files, form one body: m = Σ m, c = Σ m c/m, and
//! I = Σ (R I Rᵀ + m (|d|² 1 - d dᵀ)) about c, with d from c to each center. The body is identified by its motion: a
//! torque τ for one step from rest gives ω = h I⁻¹ τ, and a force F at its center of mass gives v = h F/m without
//! rotation.
//!
//! Tolerance: rounding of the principal axes, 1e-12.

use crate::lab::*;
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

const TORQUE: [f64; 3] = [0.5, -0.8, 1.1];
const FORCE: [f64; 3] = [4.0, 5.0, -6.0];

/// The links, with position and rotation of their frames in the root's frame.
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

/// Composed mass, center of mass and inertia about it.
fn composed() -> (f64, Vector3<f64>, Matrix3<f64>) {
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
        i + *m * (Matrix3::identity() * d.norm_squared() - d * d.transpose())
    };
    (mass, com, bodies.iter().map(about).sum())
}

/// Assembly of the parts.
#[derive(Clone, Copy, Debug)]
enum Robot {
    /// One file with fixed joints.
    OneFile,
    /// One file per part, merged.
    Merged,
}

/// Mass of the body, and its motion after one step from rest.
#[derive(Debug)]
struct Moved {
    mass: f64,
    com: Vector3<f64>,
    velocity: Vector3<f64>,
    spin: Vector3<f64>,
}

/// One step with a force at the center of mass and a torque.
fn step(kind: Robot, parts: &[(Link, [f64; 3], [f64; 3])], force: [f64; 3], torque: [f64; 3]) -> Moved {
    let start = Vector3::new(1.0, 2.0, 3.0);
    let mut lab = Lab::new(weightless());
    let robot = match kind {
        Robot::OneFile => {
            let links: Vec<Link> = parts.iter().map(|part| part.0.clone()).collect();
            let joint = |(link, xyz, rpy): &(Link, [f64; 3], [f64; 3])| {
                Joint::fixed(&format!("to {}", link.name), ["trunk", &link.name]).at(*xyz).turned(*rpy)
            };
            let joints: Vec<Joint> = parts.iter().skip(1).map(joint).collect();
            lab.free(&urdf(&links, &joints), start.into())
        }
        Robot::Merged => {
            let component = |(k, (link, xyz, rpy)): (usize, &(Link, [f64; 3], [f64; 3]))| {
                let file = lab.file(&format!("{}.urdf", link.name), &urdf(std::slice::from_ref(link), &[]));
                let on_trunk = (k > 0).then(|| "trunk".to_string());
                ComponentCfg {
                    transform: isometry(*xyz, *rpy),
                    parent: on_trunk.clone(),
                    parent_link: on_trunk,
                    ..ComponentCfg::new(link.name.clone(), file)
                }
            };
            let urdf = UrdfCfg { components: parts.iter().enumerate().map(component).collect(), ..UrdfCfg::default() };
            let init_pose = Pose::translation(start.x, start.y, start.z);
            let cfg = RobotCfg { urdf, drive: passive(), fix_base: false, init_pose, ..RobotCfg::default() };
            lab.sim.add_robot(cfg).unwrap()
        }
    };
    let com = lab.sim.robot(robot).root_com_position();
    let com = Vector3::new(com[(0, 0)], com[(0, 1)], com[(0, 2)]) - start;
    lab.set_link_wrench(robot, "trunk", force.into(), torque.into());
    lab.run(1e-3);
    let root = lab.root(robot);
    Moved { mass: lab.sim.robot(robot).total_mass(), com, velocity: root.velocity, spin: root.angular_velocity }
}

#[test]
fn holds() {
    law(module_path!(), "I = Σ (R I Rᵀ + m (|d|² 1 - d dᵀ)), c = Σ m c/Σ m", |m| {
        let (mass, com, inertia) = composed();
        let spin = 1e-3 * inertia.try_inverse().unwrap() * Vector3::from(TORQUE);
        // The same parts, shifted so that all centers of mass coincide.
        let concentric = parts()
            .into_iter()
            .map(|(link, xyz, rpy)| {
                let shift = com - (isometry(xyz, rpy) * isometry(link.com, link.rpy)).translation.vector;
                let xyz = if link.name == "trunk" { xyz } else { (Vector3::from(xyz) + shift).into() };
                let com = if link.name == "trunk" { com.into() } else { link.com };
                (Link { com, ..link }, xyz, rpy)
            })
            .collect::<Vec<_>>();
        let rounding = (1e-12, "rounding of principal axes");
        for (kind, name) in [(Robot::OneFile, "one file"), (Robot::Merged, "merged files")] {
            let pushed = |parts: &[_], force, torque| step(kind, parts, force, torque);
            let (turned, driven) = (pushed(&parts(), [0.0; 3], TORQUE), pushed(&parts(), FORCE, [0.0; 3]));
            let trunk = pushed(&parts()[..1], FORCE, [0.0; 3]);
            let no_arms = pushed(&concentric, [0.0; 3], TORQUE);
            m.row(&format!("mass, {name}"), "kg", mass, turned.mass, rounding);
            m.control(&format!("mass, {name}"), "without head and tail", trunk.mass);
            for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
                let quantity = format!("center of mass, {axis}, {name}");
                m.row(&quantity, "m", com[k], turned.com[k], rounding);
                m.control(&quantity, "without head and tail", trunk.com[k]);
                let quantity = format!("angular velocity by a torque, {axis}, {name}");
                m.row(&quantity, "rad/s", spin[k], turned.spin[k], rounding);
                m.control(&quantity, "with all centers of mass in one point", no_arms.spin[k]);
                // The frame rotates about the center of mass, which is at rest.
                let (quantity, at_frame) =
                    (format!("velocity of the frame by a torque, {axis}, {name}"), spin.cross(&-com));
                m.row(&quantity, "m/s", at_frame[k], turned.velocity[k], rounding);
                m.control(&quantity, "with all centers of mass in one point", no_arms.velocity[k]);
                let quantity = format!("velocity by a force, {axis}, {name}");
                m.row(&quantity, "m/s", 1e-3 * FORCE[k] / mass, driven.velocity[k], rounding);
                m.control(&quantity, "without head and tail", trunk.velocity[k]);
            }
            let quantity = format!("rotation by a force in the center of mass, {name}");
            m.row(&quantity, "rad/s", 0.0, driven.spin.norm(), rounding);
            m.control(&quantity, "with a torque", turned.spin.norm());
        }
    });
}

//! Robots for the laws of dynamics: the bundled arm, and a robot merged from two files with rotated and shifted frames
//! and inertias.

use super::newton_euler::{Joints, Motion, Tree, joints};
use crate::lab::*;
use crate::law::max_or_nan;
use kinetoscope::scene::pose::from_xyz_rpy;
use nalgebra::{Matrix3, Vector3};

/// A robot in a simulation, with its reference model.
#[derive(Debug)]
pub(super) struct TestRobot {
    pub(super) lab: Lab,
    pub(super) robot: RobotId,
    pub(super) tree: Tree,
    pub(super) names: Vec<String>,
}

/// Kind of the robot.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    /// The bundled SR5.
    Arm,
    /// An arm of four joints with a gripper of two fingers, merged from two files.
    Merged,
}

pub(super) const KINDS: [(Kind, &str); 2] = [(Kind::Arm, "SR5"), (Kind::Merged, "merged arm and gripper")];

/// A link whose inertia is rotated and shifted against its frame and has off-diagonal terms.
fn skewed(name: &str, mass: f64, size: f64, k: f64) -> Link {
    let unit = mass * size * size;
    let off = |x: f64| 0.1 * unit * (x + k).sin();
    let diagonal = [0.5 + 0.1 * k.sin(), 0.6, 0.4 + 0.1 * k.cos()].map(|x| x * unit);
    let inertia =
        Matrix3::new(diagonal[0], off(1.0), off(2.0), off(1.0), diagonal[1], off(3.0), off(2.0), off(3.0), diagonal[2]);
    let at = [0.4 * size * (0.5 + k).cos(), 0.3 * size * k.sin(), 0.5 * size];
    Link { inertia, rpy: [0.3 + k, -0.5 * k, 0.7], ..Link::new(name, mass, [0.0; 3]).at(at) }
}

fn arm() -> String {
    let links = [
        Link::new("foot", 0.0, [0.0; 3]),
        skewed("upper", 4.0, 0.3, 0.1),
        skewed("lower", 2.5, 0.25, 1.3),
        skewed("carriage", 1.0, 0.1, 2.2),
        skewed("wrist", 0.6, 0.08, 3.1),
        skewed("cover", 0.3, 0.05, 4.0),
        Link::new("flange", 0.0, [0.0; 3]),
    ];
    let joints = [
        Joint::hinge("turn", ["foot", "upper"], [0.1, -0.2, 1.0]).at([0.0, 0.0, 0.2]),
        Joint::hinge("bend", ["upper", "lower"], [0.0, 1.0, 0.3]).at([0.1, 0.05, 0.3]).turned([0.2, 0.4, -0.3]),
        Joint::slide("reach", ["lower", "carriage"], [1.0, 0.2, 0.0]).at([0.2, 0.0, 0.1]).turned([-0.4, 0.1, 0.9]),
        Joint::hinge("roll", ["carriage", "wrist"], [0.7, 0.0, 0.7]).at([0.05, 0.0, 0.1]).turned([1.2, -0.3, 0.2]),
        Joint::fixed("screw", ["wrist", "cover"]).at([0.02, 0.03, -0.01]).turned([0.5, 0.5, 0.5]),
        Joint::fixed("plate", ["wrist", "flange"]).at([0.0, 0.01, 0.09]).turned([0.1, -0.6, 0.3]),
    ];
    urdf(&links, &joints)
}

fn gripper() -> String {
    let links = [
        skewed("palm", 0.4, 0.06, 0.7),
        skewed("left_finger", 0.05, 0.03, 1.9),
        skewed("right_finger", 0.07, 0.03, 2.8),
    ];
    let joints = [
        Joint::slide("left", ["palm", "left_finger"], [0.0, 1.0, 0.1]).at([0.0, 0.02, 0.05]).turned([0.0, 0.2, 0.1]),
        Joint::hinge("right", ["palm", "right_finger"], [1.0, 0.0, 0.4]).at([0.0, -0.02, 0.05]).turned([0.3, 0.0, 0.0]),
    ];
    urdf(&links, &joints)
}

impl TestRobot {
    /// A passive robot with a fixed base and a time step of a millisecond.
    pub(super) fn new(kind: Kind, gravity: Vector3<f64>) -> Self {
        let mut lab = Lab::new(SimulationManagerCfg { gravity, ..earth() });
        let (urdf, tree) = match kind {
            Kind::Arm => {
                let path = assets::path("sr5/SR5.urdf").unwrap();
                let tree = Tree::read(&path);
                (UrdfCfg::single(path), tree)
            }
            Kind::Merged => {
                let [arm, hand] = [lab.file("arm.urdf", &arm()), lab.file("gripper.urdf", &gripper())];
                let transform = from_xyz_rpy([0.01, 0.02, 0.03], [0.3, -0.4, 1.5]);
                let tree = Tree::read(&arm).with(Tree::read(&hand), "flange", transform);
                let hand =
                    ComponentCfg { transform, parent_link: Some("flange".into()), ..ComponentCfg::new("hand", hand) };
                let components = vec![ComponentCfg::new("arm", arm), hand];
                (UrdfCfg { components, ..UrdfCfg::default() }, tree)
            }
        };
        let robot = lab.sim.add_robot(RobotCfg { urdf, drive: passive(), ..RobotCfg::default() }).unwrap();
        let names = lab.sim.robot(robot).joint_names().to_vec();
        Self { lab, robot, tree, names }
    }

    pub(super) fn dof(&self) -> usize {
        self.names.len()
    }

    /// Deterministic numbers between -`size` and `size`, different for each `k`.
    pub(super) fn sample_values(&self, size: f64, k: usize) -> Vec<f64> {
        (0..self.dof()).map(|j| size * (1.7 * k as f64 + 2.3 * j as f64 + size).sin()).collect()
    }

    pub(super) fn joints(&self, q: &[f64], v: &[f64], a: &[f64]) -> Joints {
        joints(&self.names, q, v, a)
    }

    /// The reference's efforts, in the order of the robot's joints.
    pub(super) fn efforts(&self, q: &[f64], v: &[f64], a: &[f64], gravity: Vector3<f64>) -> Vec<f64> {
        let efforts = self.tree.efforts(&self.joints(q, v, a), Motion::rest(gravity));
        self.names.iter().map(|name| efforts[name]).collect()
    }

    /// Accelerations over one step from this state under these efforts, from the change of the velocities.
    pub(super) fn accelerations(&mut self, q: &[f64], v: &[f64], efforts: &[f64]) -> Vec<f64> {
        self.lab.write_joints(self.robot, q, v);
        self.lab.set_joint_efforts(self.robot, efforts);
        self.lab.run(1e-3);
        let after = self.lab.v(self.robot);
        after.iter().zip(v).map(|(after, before)| (after - before) / 1e-3).collect()
    }
}

/// The largest difference between two lists.
pub(super) fn max_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan)
}

pub(super) const EARTH: Vector3<f64> = Vector3::new(0.0, 0.0, -G);

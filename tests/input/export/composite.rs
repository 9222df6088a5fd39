//! Mass, center of mass and inertia of the whole robot in MuJoCo, compared with the links of the URDF.
//!
//! The expected values are composed here, independent of the tested code: moments about the world origin, with forward
//! kinematics from the description.

use super::robots::simulation;
use kinetoscope::mujoco::Data;
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::robot::description::{JointKind, RobotDescription};
use nalgebra::{Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// Mass, first moment and inertia about the origin.
#[derive(Default)]
struct CompositeInertia {
    mass: f64,
    moment: Vector3<f64>,
    inertia: Matrix3<f64>,
}

/// The inertia of a point mass about the origin.
fn point(mass: f64, at: Vector3<f64>) -> Matrix3<f64> {
    (Matrix3::identity() * at.norm_squared() - at * at.transpose()) * mass
}

impl CompositeInertia {
    /// Adds a body with this inertia about its center of mass, in axes rotated by `turn`.
    fn add(&mut self, mass: f64, com: Vector3<f64>, inertia: Matrix3<f64>, turn: UnitQuaternion<f64>) {
        let turn = turn.to_rotation_matrix();
        self.mass += mass;
        self.moment += com * mass;
        self.inertia += turn.matrix() * inertia * turn.matrix().transpose() + point(mass, com);
    }

    fn com(&self) -> Vector3<f64> {
        self.moment / self.mass
    }

    /// Inertia about the center of mass.
    fn central(&self) -> Matrix3<f64> {
        self.inertia - point(self.mass, self.com())
    }
}

fn of_description(robot: &RobotDescription, base: Pose, qpos: &[f64]) -> CompositeInertia {
    let position: std::collections::BTreeMap<_, _> =
        robot.drivable_joints().map(|(id, _)| id).zip(qpos.iter().copied()).collect();
    let mut sum = CompositeInertia::default();
    let mut stack = vec![(robot.root, base)];
    while let Some((link, world_from_link)) = stack.pop() {
        if let Some(inertial) = &robot.link(link).inertial {
            let frame = world_from_link * inertial.link_from_com;
            sum.add(inertial.mass, frame.translation.vector, inertial.inertia, frame.rotation);
        }
        for &id in &robot.link(link).child_joints {
            let joint = robot.joint(id);
            let turned = |q| UnitQuaternion::from_axis_angle(&joint.axis, q);
            let motion = match joint.kind {
                JointKind::Revolute | JointKind::Continuous => {
                    Pose::from_parts(Translation3::identity(), turned(position[&id]))
                }
                JointKind::Prismatic => {
                    Pose::from_parts((joint.axis.into_inner() * position[&id]).into(), UnitQuaternion::identity())
                }
                JointKind::Fixed => Pose::identity(),
                other => panic!("{other:?}"),
            };
            stack.push((joint.child, world_from_link * joint.parent_from_joint * motion));
        }
    }
    sum
}

fn of_mujoco(data: &Data) -> CompositeInertia {
    let model = data.model();
    let mut sum = CompositeInertia::default();
    for body in 1..model.nbody() {
        let quat = |q: &[f64]| UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
        let turn = quat(&data.xquat()[4 * body..4 * body + 4]) * quat(&model.body_iquat()[4 * body..4 * body + 4]);
        let moments = Vector3::from_column_slice(&model.body_inertia()[3 * body..3 * body + 3]);
        let com = Vector3::from_column_slice(&data.xipos()[3 * body..3 * body + 3]);
        sum.add(model.body_mass()[body], com, Matrix3::from_diagonal(&moments), turn);
    }
    sum
}

of_each_robot! { weight }

fn weight(cfg: RobotCfg) {
    let (uid, base) = (cfg.uid.clone(), cfg.init_pose);
    let (mut sim, id) = simulation(RobotCfg { self_collision: false, ..cfg });
    let dof = sim.robot(id).dof();
    for pose in 0..3 {
        let wanted = Array2::from_shape_fn((1, dof), |(_, j)| 0.3 * f64::from(pose) * (1.0 + j as f64).sin());
        sim.robot_mut(id).write_qpos(&wanted, None, None).unwrap();
        let qpos = sim.robot(id).qpos().row(0).to_vec();
        let expected = of_description(sim.robot(id).description(), base, &qpos);
        let (found, subtree, subtree_com) = sim.batch().read(0, |env| {
            let com = Vector3::from_column_slice(&env.data().subtree_com()[..3]);
            (of_mujoco(env.data()), env.data().model().body_subtreemass()[0], com)
        });
        for mass in [found.mass, sim.robot(id).total_mass(), subtree] {
            assert!((mass - expected.mass).abs() < 1e-9, "{uid}: {mass} {}", expected.mass);
        }
        for com in [found.com(), subtree_com] {
            assert!((com - expected.com()).norm() < 1e-9, "{uid}: {com} {}", expected.com());
        }
        let difference = found.central() - expected.central();
        assert!(difference.amax() < 1e-9, "{uid}, pose {pose}: {difference:e}");
    }
}

//! The state of a robot, against MuJoCo's Jacobians and closed forms.
//!
//! The velocity of a point of a body is `mj_jac` times the generalized velocity; the robot state reads `cvel` instead.
//! Both sum products of a few numbers of size 1 to 10: 1e-12 is a thousand times the rounding. Control: the velocities
//! of the frame's origin and of the center of mass differ far more. Mistakes in arrays and indices of writers are in
//! `tests/input/every_writer.rs`.

use super::ENVS;
use kinetoscope::mujoco::ObjectKind;
use kinetoscope::ndarray::{Array2, Axis, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::RobotState;
use kinetoscope_testkit::bits::bits;
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::tolerance::{Tolerance, assert_close, assert_number};
use kinetoscope_testkit::urdf::{TempFiles, joint, link, robot};
use kinetoscope_testkit::worlds::{empty_cfg, gains, no_drive, pose_error, pose_of_row, text_robot};
use nalgebra::{DMatrix, DVector, Translation3, UnitQuaternion, Vector3};

const EXACT: Tolerance = Tolerance::absolute(1e-12, "a thousand times the rounding of a few numbers of size 1 to 10");
const G: f64 = 9.81;

/// A base with its center of mass off its origin, an arm on a hinge, a finger that mimics the hinge, and a tool fixed
/// to the arm.
const ROBOT: &str = r#"<robot name="r">
  <link name="base"><inertial><origin xyz="0.1 -0.05 0.2"/><mass value="2"/>
    <inertia ixx="0.03" ixy="0.001" ixz="0" iyy="0.02" iyz="0" izz="0.04"/></inertial></link>
  <link name="arm"><inertial><origin xyz="0.2 0 0"/><mass value="0.5"/>
    <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.004" iyz="0" izz="0.004"/></inertial></link>
  <link name="finger"><inertial><origin xyz="0.02 0 0"/><mass value="0.1"/>
    <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial></link>
  <link name="tool"/>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0.3 0.1 0" rpy="0.2 0 0.4"/>
    <axis xyz="0 0.6 0.8"/><limit lower="-2" upper="2" effort="100" velocity="5"/></joint>
  <joint name="follower" type="continuous"><parent link="base"/><child link="finger"/><origin xyz="-0.2 0 0.1"/>
    <axis xyz="1 0 0"/><mimic joint="hinge" multiplier="-1"/></joint>
  <joint name="mount" type="fixed"><parent link="arm"/><child link="tool"/><origin xyz="0.35 0.02 -0.1" rpy="1 0.5 -0.3"/>
  </joint>
</robot>"#;

fn sim(gravity: f64) -> SimulationManager {
    kinetoscope_testkit::worlds::sim(SimulationManagerCfg { gravity: [0.0, 0.0, -gravity].into(), ..empty_cfg(ENVS) })
}

fn sim_with(gravity: f64, fix_base: bool) -> (SimulationManager, RobotId) {
    let (files, mut sim) = (TempFiles::default(), sim(gravity));
    let control_parts = vec![("all".into(), vec![".*".into()])];
    let robot = RobotCfg { control_parts, drive: gains(50.0, 5.0), fix_base, ..text_robot(&files, "robot", ROBOT) };
    let id = sim.add_robot(robot).unwrap();
    (sim, id)
}

/// Two balls of 2 kg with one center, connected by a passive hinge: neither ball can move the other.
fn two_balls(gravity: f64, fix_base: bool) -> (SimulationManager, RobotId) {
    let (files, mut sim) = (TempFiles::default(), sim(gravity));
    let ball = |name| link(name, 2.0, 0.02, [0.0; 3], "");
    let spin = joint("spin", "continuous", ["outer", "inner"], [0.0; 3], "0 0 1", "");
    let text = robot("r", &format!("{}{}{spin}", ball("outer"), ball("inner")));
    let robot = RobotCfg { drive: no_drive(), fix_base, ..text_robot(&files, "robot", &text) };
    let id = sim.add_robot(RobotCfg { init_pose: Pose::translation(0.0, 0.0, 5.0), ..robot }).unwrap();
    (sim, id)
}

/// The robot with a different pose and motion in each environment.
fn tumbling() -> (SimulationManager, RobotId) {
    let (mut sim, id) = sim_with(G, false);
    let mut robot = sim.robot_mut(id);
    let pose = |(env, k): (usize, usize)| {
        let angle = |axis: usize| 0.3 + 0.7 * env as f64 - 0.4 * axis as f64;
        let q = UnitQuaternion::from_euler_angles(angle(0), angle(1), angle(2)).into_inner();
        [1.0, -2.0, 3.0 + env as f64, q.w, q.i, q.j, q.k][k]
    };
    robot.write_root_pose(&Array2::from_shape_fn((ENVS, 7), pose), None).unwrap();
    let velocity = |(env, k): (usize, usize)| 0.8 * ((3 * env + 2 * k + 1) as f64).sin();
    robot.write_root_velocity(&Array2::from_shape_fn((ENVS, 6), velocity), None).unwrap();
    robot.write_qpos(&array![[0.5, -0.5], [-1.2, 1.2], [1.9, -1.9]], None, None).unwrap();
    robot.write_qvel(&array![[1.5, -1.5], [-4.0, 4.0], [0.7, -0.7]], None, None).unwrap();
    (sim, id)
}

/// Velocity of a point of a body and angular velocity of the body, from MuJoCo's Jacobian.
fn by_jacobian(sim: &SimulationManager, env: usize, body: &str, point: [f64; 3]) -> [f64; 6] {
    sim.batch().read(env, |env| {
        let (data, nv) = (env.data(), env.data().model().nv());
        let body = data.model().id(ObjectKind::Body, body).unwrap();
        let (mut linear, mut angular) = (vec![0.0; 3 * nv], vec![0.0; 3 * nv]);
        data.jacobian(body, point, &mut linear, &mut angular).unwrap();
        let v = DVector::from_column_slice(data.qvel());
        let [a, b] = [linear, angular].map(|jacobian| DMatrix::from_row_slice(3, nv, &jacobian) * &v);
        [a[0], a[1], a[2], b[0], b[1], b[2]]
    })
}

#[test]
fn links() {
    let (mut sim, id) = tumbling();
    for round in 0..2 {
        let view = sim.robot(id);
        let (poses, velocities) = (view.link_poses(), view.link_velocities());
        assert_eq!((poses.dim(), velocities.dim()), ((ENVS, 4, 7), (ENVS, 4, 6)));
        for (l, name) in view.link_names().into_iter().enumerate() {
            // The tool is part of the arm's body.
            let body = format!("robot/{}", if name == "tool" { "arm" } else { name });
            let (pose, velocity) = (poses.index_axis(Axis(1), l), velocities.index_axis(Axis(1), l));
            assert_eq!(pose, view.link_pose(name).unwrap(), "{name}");
            assert_eq!(velocity, view.link_velocity(name).unwrap(), "{name}");
            for env in 0..ENVS {
                let expected = by_jacobian(&sim, env, &body, [0, 1, 2].map(|k| pose[(env, k)]));
                let what = format!("{name} in environment {env}, round {round}");
                assert_close(&what, velocity.row(env), expected, EXACT);
            }
        }
        // The tool has its mounting pose on the arm.
        let turn = UnitQuaternion::from_euler_angles(1.0, 0.5, -0.3);
        let mount = Pose::from_parts(Translation3::new(0.35, 0.02, -0.1), turn);
        for env in 0..ENVS {
            let [arm, tool] = ["arm", "tool"].map(|name| pose_of_row(&view.link_pose(name).unwrap(), env));
            let (distance, angle) = pose_error(&(arm * mount), &tool);
            assert_number("distance from the mount", distance, 0.0, EXACT);
            assert!(angle < 1e-7, "{angle}");
        }
        sim.update(20);
    }
}

/// Root state: of the frame, of the center of mass, and in the axes of the root link.
#[test]
fn root() {
    let (mut sim, id) = tumbling();
    for _ in 0..2 {
        let view = sim.robot(id);
        let (pose, velocity, state) = (view.root_pose(), view.root_velocity(), view.root_state());
        let (com, com_velocity) = (view.root_com_position(), view.root_com_velocity());
        let (linear, angular) = (view.root_lin_vel_b(), view.root_ang_vel_b());
        let (gravity, heading) = (view.projected_gravity_b(), view.root_heading());
        for env in 0..ENVS {
            let root = pose_of_row(&pose, env);
            assert_eq!(state.row(env).to_vec(), [pose.row(env).to_vec(), velocity.row(env).to_vec()].concat());
            // The center of mass of the file.
            let center = root * nalgebra::Point3::new(0.1, -0.05, 0.2);
            let at_frame = by_jacobian(&sim, env, "robot/base", root.translation.vector.into());
            let at_com = by_jacobian(&sim, env, "robot/base", center.into());
            let difference = (0..3).fold(0.0_f64, |apart, k| apart.max((at_com[k] - at_frame[k]).abs()));
            assert!(difference > 1e-3, "the control: the two differ");
            // In the root's axes: the columns of the rotation matrix are the rows of its transpose.
            let axes = root.rotation.to_rotation_matrix();
            let in_axes = |v: &[f64]| -> [f64; 3] {
                std::array::from_fn(|k| (0..3).map(|i| axes.matrix()[(i, k)] * v[i]).sum::<f64>())
            };
            let x_axis = axes.matrix().column(0);
            for (what, found, expected) in [
                ("center of mass", com.row(env), center.coords.as_slice()),
                ("velocity of the frame", velocity.row(env), &at_frame[..]),
                ("velocity of the center of mass", com_velocity.row(env), &at_com[..]),
                ("velocity in the root", linear.row(env), &in_axes(&at_frame[..3])[..]),
                ("angular velocity in the root", angular.row(env), &in_axes(&at_frame[3..])[..]),
                ("gravity in the root", gravity.row(env), &in_axes(&[0.0, 0.0, -1.0])[..]),
            ] {
                assert_close(what, found, expected, EXACT);
            }
            assert_number("heading", heading[env], x_axis[1].atan2(x_axis[0]), EXACT);
        }
        sim.update(15);
    }
}

/// A fixed root. For a free base see the law `free_fall` and `mjcf_robot::bases::fixed_or_free`.
#[test]
fn fixed_root() {
    let (mut sim, id) = two_balls(G, true);
    let start = sim.robot(id).root_pose();
    assert_eq!(start, sim.robot(id).default_root_pose());
    sim.update(50);
    let (pose, velocity) = (sim.robot(id).root_pose(), sim.robot(id).root_velocity());
    assert_eq!((pose, velocity), (start, Array2::zeros((ENVS, 6))));
    let error = sim.robot_mut(id).write_root_pose(&array![[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]], None);
    assert_error(error, "FixedBody", &["\"robot\"", "fix_base"]);
    assert_error(sim.robot_mut(id).write_root_com_velocity(&Array2::ones((1, 6)), None), "FixedBody", &[]);
    assert_eq!(sim.robot(id).root_com_velocity(), Array2::<f64>::zeros((ENVS, 6)));
}

/// A written root velocity is in world axes and stays there when the root link is moved and rotated; the second ball
/// keeps its motion. A written velocity of the center of mass moves the frame according to its lever arm.
#[test]
fn written_root() {
    let (mut sim, id) = two_balls(0.0, false);
    let moving = [0.5, 0.0, -1.0, 0.0, 0.0, 2.0];
    let mut robot = sim.robot_mut(id);
    robot.write_root_velocity(&array![moving], None).unwrap();
    // A quarter turn about x, not normalized.
    robot.write_root_pose(&array![[1.0, 2.0, 3.0, 2.0, 2.0, 0.0, 0.0]], Some(&[EnvId(2), EnvId(0)])).unwrap();
    let (pose, half) = (sim.robot(id).root_pose(), std::f64::consts::FRAC_1_SQRT_2);
    assert_eq!(pose.row(1).to_vec(), [0.0, 0.0, 5.0, 1.0, 0.0, 0.0, 0.0], "environment 1 was not chosen");
    for env in [0, 2] {
        let limit = Tolerance::absolute(1e-15, "normalization: one rounding of numbers below 3");
        assert_close("pose", pose.row(env), [1.0, 2.0, 3.0, half, half, 0.0, 0.0], limit);
    }
    for env in 0..ENVS {
        let limit = Tolerance::absolute(1e-15, "normalization: one rounding of numbers below 3");
        assert_close("velocity", sim.robot(id).root_velocity().row(env), moving, limit);
    }
    sim.update(100);
    // One second later: 2 rad about the world's z.
    for env in 0..ENVS {
        let limit = Tolerance::absolute(1e-9, "semi-implicit steps of a ball are exact up to rounding");
        assert_close("velocity after a second", sim.robot(id).root_velocity().row(env), moving, limit);
    }
    let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, 2.0)
        * UnitQuaternion::from_euler_angles(std::f64::consts::FRAC_PI_2, 0.0, 0.0);
    let expected = Pose::from_parts(Translation3::new(1.5, 2.0, 2.0), turned);
    let (distance, angle) = pose_error(&pose_of_row(&sim.robot(id).root_pose(), 0), &expected);
    assert!(distance < 1e-9 && angle < 1e-9, "{distance} {angle}");

    let (mut sim, id) = tumbling();
    let before = sim.robot(id).root_com_velocity();
    let wanted = array![[0.5, -1.0, 2.0, 3.0, -0.4, 0.6]];
    sim.robot_mut(id).write_root_com_velocity(&wanted, Some(&[EnvId(2), EnvId(1)])).unwrap();
    let view = sim.robot(id);
    let (found, frame) = (view.root_com_velocity(), view.root_velocity());
    let (pose, com) = (view.root_pose(), view.root_com_position());
    assert_eq!(found.row(0), before.row(0), "environment 0 was not chosen");
    for env in [1, 2] {
        assert_close("what was written", found.row(env), wanted.row(0), EXACT);
        let arm = Vector3::from_fn(|k, _| pose[(env, k)] - com[(env, k)]);
        let expected = Vector3::new(0.5, -1.0, 2.0) + Vector3::new(3.0, -0.4, 0.6).cross(&arm);
        assert_close("velocity of the frame", frame.row(env).iter().take(3), &expected, EXACT);
    }
}

/// v' = v + h a, by the definition of the integrator. The root is fixed here, so no quaternion is integrated.
#[test]
fn accelerations_of_a_step() {
    let (mut sim, id) = sim_with(G, true);
    assert_eq!(sim.robot(id).qacc(), Array2::<f64>::zeros((ENVS, 2)));
    sim.robot_mut(id).set_qpos_target(&array![[1.0, 0.0]], None, Some(&[EnvId(1)])).unwrap();
    let mut difference = 0.0_f64;
    for _ in 0..5 {
        let before = sim.robot(id).qvel();
        sim.update(1);
        let (after, acceleration) = (sim.robot(id).qvel(), sim.robot(id).qacc());
        let limit = Tolerance::absolute(1e-11, "differences of velocities of size 1 lose 1e-16 / h");
        assert_close("acceleration", &acceleration, &((after - before) / 0.01), limit);
        difference = difference.max((acceleration[(0, 0)] - acceleration[(1, 0)]).abs());
    }
    assert!(difference > 10.0, "the control: the drive of environment 1 pushes: {difference}");
    // A write keeps the accelerations; a reset zeroes them.
    let last = sim.robot(id).qacc();
    sim.robot_mut(id).write_qvel(&array![[0.5, -0.5]], None, None).unwrap();
    assert_eq!(sim.robot(id).qacc(), last);
    sim.reset(Some(&[EnvId(1)])).unwrap();
    let after = sim.robot(id).qacc();
    assert_eq!((after.row(0), after.row(1).to_vec()), (last.row(0), vec![0.0; 2]));
}

/// A state that is copied with its accelerations continues bit-identically, because the accelerations warm-start the
/// solver. From any other start the result is within the solver's tolerance. Newton's method stops when the cost, (a -
/// a*)' M (a - a*) / 2 near its minimum, falls by less than 1e-8 of nv times the mean inertia. The smallest inertia
/// here, 0.001 kg m², is a thirteenth of the mean. So a is within sqrt(2e-8 * 2 * 13) = 7.2e-4 rad/s², and the velocity
/// of one step within 7.2e-6 rad/s.
#[test]
fn written_accelerations() {
    let targets = array![[1.0, 0.0], [-0.7, 0.0], [0.2, 0.0]];
    let (mut sim, id) = sim_with(G, true);
    sim.robot_mut(id).set_qpos_target(&targets, None, None).unwrap();
    sim.update(7);
    let state = |sim: &SimulationManager, id| {
        let view = sim.robot(id);
        [view.qpos(), view.qvel(), view.qacc()]
    };
    let [q, v, a] = state(&sim, id);
    let mut others = [Some(a.clone()), None, Some(Array2::from_elem((ENVS, 2), -1e6))].map(|accelerations| {
        let (mut other, here) = sim_with(G, true);
        let mut robot = other.robot_mut(here);
        robot.set_qpos_target(&targets, None, None).unwrap();
        robot.write_qpos(&q, None, None).unwrap();
        robot.write_qvel(&v, None, None).unwrap();
        if let Some(a) = accelerations {
            robot.write_qacc(&a, None, None).unwrap();
            let of_mujoco = other.batch().read(1, |env| env.data().qacc()[..2].to_vec());
            assert_eq!(of_mujoco, a.row(1).to_vec(), "MuJoCo's own, too");
            assert_eq!(state(&other, here), [q.clone(), v.clone(), a], "read back");
        }
        (other, here)
    });
    sim.update(1);
    let after = sim.robot(id).qvel();
    for (k, (other, here)) in others.iter_mut().enumerate() {
        other.update(1);
        let [_, velocity, acceleration] = state(other, *here);
        let limit = Tolerance::absolute(7.2e-6, "the end of Newton's method, see above");
        assert_close(&format!("start {k} of the solver"), &velocity, &after, limit);
        // The written accelerations are replaced by those of the step.
        for (index, a) in acceleration.indexed_iter() {
            let found = (velocity[index] - v[index]) / 0.01;
            let limit = Tolerance::absolute(1e-10 * (1.0 + a.abs()), "differences of velocities lose 1e-16 / h");
            assert_number("accelerations of the step", *a, found, limit);
        }
    }
    let [(same, here), ..] = &mut others;
    for _ in 0..50 {
        assert_eq!(state(same, *here), state(&sim, id));
        same.update(1);
        sim.update(1);
    }
    // Control: an effort of the same size moves the joint.
    let before = sim.robot(id).qvel();
    sim.robot_mut(id).set_qf_target(&array![[50.0, 0.0]], None, Some(&[EnvId(0)])).unwrap();
    sim.update(1);
    let push = &sim.robot(id).qvel() - &before;
    assert!(push[(0, 0)].abs() > 0.1 && push[(1, 0)].abs() < 0.1, "{push}");
}

/// Writes for single joints of single environments; a snapshot contains written accelerations, and a reset zeroes them.
#[test]
fn written_accelerations_of_single_joints() {
    let (mut sim, id) = sim_with(0.0, true);
    let envs = [EnvId(2), EnvId(0)];
    sim.robot_mut(id).write_qacc(&array![[3.0], [-4.0]], Some(&[JointIndex(1)]), Some(&envs)).unwrap();
    let written = array![[0.0, -4.0], [0.0, 0.0], [0.0, 3.0]];
    assert_eq!(sim.robot(id).qacc(), written);
    let snapshot = sim.snapshot(None).unwrap();
    for (values, part) in [
        ([f64::NAN, 0.0], "write_qacc[0, 0] (joint \"hinge\") is NaN"),
        ([0.0, f64::INFINITY], "finite"),
        ([0.0, -1.1e10], "-1e10 to 1e10"),
    ] {
        assert_error(sim.robot_mut(id).write_qacc(&array![values], None, None), "", &[part]);
        assert_eq!(sim.robot(id).qacc(), written, "{part}");
    }
    // The largest valid value does no harm: without a force the joint keeps its position.
    sim.robot_mut(id).write_qacc(&array![[1e10, -1e10]], None, None).unwrap();
    sim.update(1);
    assert!(sim.diverged().is_empty());
    assert!(sim.robot(id).qpos().iter().all(|q| q.abs() < 1e-7), "{}", sim.robot(id).qpos());
    sim.restore(&snapshot, None).unwrap();
    assert_eq!(sim.robot(id).qacc(), written);
    sim.reset(None).unwrap();
    assert_eq!(sim.robot(id).qacc(), Array2::<f64>::zeros((ENVS, 2)));
}

#[test]
fn targets_and_defaults() {
    let (mut sim, id) = sim_with(0.0, false);
    assert_eq!(sim.robot(id).projected_gravity_b(), Array2::<f64>::zeros((ENVS, 3)));
    let state = sim.robot(id).default_root_state();
    assert_eq!(state.row(2).to_vec(), [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!((state.clone(), state.dim()), (sim.robot(id).root_state(), (ENVS, 13)));
    let mut robot = sim.robot_mut(id);
    robot.set_qvel_target(&array![[0.5, 9.0]], None, Some(&[EnvId(1)])).unwrap();
    robot.set_qf_target(&array![[-2.5, 9.0]], None, Some(&[EnvId(2)])).unwrap();
    // The follower's columns are ignored. Targets persist until a change or a reset.
    let targets = |sim: &SimulationManager| [sim.robot(id).qvel_target(), sim.robot(id).qf_target()];
    let expected = [array![[0.0, 0.0], [0.5, 0.0], [0.0, 0.0]], array![[0.0, 0.0], [0.0, 0.0], [-2.5, 0.0]]];
    assert_eq!(targets(&sim), expected);
    sim.update(5);
    assert_eq!(targets(&sim), expected);
    sim.reset(None).unwrap();
    assert_eq!(targets(&sim), [(); 2].map(|()| Array2::<f64>::zeros((ENVS, 2))));
}

#[test]
fn names_and_patterns() {
    let (sim, id) = sim_with(0.0, true);
    let view = sim.robot(id);
    let [hinge, follower] = [JointIndex(0), JointIndex(1)];
    assert_eq!(view.find_joints(&[".*"]).unwrap(), [hinge, follower]);
    assert_eq!(view.find_joints(&["f.*", "hinge"]).unwrap(), [follower, hinge]);
    let links = view.find_links(&["tool", "a.*"]).unwrap();
    assert_eq!(links.iter().map(|l| view.link_names()[l.0]).collect::<Vec<_>>(), ["tool", "arm"]);
    assert_eq!((view.dof(), view.active_dof(), view.qpos().ncols()), (2, 1, 2));
    assert_eq!(view.active_joint_ids(None).unwrap(), [hinge]);
    assert_eq!(view.active_joint_ids("all").unwrap(), [hinge]);
    assert_eq!(view.joint_ids("all").unwrap().len(), 2);
    // Without a control part, the joints are those of the whole robot in the column order of all tables.
    assert_eq!(view.joint_ids(None).unwrap(), [hinge, follower]);
    assert_eq!((view.active_joint_names(), view.mimic_joint_ids()), (vec!["hinge"], vec![follower]));
    assert_eq!(view.mimic_drivers(), [(hinge, 1.0, 0.0), (hinge, -1.0, 0.0)]);
    assert_error(view.find_joints(&["Hinge"]), "", &["robot \"robot\"", "\"Hinge\"", "\"hinge\""]);
    assert_error(view.find_joints(&["hinge", ".*"]), "", &["matched by both"]);
    assert_error(view.find_joints(&["("]), "", &["not a regular expression"]);
    assert_error(view.find_links(&["tol"]), "", &["no link", "\"tool\""]);
    assert_error(view.link_velocity("wrist"), "", &["link \"wrist\"", "\"arm\""]);
    assert_error(view.link_id("Arm"), "", &["link \"Arm\"", "\"arm\""]);
    assert_error(view.active_joint_ids("al"), "", &["control part \"al\"", "\"all\""]);
}

/// Targets by the name of a control part: its joints in the order of its patterns, and no other joint.
#[test]
fn parts() {
    let mut sim = kinetoscope_testkit::worlds::sim(empty_cfg(2));
    let control_parts = vec![("wrist".into(), vec!["JOINT6".into(), "JOINT4".into()])];
    let arm = sim.add_robot(RobotCfg { control_parts, ..kinetoscope_testkit::worlds::sr5("arm") }).unwrap();
    let [six, four] = ["JOINT6", "JOINT4"].map(|name| sim.robot(arm).joint_id(name).unwrap());
    let before = sim.robot(arm).qpos_target();
    let mut wrist = sim.robot_mut(arm).into_part("wrist").unwrap();
    assert_eq!(wrist.joint_ids(), [six, four]);
    wrist.set_qpos_target(&array![[0.2, -0.3]], None).unwrap();
    wrist.set_qvel_target(&array![[0.5, 0.25]], Some(&[EnvId(1)])).unwrap();
    wrist.set_qf_target(&array![[1.0, 2.0], [3.0, 4.0]], Some(&[EnvId(1), EnvId(0)])).unwrap();
    assert_error(wrist.set_qpos_target(&array![[0.2, -0.3, 0.1]], None), "", &["[1, 3]"]);
    let (mut positions, mut velocities, mut efforts) = (before.clone(), 0.0 * &before, 0.0 * &before);
    for (env, [v6, v4], [f6, f4]) in [(0, [0.0, 0.0], [3.0, 4.0]), (1, [0.5, 0.25], [1.0, 2.0])] {
        (positions[(env, six.0)], positions[(env, four.0)]) = (0.2, -0.3);
        (velocities[(env, six.0)], velocities[(env, four.0)]) = (v6, v4);
        (efforts[(env, six.0)], efforts[(env, four.0)]) = (f6, f4);
    }
    let robot = sim.robot(arm);
    let targets = [robot.qpos_target(), robot.qvel_target(), robot.qf_target()];
    assert_eq!(targets, [positions, velocities, efforts]);
    assert_error(sim.robot_mut(arm).into_part("wrst").map(drop), "", &["wrst", "wrist"]);
}

/// The state that is gathered at once is that of the single methods, with a free and a fixed base, and has the same bits
/// for any number of threads. Its memory serves several robots and states.
#[test]
fn gathered() {
    let mut state = RobotState::default();
    assert!(state.root_pose().is_empty() && state.qpos().is_empty());
    let mut run = |num_envs: usize, threads: usize| {
        let cfg = SimulationManagerCfg { num_envs, threads: Some(threads), ..SimulationManagerCfg::legged() };
        let mut sim = kinetoscope_testkit::worlds::sim(cfg);
        let free = sim.add_robot(assets::quadruped().unwrap()).unwrap();
        let arm = RobotCfg { init_pose: Pose::translation(2.0, 0.0, 0.0), ..assets::sr5().unwrap() };
        let fixed = sim.add_robot(arm).unwrap();
        let start = |env: usize| [0.1, 0.2, 0.5 + 1e-3 * env as f64, 0.8, 0.6, 0.0, 0.0];
        let starts = Array2::from_shape_fn((num_envs, 7), |(env, k)| start(env)[k]);
        sim.robot_mut(free).write_root_pose(&starts, None).unwrap();
        let mut all = Vec::new();
        for steps in [0, 1, 40] {
            sim.update(steps);
            for robot in [free, fixed].map(|id| sim.robot(id)) {
                robot.gather_state(&mut state);
                for (what, found, expected) in [
                    ("root_pose", state.root_pose(), robot.root_pose()),
                    ("root_velocity", state.root_velocity(), robot.root_velocity()),
                    ("root_lin_vel_b", state.root_lin_vel_b(), robot.root_lin_vel_b()),
                    ("root_ang_vel_b", state.root_ang_vel_b(), robot.root_ang_vel_b()),
                    ("projected_gravity_b", state.projected_gravity_b(), robot.projected_gravity_b()),
                    ("heading", state.root_heading().insert_axis(Axis(1)), robot.root_heading().insert_axis(Axis(1))),
                ] {
                    assert_close(what, found, &expected, EXACT);
                    all.extend(bits(found));
                }
                for (what, found, expected) in [
                    ("qpos", state.qpos(), robot.qpos()),
                    ("qvel", state.qvel(), robot.qvel()),
                    ("qacc", state.qacc(), robot.qacc()),
                    ("qf", state.qf(), robot.qf()),
                ] {
                    assert!(found == expected, "{what} of {}: {found}, not {expected}", robot.uid());
                    assert!(steps == 0 || found.iter().any(|value| *value != 0.0), "{what} is 0");
                }
            }
        }
        all
    };
    for num_envs in [3, 700] {
        assert!(run(num_envs, 1) == run(num_envs, 3), "{num_envs} environments");
    }
}

//! What is read of a robot's state, against MuJoCo's own Jacobians and closed forms.
//!
//! The velocity of a point that moves with a body is `mj_jac` times the generalised velocity: another way through MuJoCo
//! than ours, which reads `cvel`. Both sum products of a few numbers of size 1 to 10: 1e-12 is a thousand times the
//! rounding. Control: the velocity of the frame's origin and that of the centre of mass differ by far more.

use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::mj::ObjectKind;
use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};

const EXACT: f64 = 1e-12;
const ENVS: usize = 3;

/// A base with its mass off its origin, an arm on a hinge, a finger that follows it, and a tool that is fixed to the arm.
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

fn sim_with(gravity: [f64; 3], fix_base: bool) -> (SimulationManager, RobotId) {
    let files = tempfile::tempdir().unwrap();
    let path = files.path().join("robot.urdf");
    std::fs::write(&path, ROBOT).unwrap();
    let cfg = SimulationManagerCfg { num_envs: ENVS, ground: None, gravity: gravity.into(), ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let robot = sim
        .add_robot(RobotCfg {
            urdf: UrdfCfg::single(path),
            control_parts: vec![("all".into(), vec![".*".into()])],
            drive: DriveCfg { stiffness: 50.0.into(), damping: 5.0.into(), ..Default::default() },
            fix_base,
            ..Default::default()
        })
        .unwrap();
    (sim, robot)
}

/// The robot somewhere, turned and moving, another way in each environment.
fn tumbling() -> (SimulationManager, RobotId) {
    let (mut sim, id) = sim_with([0.0, 0.0, -9.81], false);
    let mut robot = sim.robot_mut(id);
    let angle = |env: usize, axis: usize| 0.3 + 0.7 * env as f64 - 0.4 * axis as f64;
    let turn = |env| UnitQuaternion::from_euler_angles(angle(env, 0), angle(env, 1), angle(env, 2)).into_inner();
    let pose = |env: usize, k: usize| {
        let q = turn(env);
        [1.0, -2.0, 3.0 + env as f64, q.w, q.i, q.j, q.k][k]
    };
    robot.write_root_pose(&Array2::from_shape_fn((ENVS, 7), |(env, k)| pose(env, k)), None).unwrap();
    let velocity = |(env, k): (usize, usize)| 0.8 * ((3 * env + 2 * k + 1) as f64).sin();
    robot.write_root_velocity(&Array2::from_shape_fn((ENVS, 6), velocity), None).unwrap();
    robot.write_qpos(&array![[0.5, -0.5], [-1.2, 1.2], [1.9, -1.9]], None, None).unwrap();
    robot.write_qvel(&array![[1.5, -1.5], [-4.0, 4.0], [0.7, -0.7]], None, None).unwrap();
    (sim, id)
}

/// Velocity of a point of a body and its angular velocity, by MuJoCo's Jacobian.
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

fn assert_near(found: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let off = found.iter().zip(expected).fold(0.0_f64, |off, (a, b)| off.max((a - b).abs()));
    assert!(off <= tolerance, "{what}: {found:?}, expected {expected:?}: off by {off:.1e}");
}

#[test]
fn poses_and_velocities_of_links_are_those_of_mujoco() {
    let (mut sim, id) = tumbling();
    for round in 0..2 {
        let view = sim.robot(id);
        let (poses, velocities) = (view.get_link_poses(), view.get_link_velocities());
        assert_eq!((poses.dim(), velocities.dim()), ((ENVS, 4, 7), (ENVS, 4, 6)));
        for (l, name) in view.link_names().into_iter().enumerate() {
            // The tool is part of the arm's body.
            let body = format!("robot/{}", if name == "tool" { "arm" } else { name });
            let (pose, velocity) = (view.link_pose(name).unwrap(), view.link_velocity(name).unwrap());
            for env in 0..ENVS {
                let what = format!("{name} in environment {env}, round {round}");
                let row = poses.slice_row(env, l);
                assert_eq!(row, pose.row(env).to_vec(), "{what}");
                assert_eq!(velocities.slice_row(env, l), velocity.row(env).to_vec(), "{what}");
                let expected = by_jacobian(&sim, env, &body, [row[0], row[1], row[2]]);
                assert_near(&velocities.slice_row(env, l), &expected, EXACT, &what);
            }
        }
        // The tool is where its mount is on the arm.
        let mount = Pose::from_parts(
            nalgebra::Translation3::new(0.35, 0.02, -0.1),
            UnitQuaternion::from_euler_angles(1.0, 0.5, -0.3),
        );
        for env in 0..ENVS {
            let [arm, tool] = ["arm", "tool"].map(|name| view.link_id(name).unwrap().0);
            let of = |l: usize| {
                let row = poses.slice_row(env, l);
                kinetoscope::scene::pose::from_row(&std::array::from_fn(|k| row[k]))
            };
            assert!((of(arm) * mount).translation.vector.metric_distance(&of(tool).translation.vector) < EXACT);
            assert!((of(arm) * mount).rotation.angle_to(&of(tool).rotation) < 1e-7);
        }
        sim.update(20);
    }
}

trait Rows {
    fn slice_row(&self, env: usize, row: usize) -> Vec<f64>;
}

impl Rows for kinetoscope::ndarray::Array3<f64> {
    fn slice_row(&self, env: usize, row: usize) -> Vec<f64> {
        let axis = kinetoscope::ndarray::Axis(0);
        self.index_axis(axis, env).row(row).to_vec()
    }
}

#[test]
fn the_root_is_told_of_its_frame_its_centre_of_mass_and_in_its_own_axes() {
    let (mut sim, id) = tumbling();
    for _ in 0..2 {
        let view = sim.robot(id);
        let (pose, velocity, state) = (view.get_root_pose(), view.get_root_velocity(), view.get_root_state());
        let (com, com_velocity) = (view.get_root_com_position(), view.get_root_com_velocity());
        let (linear, angular) = (view.get_root_lin_vel_b(), view.get_root_ang_vel_b());
        let (gravity, heading) = (view.get_projected_gravity_b(), view.get_root_heading());
        for env in 0..ENVS {
            let row: [f64; 7] = std::array::from_fn(|k| pose[(env, k)]);
            let root = kinetoscope::scene::pose::from_row(&row);
            assert_eq!(state.row(env).to_vec(), [pose.row(env).to_vec(), velocity.row(env).to_vec()].concat());
            // The file says where the centre of mass is.
            let expected = root * nalgebra::Point3::new(0.1, -0.05, 0.2);
            assert_near(&com.row(env).to_vec(), expected.coords.as_slice(), EXACT, "centre of mass");
            let at_frame = by_jacobian(&sim, env, "robot/base", [row[0], row[1], row[2]]);
            assert_near(&velocity.row(env).to_vec(), &at_frame, EXACT, "velocity of the frame");
            let at_com = by_jacobian(&sim, env, "robot/base", expected.into());
            assert_near(&com_velocity.row(env).to_vec(), &at_com, EXACT, "velocity of the centre of mass");
            let apart = (0..3).fold(0.0_f64, |apart, k| apart.max((at_com[k] - at_frame[k]).abs()));
            assert!(apart > 1e-3, "the control: the two differ");
            // In the root's axes: the rotation matrix, transposed, column by column.
            let axes = root.rotation.to_rotation_matrix();
            let in_axes = |v: [f64; 3]| -> [f64; 3] {
                std::array::from_fn(|k| (0..3).map(|i| axes.matrix()[(i, k)] * v[i]).sum::<f64>())
            };
            let v = at_frame;
            assert_near(&linear.row(env).to_vec(), &in_axes([v[0], v[1], v[2]]), EXACT, "velocity in the root");
            assert_near(
                &angular.row(env).to_vec(),
                &in_axes([v[3], v[4], v[5]]),
                EXACT,
                "angular velocity in the root",
            );
            assert_near(&gravity.row(env).to_vec(), &in_axes([0.0, 0.0, -1.0]), EXACT, "gravity in the root");
            let x_axis = axes.matrix().column(0);
            assert_near(&[heading[env]], &[x_axis[1].atan2(x_axis[0])], EXACT, "heading");
        }
        sim.update(15);
    }
}

/// Known angles: rolled by r, the axes of the root see gravity as (0, -sin r, -cos r); turned by y about z, the heading is y.
#[test]
fn gravity_and_heading_of_known_turns() {
    for gravity in [[0.0, 0.0, -9.81], [0.0, 0.0, -1.62], [0.0; 3]] {
        let (mut sim, id) = sim_with(gravity, false);
        let (roll, yaw) = (0.4_f64, -2.5_f64);
        let [half_r, half_y] = [roll / 2.0, yaw / 2.0];
        let poses = array![
            [0.0, 0.0, 0.0, half_r.cos(), half_r.sin(), 0.0, 0.0],
            [0.0, 0.0, 0.0, half_y.cos(), 0.0, 0.0, half_y.sin()],
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        ];
        sim.robot_mut(id).write_root_pose(&poses, None).unwrap();
        let pull = if gravity[2] < 0.0 { 1.0 } else { 0.0 };
        let (projected, heading) = (sim.robot(id).get_projected_gravity_b(), sim.robot(id).get_root_heading());
        assert_near(&projected.row(0).to_vec(), &[0.0, -pull * roll.sin(), -pull * roll.cos()], EXACT, "rolled");
        assert_near(&projected.row(1).to_vec(), &[0.0, 0.0, -pull], EXACT, "turned");
        assert_near(heading.as_slice().unwrap(), &[0.0, yaw, 0.0], EXACT, "heading");
    }
}

#[test]
fn velocities_of_the_centre_of_mass_are_written() {
    let (mut sim, id) = tumbling();
    let before = sim.robot(id).get_root_com_velocity();
    let wanted = array![[0.5, -1.0, 2.0, 3.0, -0.4, 0.6]];
    sim.robot_mut(id).write_root_com_velocity(&wanted, Some(&[EnvId(2), EnvId(1)])).unwrap();
    let view = sim.robot(id);
    let (found, frame) = (view.get_root_com_velocity(), view.get_root_velocity());
    let (pose, com) = (view.get_root_pose(), view.get_root_com_position());
    assert_eq!(found.row(0), before.row(0), "environment 0 was not chosen");
    for env in [1, 2] {
        assert_near(&found.row(env).to_vec(), &wanted.row(0).to_vec(), EXACT, "what was written");
        let arm = Vector3::from_fn(|k, _| pose[(env, k)] - com[(env, k)]);
        let expected = Vector3::new(0.5, -1.0, 2.0) + Vector3::new(3.0, -0.4, 0.6).cross(&arm);
        assert_near(&frame.row(env).to_vec()[..3], expected.as_slice(), EXACT, "velocity of the frame");
    }
    for (values, part) in [(Array2::zeros((1, 3)), "[1, 3]"), (Array2::from_elem((1, 6), f64::NAN), "finite")] {
        let error = sim.robot_mut(id).write_root_com_velocity(&values, None).unwrap_err().to_string();
        assert!(error.contains("write_root_com_velocity") && error.contains(part), "{error}");
    }
    let error = sim.robot_mut(id).write_root_com_velocity(&wanted, Some(&[EnvId(9)])).unwrap_err().to_string();
    assert!(error.contains("environment 9"), "{error}");
    let (mut fixed, id) = sim_with([0.0; 3], true);
    let error = fixed.robot_mut(id).write_root_com_velocity(&wanted, None).unwrap_err();
    assert!(matches!(error, Error::FixedBody(_)), "{error}");
    assert_eq!(fixed.robot(id).get_root_com_velocity(), Array2::<f64>::zeros((ENVS, 6)));
}

/// v' = v + h a, by the integrator's definition; the root here is fixed, so no quaternion is in the way.
#[test]
fn accelerations_are_those_of_the_last_step() {
    let (mut sim, id) = sim_with([0.0, 0.0, -9.81], true);
    assert_eq!(sim.robot(id).get_qacc(), Array2::<f64>::zeros((ENVS, 2)));
    sim.robot_mut(id).set_qpos(&array![[1.0, 0.0]], None, Some(&[EnvId(1)])).unwrap();
    let mut apart = 0.0_f64;
    for _ in 0..5 {
        let before = sim.robot(id).get_qvel();
        sim.update(1);
        let (after, acceleration) = (sim.robot(id).get_qvel(), sim.robot(id).get_qacc());
        for (i, a) in acceleration.indexed_iter() {
            // Differences of velocities of size 1 lose 1e-16 / h.
            assert_near(&[*a], &[(after[i] - before[i]) / 0.01], 1e-11, "acceleration");
        }
        apart = apart.max((acceleration[(0, 0)] - acceleration[(1, 0)]).abs());
    }
    assert!(apart > 10.0, "the control: the drive of environment 1 pushes: {apart}");
    // A write leaves them, a reset does not.
    let last = sim.robot(id).get_qacc();
    sim.robot_mut(id).write_qvel(&array![[0.5, -0.5]], None, None).unwrap();
    assert_eq!(sim.robot(id).get_qacc(), last);
    sim.reset(Some(&[EnvId(1)])).unwrap();
    let after = sim.robot(id).get_qacc();
    assert_eq!((after.row(0), after.row(1).to_vec()), (last.row(0), vec![0.0; 2]));
}

/// A state that is taken over with its accelerations goes on to the last bit as the one that it was taken from: they are
/// where the solver begins. Wherever it begins, it ends within its tolerance: Newton's method stops where the cost,
/// (a - a*)' M (a - a*) / 2 near its end, falls by less than 1e-8 of nv times the mean inertia. The smallest inertia here,
/// 0.001 kg m², is a thirteenth of the mean, so that a is within sqrt(2e-8 * 2 * 13) = 7.2e-4 rad/s², and the velocity of one
/// step within 7.2e-6 rad/s.
#[test]
fn accelerations_that_are_written_are_told_and_move_nothing() {
    let gravity = [0.0, 0.0, -9.81];
    let targets = array![[1.0, 0.0], [-0.7, 0.0], [0.2, 0.0]];
    let (mut sim, id) = sim_with(gravity, true);
    sim.robot_mut(id).set_qpos(&targets, None, None).unwrap();
    sim.update(7);
    let view = sim.robot(id);
    let (q, v, a) = (view.get_qpos(), view.get_qvel(), view.get_qacc());
    // The same state, from three beginnings of the solver.
    let beginnings = [Some(a.clone()), None, Some(Array2::from_elem((ENVS, 2), -1e6))];
    let mut others = beginnings.map(|accelerations| {
        let (mut other, here) = sim_with(gravity, true);
        let mut robot = other.robot_mut(here);
        robot.set_qpos(&targets, None, None).unwrap();
        robot.write_qpos(&q, None, None).unwrap();
        robot.write_qvel(&v, None, None).unwrap();
        if let Some(a) = accelerations {
            robot.write_qacc(&a, None, None).unwrap();
            assert_eq!(robot.read().get_qacc(), a, "read back");
            assert_eq!((robot.read().get_qpos(), robot.read().get_qvel()), (q.clone(), v.clone()));
            other.batch().read(1, |env| {
                let [hinge, follower] = [env.data().qacc()[0], env.data().qacc()[1]];
                assert_eq!([hinge, follower], [a[(1, 0)], a[(1, 1)]], "MuJoCo's own, too");
            });
        }
        (other, here)
    });
    sim.update(1);
    let after = sim.robot(id).get_qvel();
    for (k, (other, here)) in others.iter_mut().enumerate() {
        other.update(1);
        let off = (&other.robot(*here).get_qvel() - &after).iter().fold(0.0_f64, |off, x| off.max(x.abs()));
        println!("beginning {k}: velocities after the step differ by {off:.1e}");
        assert!(off < 7.2e-6, "beginning {k}: {off}");
        // What was written is gone: the step found its own.
        let found = (&other.robot(*here).get_qvel() - &v) / 0.01;
        for (index, a) in other.robot(*here).get_qacc().indexed_iter() {
            assert_near(&[*a], &[found[index]], 1e-10 * (1.0 + a.abs()), "accelerations of the step");
        }
    }
    let [(same, here), ..] = &mut others;
    for _ in 0..50 {
        assert_eq!(same.robot(*here).get_qvel(), sim.robot(id).get_qvel());
        assert_eq!(
            (same.robot(*here).get_qpos(), same.robot(*here).get_qacc()),
            (sim.robot(id).get_qpos(), sim.robot(id).get_qacc())
        );
        same.update(1);
        sim.update(1);
    }
    // The control: an effort of the same size does move the joint.
    let before = sim.robot(id).get_qvel();
    sim.robot_mut(id).set_qf(&array![[50.0, 0.0]], None, Some(&[EnvId(0)])).unwrap();
    sim.update(1);
    let push = &sim.robot(id).get_qvel() - &before;
    assert!(push[(0, 0)].abs() > 0.1 && push[(1, 0)].abs() < 0.1, "{push}");
}

/// Numbers, joints and environments that do not go together, and what the message says.
type Mistake<'a> = (Array2<f64>, Option<&'a [JointIndex]>, Option<&'a [EnvId]>, &'a str);

/// Single joints of single environments; a snapshot keeps what was written, and a reset does not.
#[test]
fn accelerations_are_written_for_those_that_are_named() {
    let (mut sim, id) = sim_with([0.0; 3], true);
    let follower = [JointIndex(1)];
    sim.robot_mut(id).write_qacc(&array![[3.0], [-4.0]], Some(&follower), Some(&[EnvId(2), EnvId(0)])).unwrap();
    let written = array![[0.0, -4.0], [0.0, 0.0], [0.0, 3.0]];
    assert_eq!(sim.robot(id).get_qacc(), written);
    let snapshot = sim.snapshot(None).unwrap();
    let mistakes: [Mistake<'_>; 9] = [
        (array![[1.0]], None, None, "[1, 1]"),
        (Array2::zeros((2, 2)), None, None, "[3, 2]"),
        (array![[f64::NAN, 0.0]], None, None, "write_qacc[0, 0] (joint \"hinge\") is NaN"),
        (array![[0.0, f64::INFINITY]], None, None, "finite"),
        (array![[0.0, -1.1e10]], None, None, "-1e10 to 1e10"),
        (array![[0.0]], Some(&[JointIndex(2)]), None, "joint 2 does not exist"),
        (array![[0.0, 0.0]], Some(&[JointIndex(1); 2]), None, "write_qacc names joint \"follower\" twice"),
        (array![[0.0, 0.0]], None, Some(&[EnvId(3)]), "environment 3 does not exist"),
        (array![[0.0, 0.0]], None, Some(&[EnvId(1), EnvId(1)]), "write_qacc names environment 1 twice"),
    ];
    for (values, joints, envs, part) in mistakes {
        let error = sim.robot_mut(id).write_qacc(&values, joints, envs).unwrap_err().to_string();
        assert!(error.contains(part), "{part:?} is not in {error}");
        assert_eq!(sim.robot(id).get_qacc(), written, "{error}");
    }
    // The largest that may be does no harm: with no force on it the joint stays where it is.
    sim.robot_mut(id).write_qacc(&array![[1e10, -1e10]], None, None).unwrap();
    sim.update(1);
    assert!(sim.diverged().is_empty());
    let off = sim.robot(id).get_qpos().iter().fold(0.0_f64, |off, x| off.max(x.abs()));
    assert!(off < 1e-7, "{off}");
    sim.restore(&snapshot, None).unwrap();
    assert_eq!(sim.robot(id).get_qacc(), written);
    sim.reset(None).unwrap();
    assert_eq!(sim.robot(id).get_qacc(), Array2::<f64>::zeros((ENVS, 2)));
}

#[test]
fn targets_and_defaults_are_told() {
    let (mut sim, id) = sim_with([0.0; 3], false);
    let state = sim.robot(id).get_default_root_state();
    assert_eq!(state.row(2).to_vec(), [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!((state.clone(), state.dim()), (sim.robot(id).get_root_state(), (ENVS, 13)));
    let mut robot = sim.robot_mut(id);
    robot.set_qvel(&array![[0.5, 9.0]], None, Some(&[EnvId(1)])).unwrap();
    robot.set_qf(&array![[-2.5, 9.0]], None, Some(&[EnvId(2)])).unwrap();
    // The follower's columns are ignored.
    assert_eq!(sim.robot(id).get_target_qvel(), array![[0.0, 0.0], [0.5, 0.0], [0.0, 0.0]]);
    assert_eq!(sim.robot(id).get_target_qf(), array![[0.0, 0.0], [0.0, 0.0], [-2.5, 0.0]]);
    // They stay until changed or reset.
    sim.update(5);
    assert_eq!(sim.robot(id).get_target_qf()[(2, 0)], -2.5);
    sim.reset(None).unwrap();
    assert_eq!(sim.robot(id).get_target_qf(), Array2::<f64>::zeros((ENVS, 2)));
    assert_eq!(sim.robot(id).get_target_qvel(), Array2::<f64>::zeros((ENVS, 2)));
}

#[test]
fn joints_and_links_are_found_by_pattern() {
    let (sim, id) = sim_with([0.0; 3], true);
    let view = sim.robot(id);
    let columns = |patterns: &[&str]| -> Vec<usize> {
        view.find_joints(patterns).unwrap().into_iter().map(|joint| joint.0).collect()
    };
    assert_eq!((columns(&[".*"]), columns(&["f.*", "hinge"])), (vec![0, 1], vec![1, 0]));
    let links: Vec<usize> = view.find_links(&["tool", "a.*"]).unwrap().into_iter().map(|link| link.0).collect();
    let names: Vec<&str> = links.iter().map(|&l| view.link_names()[l]).collect();
    assert_eq!(names, ["tool", "arm"]);
    assert_eq!((view.dof(), view.active_dof()), (2, 1));
    assert_eq!(view.active_joint_ids(), [JointIndex(0)]);
    assert_eq!(view.get_active_joint_ids("all").unwrap(), [JointIndex(0)]);
    assert_eq!(view.get_joint_ids("all").unwrap().len(), 2);
    // Without a part: of the whole robot, which is the columns of every table.
    assert_eq!(view.get_joint_ids(None).unwrap(), [JointIndex(0), JointIndex(1)]);
    assert_eq!(view.get_active_joint_ids(None).unwrap(), view.active_joint_ids());
    assert_eq!((view.active_joint_names(), view.mimic_joint_ids()), (vec!["hinge"], vec![JointIndex(1)]));
    assert_eq!(view.get_qpos().ncols(), view.dof());
    assert_eq!(view.mimic_drivers(), [(JointIndex(0), 1.0, 0.0), (JointIndex(0), -1.0, 0.0)]);
    let errors = [
        (view.find_joints(&["Hinge"]).unwrap_err(), vec!["robot \"robot\"", "\"Hinge\"", "\"hinge\""]),
        (view.find_joints(&["hinge", ".*"]).unwrap_err(), vec!["matched by both"]),
        (view.find_joints(&["("]).unwrap_err(), vec!["not a regular expression"]),
        (view.find_links(&["tol"]).unwrap_err(), vec!["no link", "\"tool\""]),
        (view.link_velocity("wrist").unwrap_err(), vec!["link \"wrist\"", "\"arm\""]),
        (view.link_id("Arm").unwrap_err(), vec!["link \"Arm\"", "\"arm\""]),
        (view.get_active_joint_ids("al").unwrap_err(), vec!["control part \"al\"", "\"all\""]),
    ];
    for (error, parts) in errors {
        for part in parts {
            assert!(error.to_string().contains(part), "{part:?} is not in {error}");
        }
    }
}

/// Targets by the name of a part: its joints in the order of its patterns, and no other joint.
#[test]
fn a_part_is_commanded_by_its_name() {
    let cfg = SimulationManagerCfg { num_envs: 2, ground: None, ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let arm = sim
        .add_robot(RobotCfg {
            urdf: UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap()),
            control_parts: vec![("wrist".into(), vec!["JOINT6".into(), "JOINT4".into()])],
            ..Default::default()
        })
        .unwrap();
    let names = sim.robot(arm).joint_names().iter().map(|name| (*name).to_string()).collect::<Vec<_>>();
    let column = |name: &str| names.iter().position(|other| other == name).unwrap();
    let before = sim.robot(arm).get_target_qpos();
    let mut wrist = sim.robot_mut(arm).into_part("wrist").unwrap();
    assert_eq!(wrist.joint_ids(), [JointIndex(column("JOINT6")), JointIndex(column("JOINT4"))]);
    wrist.set_qpos(&array![[0.2, -0.3]], None).unwrap();
    wrist.set_qvel(&array![[0.5, 0.25]], Some(&[EnvId(1)])).unwrap();
    wrist.set_qf(&array![[1.0, 2.0], [3.0, 4.0]], Some(&[EnvId(1), EnvId(0)])).unwrap();
    let error = wrist.set_qpos(&array![[0.2, -0.3, 0.1]], None).unwrap_err().to_string();
    assert!(error.contains("[1, 3]"), "{error}");
    let (mut positions, mut velocities, mut efforts) = (before.clone(), 0.0 * &before, 0.0 * &before);
    for env in 0..2 {
        positions[(env, column("JOINT6"))] = 0.2;
        positions[(env, column("JOINT4"))] = -0.3;
    }
    (velocities[(1, column("JOINT6"))], velocities[(1, column("JOINT4"))]) = (0.5, 0.25);
    (efforts[(1, column("JOINT6"))], efforts[(1, column("JOINT4"))]) = (1.0, 2.0);
    (efforts[(0, column("JOINT6"))], efforts[(0, column("JOINT4"))]) = (3.0, 4.0);
    let robot = sim.robot(arm);
    assert_eq!(robot.get_target_qpos(), positions);
    assert_eq!(robot.get_target_qvel(), velocities);
    assert_eq!(robot.get_target_qf(), efforts);
    let error = sim.robot_mut(arm).into_part("wrst").unwrap_err().to_string();
    assert!(error.contains("wrst") && error.contains("wrist"), "{error}");
}

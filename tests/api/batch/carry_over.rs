//! What exists goes on as if nothing was added.

use super::support::{arm_and_hand, cfg, free_robot, walker, wheel};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::sim::env::Env;
use kinetoscope::sim::mj::ObjectKind;

/// Bits of the time and of position, velocity, warm start of all joints whose name starts with `prefix`, in order.
fn bits_of_robot(env: &Env, prefix: &str) -> Vec<u64> {
    let (data, model) = (env.data(), env.data().model());
    let mut bits = vec![data.time().to_bits()];
    for joint in 0..model.njnt() {
        if !model.name(ObjectKind::Joint, joint).is_some_and(|name| name.starts_with(prefix)) {
            continue;
        }
        let (nq, nv) = if model.jnt_type()[joint] == 0 { (7, 6) } else { (1, 1) };
        let (q, v) = (model.jnt_qposadr()[joint] as usize, model.jnt_dofadr()[joint] as usize);
        bits.extend(data.qpos()[q..q + nq].iter().map(|x| x.to_bits()));
        bits.extend(data.qvel()[v..v + nv].iter().map(|x| x.to_bits()));
        bits.extend(data.qacc_warmstart()[v..v + nv].iter().map(|x| x.to_bits()));
    }
    bits
}

fn of_all(sim: &SimulationManager, prefix: &str) -> Vec<Vec<u64>> {
    let mut bits = Vec::new();
    sim.batch().for_each(|_, env| bits.push(bits_of_robot(env, prefix)));
    bits
}

#[test]
fn a_robot_in_motion_is_bit_equal_after_another_was_added() {
    let dir = tempfile::tempdir().unwrap();
    let n = 5;
    let mut sim = SimulationManager::new(cfg(n, 2)).unwrap();
    let arm = sim.add_robot(arm_and_hand()).unwrap();
    let legs = sim.add_robot(free_robot(dir.path(), "walker", &walker(), 0.4)).unwrap();
    for robot in [arm, legs] {
        let targets =
            Array2::from_shape_fn((n, sim.robot(robot).dof()), |(e, j)| 0.2 + 0.1 * e as f64 + 0.01 * j as f64);
        sim.robot_mut(robot).set_qpos(&targets, None, None).unwrap();
    }
    for steps in [37, 120, 3] {
        sim.update(steps);
        let before: Vec<_> = ["sr5/", "walker/"].iter().map(|p| of_all(&sim, p)).collect();
        let targets: Vec<_> = [arm, legs].iter().map(|&r| sim.robot(r).get_target_qpos()).collect();
        let efforts: Vec<_> = [arm, legs].iter().map(|&r| sim.robot(r).get_qf()).collect();
        let added = sim.add_robot(free_robot(dir.path(), &format!("late{steps}"), &walker(), 2.0)).unwrap();
        let after: Vec<_> = ["sr5/", "walker/"].iter().map(|p| of_all(&sim, p)).collect();
        assert_eq!(before, after, "{steps}");
        assert!(before[0].iter().all(|bits| bits.len() > 10));
        for (i, &robot) in [arm, legs].iter().enumerate() {
            assert_eq!(sim.robot(robot).get_target_qpos(), targets[i]);
            assert_eq!(sim.robot(robot).get_qf(), efforts[i]);
        }
        let base = sim.robot(added).link_pose("trunk").unwrap();
        assert_eq!(base[(0, 2)], 2.0, "the new one starts at its start");
        assert_eq!(sim.robot(added).get_qpos(), Array2::<f64>::zeros((n, 2)));
    }
}

#[test]
fn a_far_away_robot_does_not_change_where_the_first_one_goes() {
    let dir = tempfile::tempdir().unwrap();
    let run = |add: bool| {
        let mut sim = SimulationManager::new(SimulationManagerCfg { ground: None, ..cfg(2, 1) }).unwrap();
        let arm = sim.add_robot(arm_and_hand()).unwrap();
        let dof = sim.robot(arm).dof();
        sim.robot_mut(arm).set_qpos(&Array2::from_elem((1, dof), 0.3), None, None).unwrap();
        sim.update(30);
        if add {
            let mut other = free_robot(dir.path(), "walker", &walker(), 1.0);
            other.fix_base = true;
            other.init_pose = kinetoscope::scene::pose::from_xyz_rpy([50.0, 0.0, 1.0], [0.0; 3]);
            sim.add_robot(other).unwrap();
        }
        sim.update(100);
        sim.robot(arm).get_qpos()
    };
    // The solver stops when all rows together are good enough: equal to what it leaves, not bit for bit.
    let difference = (run(true) - run(false)).iter().fold(0.0_f64, |most, d| most.max(d.abs()));
    assert!(difference < 1e-6, "{difference:e}");
}

/// What is added between two steps of a scene in which no row of a constraint is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Added {
    Nothing,
    /// A pendulum and a body beside, which meet nothing.
    Beside,
    /// A board under the body that falls.
    InTheWay,
}

/// Positions, velocities, poses over one second after `added`, of a body that tumbles and falls, a passive pendulum and a wheel
/// with an explicit drive.
fn second_without_rows(added: Added) -> Vec<f64> {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(SimulationManagerCfg { ground: None, ..cfg(2, 1) }).unwrap();
    let passive = || DriveCfg { drive_type: DriveType::None, ..Default::default() };
    let explicit = DriveCfg {
        actuators: vec![(".*".into(), IdealPd {}.into())],
        stiffness: 3.0.into(),
        damping: 0.2.into(),
        ..Default::default()
    };
    let at = |x: f64| Pose::translation(x, 0.0, 1.0);
    let pendulum = sim.add_robot(RobotCfg { uid: "pendulum".into(), drive: passive(), ..wheel(dir.path()) }).unwrap();
    let wheel_at = |x: f64| RobotCfg { init_pose: at(x), ..wheel(dir.path()) };
    let motor = sim.add_robot(RobotCfg { uid: "motor".into(), drive: explicit, ..wheel_at(5.0) }).unwrap();
    let cube = |uid: &str, x: f64, body_type| RigidObjectCfg {
        uid: uid.into(),
        shape: ObjectShape::Box { size: [0.2, 0.3, 0.1] },
        init_pose: at(x),
        body_type,
        ..Default::default()
    };
    let body = sim.add_rigid_object(cube("body", 10.0, BodyType::Dynamic)).unwrap();
    let driven = [pendulum, motor].map(|robot| sim.robot(robot).is_driven(JointIndex(0)).unwrap());
    assert_eq!(driven, [false, true]);
    sim.robot_mut(motor).set_qpos(&kinetoscope::ndarray::array![[1.5], [-0.4]], None, None).unwrap();
    let spin = kinetoscope::ndarray::array![[0.1, 0.2, 1.0, 3.0, -2.0, 1.0]];
    sim.rigid_object_mut(body).write_velocity(&spin, None).unwrap();
    sim.update(30);
    match added {
        Added::Nothing => {}
        Added::Beside => {
            sim.add_robot(RobotCfg { uid: "late".into(), drive: passive(), ..wheel_at(15.0) }).unwrap();
            sim.add_rigid_object(cube("late body", 20.0, BodyType::Dynamic)).unwrap();
        }
        Added::InTheWay => {
            let board = ObjectShape::Box { size: [4.0, 4.0, 0.1] };
            let cfg = cube("board", 10.0, BodyType::Static);
            sim.add_rigid_object(RigidObjectCfg { shape: board, init_pose: Pose::translation(10.0, 0.0, 0.0), ..cfg })
                .unwrap();
        }
    }
    let mut states = Vec::new();
    for _ in 0..(1.0 / sim.cfg().physics_dt).round() as usize {
        let rows = sim.batch().read(0, |env| env.data().efc_type().len());
        assert!(rows == 0 || added == Added::InTheWay, "{rows} rows");
        sim.update(1);
        for robot in [pendulum, motor] {
            states.extend(sim.robot(robot).get_qpos());
            states.extend(sim.robot(robot).get_qvel());
        }
        states.extend(sim.rigid_object(body).get_pose());
        states.extend(sim.rigid_object(body).get_velocity());
    }
    states
}

/// Without rows of constraints nothing is solved together: MuJoCo's inertia matrix has a block for each tree, whose
/// factor and acceleration are computed from that tree alone. What may differ is the order of sums, by rounding: 1e-16 of
/// numbers up to 20, 100 steps, and a pendulum, the only thing here that makes differences grow, by less than
/// exp(1 s * sqrt(m g l / I)) = exp(7): 2e-10.
#[test]
fn without_rows_of_constraints_what_exists_goes_on_as_if_nothing_was_added() {
    let alone = second_without_rows(Added::Nothing);
    let far = |added| {
        let other = second_without_rows(added);
        assert_eq!(other.len(), alone.len());
        alone.iter().zip(other).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()))
    };
    let beside = far(Added::Beside);
    assert!(beside < 1e-9, "{beside:e}");
    // It could be seen: a board that the body falls on changes where it goes.
    let in_the_way = far(Added::InTheWay);
    assert!(in_the_way > 0.1, "{in_the_way:e}");
    assert!(alone.iter().all(|x| x.is_finite()) && alone.iter().any(|x| x.abs() > 3.0));
}

#[test]
fn growths_survive_a_recompile() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(2, 1)).unwrap();
    let mut plate = free_robot(dir.path(), "plate", &super::support::plate(14, 0), 0.1);
    plate.init_pose = kinetoscope::scene::pose::from_xyz_rpy([0.0, 0.0, 0.03], [0.0; 3]);
    sim.add_robot(plate).unwrap();
    sim.update(40);
    let before = sim.buffer_growths();
    assert!(before > 0);
    sim.add_robot(free_robot(dir.path(), "walker", &walker(), 1.0)).unwrap();
    assert!(sim.buffer_growths() >= before, "{} {before}", sim.buffer_growths());
    let mujoco: Vec<_> = sim.warning_counts().into_keys().filter(|name| name.starts_with("mujoco")).collect();
    assert!(mujoco.is_empty(), "{mujoco:?}");
}

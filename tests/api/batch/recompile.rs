//! Recompilation: existing entities continue as if nothing had been added.

use super::support::{add_plate, add_walker, assert_quiet, cfg, sim, wheel};
use kinetoscope::mujoco::ObjectKind;
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::IdealPd;
use kinetoscope::sim::env::SimEnv;
use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::worlds::{arm_and_hand, fixed, gains, no_drive, object};

/// Bits of the time and of position, velocity and warm start of all joints with names that start with `prefix`, in
/// order.
fn bits_of_robot(env: &SimEnv, prefix: &str) -> Vec<u64> {
    let (data, model) = (env.data(), env.data().model());
    let mut bits = vec![data.time().to_bits()];
    for joint in 0..model.njnt() {
        if !model.name(ObjectKind::Joint, joint).is_some_and(|name| name.starts_with(prefix)) {
            continue;
        }
        let (nq, nv) = if model.jnt_type()[joint] == 0 { (7, 6) } else { (1, 1) };
        let (q, v) = (model.jnt_qposadr()[joint] as usize, model.jnt_dofadr()[joint] as usize);
        let numbers = [&data.qpos()[q..q + nq], &data.qvel()[v..v + nv], &data.qacc_warmstart()[v..v + nv]];
        bits.extend(numbers.into_iter().flatten().map(|x| x.to_bits()));
    }
    bits
}

/// Bits by robot and environment, and targets and efforts by robot.
type State = ([Vec<Vec<u64>>; 2], [[Array2<f64>; 2]; 2]);

fn state(sim: &SimulationManager, robots: [RobotId; 2]) -> State {
    let bits = ["sr5/", "walker/"].map(|prefix| {
        let mut bits = Vec::new();
        sim.batch().for_each(|_, env| bits.push(bits_of_robot(env, prefix)));
        bits
    });
    (bits, robots.map(|robot| [sim.robot(robot).qpos_target(), sim.robot(robot).qf()]))
}

#[test]
fn robot_in_motion() {
    let n = 5;
    let mut sim = sim(cfg(n, 2));
    let robots = [sim.add_robot(arm_and_hand("sr5")).unwrap(), add_walker(&mut sim, "walker", 0.4)];
    for robot in robots {
        let target = |(e, j)| 0.2 + 0.1 * e as f64 + 0.01 * j as f64;
        let targets = Array2::from_shape_fn((n, sim.robot(robot).dof()), target);
        sim.robot_mut(robot).set_qpos_target(&targets, None, None).unwrap();
    }
    for steps in [37, 120, 3] {
        sim.update(steps);
        let before = state(&sim, robots);
        let added = add_walker(&mut sim, &format!("late{steps}"), 2.0);
        assert_eq!(state(&sim, robots), before, "{steps}");
        assert!(before.0[0].iter().all(|bits| bits.len() > 10));
        assert_eq!(sim.robot(added).link_pose("trunk").unwrap()[(0, 2)], 2.0, "the new one starts at its start");
        assert_eq!(sim.robot(added).qpos(), Array2::<f64>::zeros((n, 2)));
    }
}

#[test]
fn robot_far_away() {
    let [with, without] = [true, false].map(|add| {
        let mut sim = sim(SimulationManagerCfg { ground: None, ..cfg(2, 1) });
        let arm = sim.add_robot(arm_and_hand("sr5")).unwrap();
        let dof = sim.robot(arm).dof();
        sim.robot_mut(arm).set_qpos_target(&Array2::from_elem((1, dof), 0.3), None, None).unwrap();
        sim.update(30);
        if add {
            let files = TempFiles::default();
            sim.add_robot(RobotCfg { init_pose: Pose::translation(50.0, 0.0, 1.0), ..wheel(&files) }).unwrap();
        }
        sim.update(100);
        sim.robot(arm).qpos()
    });
    // The solver stops when all rows together have converged, so results agree to its tolerance but not bit for bit.
    let difference = (with - without).iter().fold(0.0_f64, |most, d| most.max(d.abs()));
    assert!(difference < 1e-6, "{difference:e}");
}

/// An addition between two steps of a scene without constraint rows.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Added {
    Nothing,
    /// A pendulum and a body without contact to the existing ones.
    Beside,
    /// A board under the falling body.
    InTheWay,
}

/// Positions, velocities and poses over one second after the addition, for a tumbling falling body, a passive pendulum
/// and a wheel with an explicit drive.
fn second_without_rows(added: Added) -> Vec<f64> {
    let (files, mut sim) = (TempFiles::default(), sim(SimulationManagerCfg { ground: None, ..cfg(2, 1) }));
    let wheel_at = |uid: &str, x: f64, drive| RobotCfg {
        uid: uid.into(),
        drive,
        init_pose: Pose::translation(x, 0.0, 1.0),
        ..wheel(&files)
    };
    let body_at = |uid, x, size| object(uid, ObjectShape::Box { size }, x);
    let pendulum = RobotCfg { uid: "pendulum".into(), drive: no_drive(), ..wheel(&files) };
    let pendulum = sim.add_robot(pendulum).unwrap();
    let explicit = DriveCfg { actuators: vec![(".*".into(), IdealPd {}.into())], ..gains(3.0, 0.2) };
    let motor = sim.add_robot(wheel_at("motor", 5.0, explicit)).unwrap();
    let body = sim.add_rigid_object(body_at("body", [10.0, 0.0, 1.0], [0.2, 0.3, 0.1])).unwrap();
    let driven = [pendulum, motor].map(|robot| sim.robot(robot).is_driven(JointIndex(0)).unwrap());
    assert_eq!(driven, [false, true]);
    sim.robot_mut(motor).set_qpos_target(&array![[1.5], [-0.4]], None, None).unwrap();
    sim.rigid_object_mut(body).write_velocity(&array![[0.1, 0.2, 1.0, 3.0, -2.0, 1.0]], None).unwrap();
    sim.update(30);
    match added {
        Added::Nothing => {}
        Added::Beside => {
            sim.add_robot(wheel_at("late", 15.0, no_drive())).unwrap();
            sim.add_rigid_object(body_at("late body", [20.0, 0.0, 1.0], [0.2, 0.3, 0.1])).unwrap();
        }
        Added::InTheWay => {
            sim.add_rigid_object(fixed(body_at("board", [10.0, 0.0, 0.0], [4.0, 4.0, 0.1]))).unwrap();
        }
    }
    let mut states = Vec::new();
    for _ in 0..(1.0 / sim.cfg().physics_dt).round() as usize {
        let rows = sim.batch().read(0, |env| env.data().efc_type().len());
        assert!(rows == 0 || added == Added::InTheWay, "{rows} rows");
        sim.update(1);
        for robot in [pendulum, motor] {
            states.extend(sim.robot(robot).qpos());
            states.extend(sim.robot(robot).qvel());
        }
        states.extend(sim.rigid_object(body).pose());
        states.extend(sim.rigid_object(body).velocity());
    }
    states
}

/// Without constraint rows, trees are independent: MuJoCo's inertia matrix has a block for each tree, whose factor and
/// acceleration depend on that tree alone. Only the order of sums may differ, by rounding: 1e-16 of numbers up to 20,
/// over 100 steps. The pendulum, the only part that amplifies differences, does so by less than exp(1 s * sqrt(m g l /
/// I)) = exp(7): 2e-10. Control: a board under the falling body.
#[test]
fn scene_without_rows() {
    let alone = second_without_rows(Added::Nothing);
    let [beside, in_the_way] = [Added::Beside, Added::InTheWay].map(|added| {
        let other = second_without_rows(added);
        assert_eq!(other.len(), alone.len());
        alone.iter().zip(other).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()))
    });
    assert!(beside < 1e-9 && in_the_way > 0.1, "{beside:e} {in_the_way:e}");
    assert!(alone.iter().all(|x| x.is_finite()) && alone.iter().any(|x| x.abs() > 3.0));
}

#[test]
fn growths() {
    let mut sim = sim(cfg(2, 1));
    add_plate(&mut sim, [14, 0], [0.0, 0.0, 0.03], [0.0; 3]);
    sim.update(40);
    let before = sim.warnings().buffer_growths();
    assert!(before > 0);
    add_walker(&mut sim, "walker", 1.0);
    assert!(sim.warnings().buffer_growths() >= before, "{} {before}", sim.warnings().buffer_growths());
    assert_quiet(&sim);
}

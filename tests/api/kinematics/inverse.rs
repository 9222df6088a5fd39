//! Inverse kinematics of whole arms: reachable poses are found, limits hold, and mimic joints follow. A null space is
//! used for the requested posture, and solutions do not depend on the batch.

use super::*;
use kinetoscope::ndarray::array;
use kinetoscope::robot::kinematics::{IkCfg, NullSpacePosture, TipFrame};
use kinetoscope_testkit::urdf::joint;
use nalgebra::DMatrix;
use std::f64::consts::{PI, TAU};

/// Targets are MuJoCo's poses of `link` at random positions, or at positions with one, two or three joints at their
/// limits. Each search starts from the default positions. Solutions must be within the limits, MuJoCo must confirm the
/// reported success or failure, and 99 % must be found.
fn check(name: &str, cfg: RobotCfg, link: &str, at_limits: bool) {
    let (mut sim, id) = simulation(1, cfg);
    let limits = sim.robot(id).qpos_limits();
    let (targets, seed) = if at_limits { (60, 31) } else { (1000, 21) };
    let mut reachable = random_qpos(&sim, id, targets, seed);
    for (row, mut qpos) in reachable.rows_mut().into_iter().enumerate().filter(|_| at_limits) {
        for k in 0..=row % 3 {
            let joint = (row + 2 * k) % qpos.len();
            qpos[joint] = limits[(0, joint, row / 2 % 2)];
        }
    }
    let start = sim.robot(id).default_qpos();
    let mut solved = 0;
    for at in 0..targets {
        let target = mujoco_link_poses(&mut sim, id, &reachable.select(Axis(0), &[at]), link);
        // The start is the robot's state, or given explicitly.
        if !at_limits {
            mujoco_link_poses(&mut sim, id, &start, link);
        }
        let (tip, initial) = (TipFrame::of_part("arm").at(link), at_limits.then_some(start.view()));
        let found = sim.robot(id).compute_ik(&target, tip, &IkCfg::default(), initial, None).unwrap();
        for (joint, &q) in found.qpos.iter().enumerate() {
            assert!(q >= limits[(0, joint, 0)] && q <= limits[(0, joint, 1)], "{name}: joint {joint} at {q}");
        }
        let (far, turned) = max_pose_difference(&mujoco_link_poses(&mut sim, id, &found.qpos, link), &target);
        assert!((far - found.position_error[0]).abs() < 1e-12 && (turned - found.rotation_error[0]).abs() < 1e-12);
        assert_eq!(reaches((far, turned)), found.success[0], "{name}, target {at}: {far} m, {turned} rad");
        solved += usize::from(found.success[0]);
    }
    println!("{name}: {solved} of {targets} solved");
    assert!(solved >= targets * 99 / 100, "{name}: {solved} of {targets}");
    // Control: the default position itself is not a solution.
    let first = mujoco_link_poses(&mut sim, id, &reachable.select(Axis(0), &[0]), link);
    let (far, _) = max_pose_difference(&mujoco_link_poses(&mut sim, id, &start, link), &first);
    assert!(far > 0.01, "{name}: {far}");
}

#[test]
fn reachable_poses() {
    check("SR5", sr5(), "ee_link", false);
    check("seven axes", seven_axes(), "link8", false);
    check("six axes, three of them parallel", six_axes(), "tool0", false);
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn vendors_robot() {
    let urdf = kinetoscope_testkit::test_resources::robot("rokae_description/urdf/SR5.urdf");
    check("the vendor's SR5", arm(urdf), "xMateSR5_link6", false);
}

#[test]
fn poses_at_limits() {
    check("SR5", sr5(), "ee_link", true);
    check("seven axes", seven_axes(), "link8", true);
}

/// A joint without limits takes the shortest way from its start, without unneeded turns.
#[test]
fn no_unneeded_turns() {
    let joints = [
        joint("turn", "continuous", ["root", "a"], [0.0; 3], "0 0 1", ""),
        joint("lift", "prismatic", ["a", "b"], [0.4, 0.0, 0.0], "0 0 1", &wide([0.0, 0.5])),
    ];
    let (sim, id) = built(1, &["root", "a", "b"], &joints);
    for (now, aim, expected) in
        [(0.0, 3.0, 3.0), (0.0, 4.0, 4.0 - TAU), (13.0, 1.0, 1.0 + 2.0 * TAU), (-20.0, 0.5, 0.5 - 3.0 * TAU)]
    {
        let target = sim.robot(id).compute_fk(&array![[aim, 0.3]], "arm", None).unwrap();
        let start = array![[now, 0.0]];
        let found = sim.robot(id).compute_ik(&target, "arm", &IkCfg::default(), Some(start.view()), None).unwrap();
        assert!(found.success[0], "{found:?}");
        assert!((found.qpos[(0, 0)] - expected).abs() < 1e-5, "{} is not {expected}", found.qpos);
        assert!((found.qpos[(0, 0)] - now).abs() <= PI + 1e-3 && (found.qpos[(0, 1)] - 0.3).abs() < 1e-5);
    }
}

/// An arm whose second joint is a mimic of the first: the solution, written into MuJoCo with the follower's position,
/// reaches the target. The follower's own limits bind its driver.
#[test]
fn followers() {
    let limit = wide([-1.5, 1.5]);
    let mimic = format!("{limit}<mimic joint=\"a\" multiplier=\"0.8\" offset=\"0.1\"/>");
    let joints = [
        joint("a", "revolute", ["root", "1"], [0.0, 0.0, 0.2], "0 1 0", &limit),
        joint("b", "revolute", ["1", "2"], [0.3, 0.0, 0.0], "0 1 0", &mimic),
        joint("c", "revolute", ["2", "3"], [0.3, 0.0, 0.0], "0 0 1", &limit),
        joint("d", "prismatic", ["3", "4"], [0.2, 0.0, 0.0], "1 0 0", &wide([0.0, 0.3])),
    ];
    let (mut sim, id) = built(1, &["root", "1", "2", "3", "4"], &joints);
    for there in random_qpos(&sim, id, 30, 5).rows() {
        let target = mujoco_link_poses(&mut sim, id, &there.to_owned().insert_axis(Axis(0)), "4");
        sim.reset(None).unwrap();
        let found = sim.robot(id).compute_ik(&target, "arm", &IkCfg::default(), None, None).unwrap();
        assert!(found.success[0], "{there}: {found:?}");
        assert_eq!(found.qpos[(0, 1)], 0.8 * found.qpos[(0, 0)] + 0.1);
        assert!(found.qpos.iter().take(3).all(|q| q.abs() <= 1.5 + 1e-12));
        let off = max_pose_difference(&mujoco_link_poses(&mut sim, id, &found.qpos, "4"), &target);
        assert!(reaches(off), "{off:?}");
    }
}

/// Joints that do not move the frame keep their start positions.
#[test]
fn idle_joints() {
    let (sim, id) = simulation(1, arm_and_hand());
    let robot = sim.robot(id);
    let target = robot.compute_fk(&random_qpos(&sim, id, 1, 8), "left_index_prox", None).unwrap();
    let start = Array2::from_elem((1, robot.dof()), 0.2);
    let found = robot.compute_ik(&target, "left_index_prox", &IkCfg::default(), Some(start.view()), None).unwrap();
    assert!(found.success[0]);
    let at = |name: &str| found.qpos[(0, robot.joint_id(name).unwrap().0)];
    assert!(at("LEFT_HAND_THUMB1") == 0.2 && at("LEFT_HAND_RING") == 0.2 && at("JOINT2") != 0.2);
    let dip = at("LEFT_THUMB_DIP");
    assert!((dip - 1.05 * 0.2).abs() < 1e-15, "a follower follows: {dip}");
}

/// The same problem has the same solution, bit by bit, in any environment, batch and order.
#[test]
fn batch_order() {
    let (sim, id) = simulation(8, seven_axes());
    let robot = sim.robot(id);
    let targets = robot.compute_fk(&random_qpos(&sim, id, 8, 51), "arm", None).unwrap();
    let cfg = IkCfg { posture: Some(NullSpacePosture::at([0.1; 7])), ..Default::default() };
    let whole = robot.compute_ik(&targets, "arm", &cfg, None, None).unwrap();
    assert_eq!(whole, robot.compute_ik(&targets, "arm", &cfg, None, None).unwrap());
    let order = [5, 0, 7, 3];
    let some = robot.compute_ik(&targets.select(Axis(0), &order), "arm", &cfg, None, Some(&order.map(EnvId))).unwrap();
    for (k, &env) in order.iter().enumerate() {
        assert_eq!(some.qpos.row(k), whole.qpos.row(env));
        assert_eq!(some.position_error[k].to_bits(), whole.position_error[env].to_bits());
        // Another environment, in a simulation with only this one, and a typed pose.
        let (alone, id) = simulation(1, seven_axes());
        let one = alone.robot(id).compute_ik(&[pose_of_row(&targets, env)], "arm", &cfg, None, None).unwrap();
        let expected = (whole.qpos.row(env), whole.seed[env], whole.iterations[env]);
        assert_eq!((one.qpos.row(0), one.seed[0], one.iterations[0]), expected);
    }
    // Another seed gives other starts to the problems that need several starts.
    let other = robot.compute_ik(&targets, "arm", &IkCfg { seed: 1, ..cfg }, None, None).unwrap();
    let differ = (0..8).filter(|&env| other.qpos.row(env) != whole.qpos.row(env)).count();
    let needed = (0..8).filter(|&env| whole.seed[env] > 0).count();
    assert!(needed > 0 && differ <= needed && differ > 0, "{differ} of {needed}");
}

/// One target for all environments, each with another root pose: the hand reaches the same place in every environment.
#[test]
fn moving_roots() {
    let (mut sim, id) = simulation(3, RobotCfg { fix_base: false, ..seven_axes() });
    let target =
        sim.robot(id).compute_fk(&array![[0.3, -0.5, 0.2, -2.0, 0.1, 1.7, 0.5]], "arm", Some(&[EnvId(0)])).unwrap();
    let roots = array![
        [0.1, 0.0, 0.05, 1.0, 0.0, 0.0, 0.0],
        [-0.1, 0.1, 0.0, 0.98, 0.0, 0.0, 0.2],
        [0.0, 0.0, -0.1, 0.99, 0.1, 0.0, 0.0]
    ];
    sim.robot_mut(id).write_root_pose(&roots, None).unwrap();
    let found = sim.robot(id).compute_ik(&target, "arm", &IkCfg::default(), None, None).unwrap();
    assert!(found.success.iter().all(|success| *success), "{found:?}");
    assert!(found.qpos.row(0) != found.qpos.row(1));
    let all = target.select(Axis(0), &[0, 0, 0]);
    let off = max_pose_difference(&mujoco_link_poses(&mut sim, id, &found.qpos, "link8"), &all);
    assert!(reaches(off), "{off:?}");
    // Control: the solution for one root is wrong for another.
    assert!(
        max_pose_difference(&mujoco_link_poses(&mut sim, id, &found.qpos.select(Axis(0), &[0, 0, 0]), "link8"), &all).0
            > 0.05
    );
}

/// Computations do not change the state.
#[test]
fn nothing_is_written() {
    let (mut sim, id) = simulation(2, sr5());
    sim.update(3);
    let state = |robot: &kinetoscope::sim::Robot<'_>| (robot.qpos(), robot.qvel(), robot.qpos_target());
    let (robot, before) = (sim.robot(id), state(&sim.robot(id)));
    let targets = robot.compute_fk(&random_qpos(&sim, id, 2, 6), "arm", None).unwrap();
    assert!(robot.compute_ik(&targets, "arm", &IkCfg::default(), None, None).unwrap().success[1]);
    robot.jacobian("arm", None, None).unwrap();
    assert_eq!(before, state(&sim.robot(id)));
}

const READY: [f64; 7] = [0.0, -0.8, 0.0, -2.3, 0.0, 1.6, 0.8];

fn distance(qpos: &Array2<f64>) -> f64 {
    qpos.iter().zip(READY).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// The null-space motion of the joints: the singular vector of the vanishing singular value of the Jacobian; and the
/// smallest remaining singular value.
fn null_space_motion(sim: &SimulationManager, id: RobotId, qpos: &Array2<f64>) -> (Vec<f64>, f64) {
    let jacobian = sim.robot(id).jacobian("arm", Some(qpos.view()), None).unwrap();
    let svd = DMatrix::from_fn(7, 7, |row, k| if row < 6 { jacobian[(0, row, k)] } else { 0.0 }).svd(false, true);
    let mut values: Vec<f64> = svd.singular_values.iter().copied().collect();
    values.sort_by(f64::total_cmp);
    (svd.v_t.unwrap().row(svd.singular_values.imin()).iter().copied().collect(), values[1])
}

/// An arm of seven axes keeps its pose and minimizes the distance to the posture: on the curve of positions that reach
/// the target the distance is stationary. Exceptions are an active limit, and a singular position, where that curve has
/// a bend that steps of finite length do not follow.
#[test]
fn posture() {
    let (mut sim, id) = simulation(1, seven_axes());
    let with = IkCfg { posture: Some(NullSpacePosture::at(READY)), max_iterations: 1000, ..Default::default() };
    let limits = sim.robot(id).qpos_limits();
    let (mut nearer, mut still, mut stuck) = (0, 0, 0);
    for there in random_qpos(&sim, id, 100, 41).rows() {
        let target = mujoco_link_poses(&mut sim, id, &there.to_owned().insert_axis(Axis(0)), "link8");
        sim.reset(None).unwrap();
        let [a, b] =
            [&IkCfg::default(), &with].map(|cfg| sim.robot(id).compute_ik(&target, "arm", cfg, None, None).unwrap());
        assert!(a.success[0] && b.success[0], "{a:?} {b:?}");
        let off = max_pose_difference(&mujoco_link_poses(&mut sim, id, &b.qpos, "link8"), &target);
        assert!(reaches(off), "the posture costs the target: {off:?}");
        assert!(distance(&b.qpos) <= distance(&a.qpos) + 1e-3, "{} {}", distance(&b.qpos), distance(&a.qpos));
        nearer += usize::from(distance(&b.qpos) < distance(&a.qpos) - 0.05);

        let room = |k: usize, q: f64| (q - limits[(0, k, 0)]).min(limits[(0, k, 1)] - q);
        let at_limit = b.qpos.iter().enumerate().any(|(k, &q)| room(k, q) < 1e-3);
        let [before, slope] = [&a.qpos, &b.qpos].map(|qpos| {
            let (along, _) = null_space_motion(&sim, id, qpos);
            (0..7).map(|k| along[k] * (READY[k] - qpos[(0, k)])).sum::<f64>()
        });
        if at_limit || null_space_motion(&sim, id, &b.qpos).1 < 5e-3 {
            stuck += 1;
        } else {
            assert!(slope.abs() < 1e-3, "it could go on: {slope} (without a posture {before})");
            still += usize::from(before.abs() > 1e-2);
        }
    }
    assert!(nearer >= 50 && still >= 30 && stuck <= 40, "{nearer} {still} {stuck}");
}

/// A small gain moves a small part of the way; six axes have no null space.
#[test]
fn posture_gains() {
    let (sim, id) = simulation(1, seven_axes());
    let target = sim.robot(id).compute_fk(&random_qpos(&sim, id, 1, 41), "arm", None).unwrap();
    let gain = |gain| Some(NullSpacePosture { gain, ..NullSpacePosture::at(READY) });
    let [none, small, whole] = [None, gain(1e-3), gain(1.0)].map(|posture| {
        let cfg = IkCfg { posture, ..Default::default() };
        let found = sim.robot(id).compute_ik(&target, "arm", &cfg, None, None).unwrap();
        assert!(found.success[0], "{found:?}");
        distance(&found.qpos)
    });
    assert!(none - 1e-3 > small && small > whole + 0.1, "{none} {small} {whole}");

    let (sim, id) = simulation(1, six_axes());
    let target = sim.robot(id).compute_fk(&random_qpos(&sim, id, 1, 3), "arm", None).unwrap();
    let [a, b] = [None, Some(NullSpacePosture::at([0.0; 6]))].map(|posture| {
        let cfg = IkCfg { posture, ..Default::default() };
        sim.robot(id).compute_ik(&target, "arm", &cfg, None, None).unwrap().qpos
    });
    assert!((&a - &b).iter().all(|d| d.abs() < 1e-6), "{a} {b}");
}

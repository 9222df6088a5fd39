//! Drives that are changed while they run: gains, types and limits, per joint and per environment.
//!
//! The laws are those of `law.rs` and `modes.rs`, with their tolerance of 1e-9: a joint of constant inertia M without other
//! loads goes to v' = (M v + h kp (q* - q)) / (M + h kd + h² kp). Control: an environment that was not named does what it
//! did before, to the last bit.

use crate::drives::worlds::*;
use kinetoscope::ndarray::{Array2, Array3, array};
use kinetoscope::prelude::*;

const EXACT: f64 = 1e-9;
const H: f64 = 0.01;
const M: [f64; 2] = [0.2, 0.5];
const AIM: f64 = 0.4;
const ENVS: usize = 3;

/// Two wheels that do not feel each other, in three environments, with targets set.
fn wheels(drive: DriveCfg) -> World {
    let joints = [Joint::wheel("a", M[0]), Joint::wheel("b", M[1])];
    let mut world = world(&joints, drive, SimulationManagerCfg { num_envs: ENVS, ..weightless() });
    world.aim(&[AIM; 2]);
    world
}

/// Velocity after one step from rest at 0.
fn first_speed(m: f64, kp: f64, kd: f64) -> f64 {
    H * kp * AIM / (m + H * kd + H * H * kp)
}

/// What is asked of every drive: everything that a getter tells.
fn told(world: &World) -> String {
    let view = world.view();
    let tables = [view.get_stiffness(), view.get_damping(), view.qf_limits(), view.qvel_limits()];
    let ends = [view.qpos_limits(), view.soft_qpos_limits()];
    format!("{tables:?} {ends:?} {:?} {:?}", view.get_drive_types(), view.get_target_qpos())
}

#[test]
fn gains_of_some_joints_in_some_environments_are_the_law_there() {
    let mut world = wheels(gains(100.0, 10.0));
    let mut robot = world.sim.robot_mut(world.robot);
    let second = [JointIndex(1)];
    robot.set_stiffness(&array![[300.0], [50.0]], Some(&second), Some(&[EnvId(2), EnvId(1)])).unwrap();
    // A single row is for all of them; columns in the order given.
    robot
        .set_damping(&array![[7.0, 20.0]], Some(&[JointIndex(1), JointIndex(0)]), Some(&[EnvId(1), EnvId(2)]))
        .unwrap();
    let kp = array![[100.0, 100.0], [100.0, 50.0], [100.0, 300.0]];
    let kd = array![[10.0, 10.0], [20.0, 7.0], [20.0, 7.0]];
    assert_eq!((world.view().get_stiffness(), world.view().get_damping()), (kp.clone(), kd.clone()));
    world.step(1);
    let v = world.view().get_qvel();
    for ((env, joint), &v) in v.indexed_iter() {
        let expected = first_speed(M[joint], kp[(env, joint)], kd[(env, joint)]);
        assert_close(v, expected, EXACT, &format!("environment {env}, joint {joint}"));
    }
    // What was not named is as in a world that nobody told anything.
    let mut other = wheels(gains(100.0, 10.0));
    other.step(1);
    assert_eq!(v.row(0), other.view().get_qvel().row(0));
    assert!((v[(1, 1)] - other.view().get_qvel()[(1, 1)]).abs() > 0.1, "the control: gains matter");
}

/// Stiffness and damping of 0 leave the feed-forward effort alone: M a = tau.
#[test]
fn a_drive_without_gains_gives_its_effort() {
    let mut world = wheels(gains(100.0, 10.0));
    let mut robot = world.sim.robot_mut(world.robot);
    robot.set_stiffness(&array![[0.0, 0.0]], None, None).unwrap();
    robot.set_damping(&array![[0.0, 0.0]], None, None).unwrap();
    robot.set_qf(&array![[0.3, -0.5]], None, None).unwrap();
    world.step(10);
    for env in 0..ENVS {
        assert_close(world.view().get_qvel()[(env, 0)], 10.0 * H * 0.3 / M[0], EXACT, "a");
        assert_close(world.view().get_qvel()[(env, 1)], -10.0 * H * 0.5 / M[1], EXACT, "b");
    }
}

#[test]
fn drive_types_change_what_gains_mean_and_nothing_else() {
    let (k, d) = (90.0, 15.0);
    let mut world = wheels(gains(k, d));
    let set = |world: &mut World, drive_type, env| {
        world.sim.robot_mut(world.robot).set_drive_type(drive_type, None, Some(&[EnvId(env)])).unwrap();
    };
    set(&mut world, DriveType::Acceleration, 1);
    set(&mut world, DriveType::None, 2);
    let types = world.view().get_drive_types();
    assert_eq!(types.column(0).to_vec(), [DriveType::Force, DriveType::Acceleration, DriveType::None]);
    assert!(world.view().get_stiffness().iter().all(|&x| x == k), "numbers stay");
    world.step(1);
    let v = world.view().get_qvel();
    for joint in 0..2 {
        assert_close(v[(0, joint)], first_speed(M[joint], k, d), EXACT, "force");
        assert_close(v[(1, joint)], first_speed(1.0, k, d), EXACT, "acceleration");
        assert_eq!(v[(2, joint)], 0.0, "none");
    }
    assert_eq!(world.view().get_qf().row(2).to_vec(), [0.0; 2]);
    // And back: stiffness and damping are in the unit of the type, so they mean torques again.
    world.sim.reset(None).unwrap();
    for env in [1, 2] {
        set(&mut world, DriveType::Force, env);
    }
    world.aim(&[AIM; 2]);
    world.step(1);
    for env in 0..ENVS {
        assert_eq!(world.view().get_qvel().row(env), v.row(0), "environment {env}");
    }
    // Stiffness that is set later is in the unit of the type, too.
    set(&mut world, DriveType::Acceleration, 1);
    world.sim.robot_mut(world.robot).set_stiffness(&array![[30.0, 30.0]], None, Some(&[EnvId(1)])).unwrap();
    let env = world.sim.batch().read(1, |env| env.drives.gains[1]);
    assert_close(env.kp, 30.0 * M[1], EXACT, "gain in torque units");
}

/// Saturated, M v' = h limit, to the limit's last bit.
#[test]
fn effort_limits_are_held_in_each_environment() {
    let mut world = wheels(gains(1e3, 10.0));
    let limits = array![[1.5, f64::INFINITY], [0.25, 3.0], [0.0, 7.0]];
    world.sim.robot_mut(world.robot).set_qf_limits(&limits, None, None).unwrap();
    assert_eq!(world.view().qf_limits(), limits);
    world.step(1);
    let (v, effort) = (world.view().get_qvel(), world.view().get_qf());
    for ((env, joint), &limit) in limits.indexed_iter() {
        if limit.is_finite() {
            assert_eq!(effort[(env, joint)], limit);
            assert_close(v[(env, joint)], H * limit / M[joint], EXACT, "M v' = h limit");
        } else {
            assert_close(v[(env, joint)], first_speed(M[joint], 1e3, 10.0), EXACT, "no limit");
        }
    }
}

#[test]
fn position_limits_bound_targets_in_each_environment() {
    let joints = [Joint::wheel("a", M[0]).range(-1.0, 2.0), Joint::wheel("b", M[1])];
    let mut world = world(&joints, gains(100.0, 10.0), SimulationManagerCfg { num_envs: ENVS, ..weightless() });
    world.aim(&[1.5, 1.5]);
    let tight = array![[[-0.5, 0.5], [-f64::INFINITY, 0.25]]];
    world.sim.robot_mut(world.robot).set_qpos_limits(&tight, None, Some(&[EnvId(1)])).unwrap();
    let own = array![[-1.0, 2.0], [f64::NEG_INFINITY, f64::INFINITY]];
    let limits = world.view().qpos_limits();
    for env in 0..ENVS {
        let expected = if env == 1 { tight.index_axis(kinetoscope::ndarray::Axis(0), 0) } else { own.view() };
        assert_eq!(limits.index_axis(kinetoscope::ndarray::Axis(0), env), expected, "environment {env}");
    }
    // Present targets are clamped at once, later ones when they are set.
    assert_eq!(world.view().get_target_qpos(), array![[1.5, 1.5], [0.5, 0.25], [1.5, 1.5]]);
    world.aim(&[-9.0, -9.0]);
    assert_eq!(world.view().get_target_qpos(), array![[-1.0, -9.0], [-0.5, -9.0], [-1.0, -9.0]]);
    // Wider again, up to the robot's own.
    let (first, one) = ([JointIndex(0)], [EnvId(1)]);
    world.sim.robot_mut(world.robot).set_qpos_limits(&array![[[-1.0, 2.0]]], Some(&first), Some(&one)).unwrap();
    world.aim(&[-9.0, -9.0]);
    assert_eq!(world.view().get_target_qpos().column(0).to_vec(), [-1.0; 3]);
    // A stop is where it was: a load pushes beyond a tighter limit, not beyond the stop (which yields by the depth that
    // MuJoCo's constraint needs to hold 40 N m).
    let narrow = array![[[-0.1, 0.1]]];
    world.sim.robot_mut(world.robot).set_qpos_limits(&narrow, Some(&first), None).unwrap();
    world.sim.robot_mut(world.robot).set_qf(&array![[240.0, 0.0]], None, None).unwrap();
    world.step(500);
    let q = world.q()[0];
    assert!(q > 1.99 && q < 2.1, "{q}");
}

/// middle ± half of the range times the factor.
#[test]
fn soft_limits_are_a_share_of_the_range() {
    let files = tempfile::tempdir().unwrap();
    let path = files.path().join("robot.urdf");
    std::fs::write(&path, urdf(&[Joint::wheel("a", 0.1).range(-1.0, 2.0), Joint::wheel("b", 0.1)])).unwrap();
    let cfg = |factor| RobotCfg { urdf: UrdfCfg::single(&path), soft_limit_factor: factor, ..Default::default() };
    let mut world = load(cfg(0.9), weightless());
    let soft = world.view().soft_qpos_limits();
    assert_close(soft[(0, 0, 0)], 0.5 - 1.35, 1e-15, "lower");
    assert_close(soft[(0, 0, 1)], 0.5 + 1.35, 1e-15, "upper");
    assert_eq!((soft[(0, 1, 0)], soft[(0, 1, 1)]), (f64::NEG_INFINITY, f64::INFINITY));
    world.sim.robot_mut(world.robot).set_qpos_limits(&array![[[0.0, 1.0]]], Some(&[JointIndex(0)]), None).unwrap();
    let soft = world.view().soft_qpos_limits();
    assert_close(soft[(0, 0, 0)], 0.05, 1e-15, "of the limits that are set");
    assert_eq!(
        load(cfg(1.0), weightless()).view().soft_qpos_limits(),
        load(cfg(1.0), weightless()).view().qpos_limits()
    );
    for bad in [-0.1, 1.1, f64::NAN] {
        let mut sim = SimulationManager::new(weightless()).unwrap();
        let error = sim.add_robot(cfg(bad)).unwrap_err();
        assert!(matches!(error, Error::Config { field: "soft_limit_factor", .. }), "{error}");
    }
}

/// Speed limits come from the file or the configuration, are told back, and bound nothing.
#[test]
fn speed_limits_are_reported() {
    let drive = DriveCfg { max_velocity: Some([("b", 3.0)].into()), ..gains(100.0, 1.0) };
    let mut world = world(&[Joint::wheel("a", 0.1).effort(50.0), Joint::wheel("b", 0.1)], drive, weightless());
    assert_eq!(world.view().qvel_limits(), array![[100.0, 3.0]]);
    world.sim.robot_mut(world.robot).set_qvel_limits(&array![[0.5]], Some(&[JointIndex(1)]), None).unwrap();
    assert_eq!(world.view().qvel_limits(), array![[100.0, 0.5]]);
    world.aim(&[1.0, 1.0]);
    world.step(10);
    assert!(world.v()[1] > 0.5, "{:?}", world.v());
}

/// Gains and limits stay through a reset, and through the recompilation that another object asks for.
#[test]
fn gains_stay_when_the_world_changes() {
    let mut world = wheels(gains(100.0, 10.0));
    let mut robot = world.sim.robot_mut(world.robot);
    robot.set_stiffness(&array![[300.0]], Some(&[JointIndex(1)]), Some(&[EnvId(2)])).unwrap();
    robot.set_drive_type(DriveType::Acceleration, Some(&[JointIndex(0)]), Some(&[EnvId(0)])).unwrap();
    robot.set_qf_limits(&array![[4.0, 5.0]], None, Some(&[EnvId(1)])).unwrap();
    robot.set_qpos_limits(&array![[[-0.5, 0.1]]], Some(&[JointIndex(0)]), Some(&[EnvId(1)])).unwrap();
    let before = told(&world);
    let ball = RigidObjectCfg { uid: "ball".into(), shape: ObjectShape::Sphere { radius: 0.1 }, ..Default::default() };
    world.sim.add_rigid_object(ball).unwrap();
    assert_eq!(told(&world), before);
    world.sim.reset(None).unwrap();
    world.aim(&[AIM; 2]);
    assert_eq!(told(&world), before);
    world.step(1);
    assert_close(world.view().get_qvel()[(2, 1)], first_speed(M[1], 300.0, 10.0), EXACT, "the law of the new gains");
}

/// A call of one of the setters.
type Call = fn(&mut kinetoscope::sim::RobotMut<'_>) -> Result<()>;

/// One mistake in a call, and what its message says.
type Mistake = (Call, &'static [&'static str]);

const MISTAKES: &[Mistake] = &[
    (|r| r.set_stiffness(&array![[1.0]], None, None), &["set_stiffness has shape [1, 1]", "[3, 2]", "one row for all"]),
    (|r| r.set_stiffness(&array![[-1.0, 1.0]], None, None), &["set_stiffness[0, 0]", "joint \"a\"", "-1", ">= 0"]),
    (|r| r.set_stiffness(&array![[1.0, f64::INFINITY]], None, None), &["[0, 1]", "joint \"b\"", "finite"]),
    (|r| r.set_damping(&array![[f64::NAN, 1.0]], None, None), &["set_damping[0, 0]", "NaN"]),
    (|r| r.set_damping(&array![[1.0]], Some(&[JointIndex(2)]), None), &["joint 2 does not exist", "there are 2"]),
    (|r| r.set_damping(&array![[1.0, 1.0]], None, Some(&[EnvId(3)])), &["environment 3 does not exist"]),
    (|r| r.set_drive_type(DriveType::None, Some(&[JointIndex(9)]), None), &["joint 9 does not exist"]),
    (|r| r.set_drive_type(DriveType::None, None, Some(&[EnvId(usize::MAX)])), &["environment 18446744073709551615"]),
    (|r| r.set_qf_limits(&array![[-0.5, 1.0]], None, None), &["set_qf_limits[0, 0]", "or infinite for no limit"]),
    (|r| r.set_qvel_limits(&array![[1.0, f64::NAN]], None, None), &["set_qvel_limits[0, 1]", "joint \"b\"", "NaN"]),
    (|r| r.set_qvel_limits(&Array2::zeros((2, 2)), None, None), &["[2, 2]", "[3, 2]"]),
    (|r| r.set_qpos_limits(&Array3::zeros((3, 1, 2)), None, None), &["[3, 1, 2]", "[3, 2, 2]", "lower and upper end"]),
    (|r| r.set_qpos_limits(&Array3::zeros((3, 2, 3)), None, None), &["[3, 2, 3]", "[3, 2, 2]"]),
    (|r| r.set_qpos_limits(&Array3::zeros((2, 2, 2)), None, None), &["[2, 2, 2]", "[3, 2, 2]"]),
    (
        |r| r.set_qpos_limits(&array![[[0.5, 0.2]]], Some(&[JointIndex(0)]), None),
        &["set_qpos_limits[0, 0]", "lower end of joint \"a\"", "at most the upper end, 0.2"],
    ),
    (
        |r| r.set_qpos_limits(&array![[[0.0, 2.5]]], Some(&[JointIndex(0)]), None),
        &["upper end of joint \"a\"", "is 2.5", "-1 to 2", "added with"],
    ),
    (|r| r.set_qpos_limits(&array![[[0.0, f64::NAN]]], Some(&[JointIndex(1)]), None), &["upper end", "NaN"]),
    (
        |r| r.set_qpos_limits(&array![[[f64::INFINITY, f64::INFINITY]]], Some(&[JointIndex(1)]), None),
        &["lower end of joint \"b\"", "inf"],
    ),
    (|r| r.set_qpos_limits(&Array3::zeros((1, 1, 2)), Some(&[JointIndex(5)]), None), &["joint 5 does not exist"]),
];

#[test]
fn mistakes_are_errors_and_nothing_is_set() {
    let joints = [Joint::wheel("a", M[0]).range(-1.0, 2.0), Joint::wheel("b", M[1])];
    let mut world = world(&joints, gains(100.0, 10.0), SimulationManagerCfg { num_envs: ENVS, ..weightless() });
    let before = told(&world);
    for (i, (call, expected)) in MISTAKES.iter().enumerate() {
        let message = call(&mut world.sim.robot_mut(world.robot)).unwrap_err().to_string();
        for part in *expected {
            assert!(message.contains(part), "mistake {i}: {part:?} is not in {message:?}");
        }
        assert_eq!(told(&world), before, "mistake {i}: {message}");
    }
}

/// Twice the same joint or environment: which value should hold?
#[test]
fn what_is_named_twice_is_an_error_and_nothing_is_set() {
    const JOINTS: Option<&[JointIndex]> = Some(&[JointIndex(1), JointIndex(0), JointIndex(1)]);
    const ENV_IDS: Option<&[EnvId]> = Some(&[EnvId(2), EnvId(2)]);
    let calls: [(&str, Call, Call); 6] = [
        (
            "set_stiffness",
            |r| r.set_stiffness(&array![[1.0, 2.0, 3.0]], JOINTS, None),
            |r| r.set_stiffness(&array![[1.0, 2.0]], None, ENV_IDS),
        ),
        (
            "set_damping",
            |r| r.set_damping(&array![[1.0, 2.0, 3.0]], JOINTS, None),
            |r| r.set_damping(&array![[1.0, 2.0], [3.0, 4.0]], None, ENV_IDS),
        ),
        (
            "set_drive_type",
            |r| r.set_drive_type(DriveType::None, JOINTS, None),
            |r| r.set_drive_type(DriveType::None, None, ENV_IDS),
        ),
        (
            "set_qf_limits",
            |r| r.set_qf_limits(&array![[1.0, 2.0, 3.0]], JOINTS, None),
            |r| r.set_qf_limits(&array![[1.0, 2.0]], None, ENV_IDS),
        ),
        (
            "set_qvel_limits",
            |r| r.set_qvel_limits(&array![[1.0, 2.0, 3.0]], JOINTS, None),
            |r| r.set_qvel_limits(&array![[1.0, 2.0]], None, ENV_IDS),
        ),
        (
            "set_qpos_limits",
            |r| r.set_qpos_limits(&Array3::zeros((1, 3, 2)), JOINTS, None),
            |r| r.set_qpos_limits(&Array3::zeros((1, 2, 2)), None, ENV_IDS),
        ),
    ];
    let mut world = wheels(gains(100.0, 10.0));
    let before = told(&world);
    for (name, joints, envs) in calls {
        let error = joints(&mut world.sim.robot_mut(world.robot)).unwrap_err();
        assert!(matches!(error, Error::Repeated { first: 0, second: 2, .. }), "{error}");
        assert!(error.to_string().contains(&format!("{name} names joint \"b\" twice")), "{error}");
        let error = envs(&mut world.sim.robot_mut(world.robot)).unwrap_err();
        assert!(matches!(error, Error::Repeated { first: 0, second: 1, .. }), "{error}");
        assert!(error.to_string().contains(&format!("{name} names environment 2 twice")), "{error}");
        assert_eq!(told(&world), before, "{error}");
    }
    // Each once is right, in any order.
    let (joints, envs) = ([JointIndex(1), JointIndex(0)], [EnvId(2), EnvId(0)]);
    world.sim.robot_mut(world.robot).set_stiffness(&array![[1.0, 2.0]], Some(&joints), Some(&envs)).unwrap();
    assert_eq!(world.view().get_stiffness(), array![[2.0, 1.0], [100.0, 100.0], [2.0, 1.0]]);
}

/// Joints without a drive cannot be given one, and MuJoCo's own actuators keep their gains: both say what to do.
#[test]
fn drives_that_cannot_change_say_why() {
    let calls: [(&str, Call); 5] = [
        ("set_stiffness", |r| r.set_stiffness(&array![[1.0]], None, None)),
        ("set_damping", |r| r.set_damping(&array![[1.0]], None, None)),
        ("set_drive_type", |r| r.set_drive_type(DriveType::Force, None, None)),
        ("set_qf_limits", |r| r.set_qf_limits(&array![[1.0]], None, None)),
        ("set_qpos_limits", |r| r.set_qpos_limits(&array![[[0.0, 1.0]]], None, None)),
    ];
    let passive = DriveCfg { drive_type: DriveType::None, ..Default::default() };
    let native = DriveCfg { model: DriveModel::Actuator, ..gains(10.0, 1.0) };
    for (name, call) in calls {
        let mut free = world(&[Joint::wheel("j", 0.1)], passive.clone(), weightless());
        let error = call(&mut free.sim.robot_mut(free.robot)).unwrap_err();
        assert!(
            matches!(&error, Error::NotDriven { argument, joint, .. } if *argument == name && joint == "j"),
            "{error}"
        );
        assert!(error.to_string().contains("drive type none"), "{error}");
        let mut own = world(&[Joint::wheel("j", 0.1)], native.clone(), weightless());
        match call(&mut own.sim.robot_mut(own.robot)) {
            // Targets are ours to clamp, whoever drives.
            Ok(()) => assert_eq!(name, "set_qpos_limits"),
            Err(Error::GainsInModel { argument, joint, .. }) => assert_eq!((argument, &*joint), (name, "j")),
            Err(error) => panic!("{error}"),
        }
    }
    // A passive joint's limit is that of its file.
    let free = world(&[Joint::wheel("j", 0.1).effort(3.0)], passive, weightless());
    assert_eq!((free.limits(), free.view().get_stiffness()[(0, 0)]), (vec![3.0], 0.0));
    assert_eq!(free.view().get_drive_types()[(0, 0)], DriveType::None);
}

/// Columns of mimic joints are accepted, and change nothing.
#[test]
fn mimic_joints_have_no_gains_of_their_own() {
    let joints = [Joint::wheel("a", 0.1), Joint { mimic: Some(("a".into(), 2.0)), ..Joint::wheel("b", 0.1) }];
    let mut world = world(&joints, gains(100.0, 10.0), weightless());
    let mut robot = world.sim.robot_mut(world.robot);
    robot.set_stiffness(&array![[50.0, 999.0]], None, None).unwrap();
    robot.set_qpos_limits(&array![[[-1.0, 1.0], [5.0, -5.0]]], None, None).unwrap();
    assert_eq!(world.view().get_stiffness(), array![[50.0, 0.0]]);
    assert_eq!(world.view().qf_limits(), array![[f64::INFINITY, f64::INFINITY]]);
    world.aim(&[3.0, 0.0]);
    assert_eq!(world.target(), [1.0, 2.0]);
}

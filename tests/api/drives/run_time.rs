//! Changes of drives at run time: gains, types and limits, per joint and per environment.
//!
//! The laws are those of `law.rs`, with their tolerance of 1e-9: a joint of constant inertia M without other loads has
//! v' = (M v + h kp (q* - q)) / (M + h kd + h² kp). Control: the motion of an environment that is not named stays
//! bit-identical.

use crate::drives::law::EXACT;
use crate::drives::worlds::*;
use kinetoscope::ndarray::{Array2, Array3, Axis, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::{DriveType, Error, Result, RobotMut};
use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::worlds::{add_ball, text_robot};

const M: [f64; 2] = [0.2, 0.5];
const AIM: f64 = 0.4;
const ENVS: usize = 3;
const FIRST: Option<&[JointIndex]> = Some(&[JointIndex(0)]);
const SECOND: Option<&[JointIndex]> = Some(&[JointIndex(1)]);
const ENV1: Option<&[EnvId]> = Some(&[EnvId(1)]);

/// Two independent wheels in three environments, with targets set.
fn wheels(drive: DriveCfg) -> World {
    let mut world = world(&[Joint::wheel("a", M[0]), Joint::wheel("b", M[1])], drive, weightless_envs(ENVS));
    world.set_position_targets(&[AIM; 2]);
    world
}

/// Two wheels, the first with position limits.
fn ranged() -> World {
    let joints = [Joint::wheel("a", M[0]).range(-1.0, 2.0), Joint::wheel("b", M[1])];
    world(&joints, gains(100.0, 10.0), weightless_envs(ENVS))
}

/// Velocity after one step from rest at 0.
fn first_speed(m: f64, kp: f64, kd: f64) -> f64 {
    H * kp * AIM / (m + H * kd + H * H * kp)
}

/// Results of all drive getters, as text.
fn settings(world: &World) -> String {
    let view = world.view();
    let tables = [view.stiffness(), view.damping(), view.qf_limits(), view.qvel_limits()];
    let ends = [view.qpos_limits(), view.soft_qpos_limits()];
    format!("{tables:?} {ends:?} {:?} {:?}", view.drive_types(), view.qpos_target())
}

#[test]
fn gains_per_joint_and_environment() {
    let mut world = wheels(gains(100.0, 10.0));
    let mut robot = world.robot();
    robot.set_stiffness(&array![[300.0], [50.0]], SECOND, Some(&[EnvId(2), EnvId(1)])).unwrap();
    // A single row applies to all environments; columns are in the given order.
    let swapped = [JointIndex(1), JointIndex(0)];
    robot.set_damping(&array![[7.0, 20.0]], Some(&swapped), Some(&[EnvId(1), EnvId(2)])).unwrap();
    let kp = array![[100.0, 100.0], [100.0, 50.0], [100.0, 300.0]];
    let kd = array![[10.0, 10.0], [20.0, 7.0], [20.0, 7.0]];
    assert_eq!((world.view().stiffness(), world.view().damping()), (kp.clone(), kd.clone()));
    world.step(1);
    let v = world.view().qvel();
    for ((env, joint), &v) in v.indexed_iter() {
        let expected = first_speed(M[joint], kp[(env, joint)], kd[(env, joint)]);
        assert_number(&format!("environment {env}, joint {joint}"), v, expected, EXACT);
    }
    let mut other = wheels(gains(100.0, 10.0));
    other.step(1);
    assert_eq!(v.row(0), other.view().qvel().row(0), "not named");
    assert!((v[(1, 1)] - other.view().qvel()[(1, 1)]).abs() > 0.1, "the control: gains matter");
    // With zero stiffness and damping only the feedforward effort acts: M a = tau.
    world.sim.reset(None).unwrap();
    let mut robot = world.robot();
    robot.set_stiffness(&array![[0.0, 0.0]], None, None).unwrap();
    robot.set_damping(&array![[0.0, 0.0]], None, None).unwrap();
    robot.set_qf_target(&array![[0.3, -0.5]], None, None).unwrap();
    world.step(10);
    for ((env, joint), &v) in world.view().qvel().indexed_iter() {
        let expected = 10.0 * H * [0.3, -0.5][joint] / M[joint];
        assert_number(&format!("an effort alone, environment {env}, joint {joint}"), v, expected, EXACT);
    }
}

#[test]
fn drive_types() {
    let (k, d) = (90.0, 15.0);
    let mut world = wheels(gains(k, d));
    let set = |world: &mut World, drive_type, env| {
        world.robot().set_drive_type(drive_type, None, Some(&[EnvId(env)])).unwrap();
    };
    set(&mut world, DriveType::Acceleration, 1);
    set(&mut world, DriveType::None, 2);
    let types = world.view().drive_types();
    assert_eq!(types.column(0).to_vec(), [DriveType::Force, DriveType::Acceleration, DriveType::None]);
    assert!(world.view().stiffness().iter().all(|&x| x == k), "numbers stay");
    world.step(1);
    let v = world.view().qvel();
    for joint in 0..2 {
        assert_number("force", v[(0, joint)], first_speed(M[joint], k, d), EXACT);
        assert_number("acceleration", v[(1, joint)], first_speed(1.0, k, d), EXACT);
        assert_eq!(v[(2, joint)], 0.0, "none");
    }
    assert_eq!(world.view().qf().row(2).to_vec(), [0.0; 2]);
    // And back: stiffness and damping are in the unit of the type, so they are torques again.
    world.sim.reset(None).unwrap();
    set(&mut world, DriveType::Force, 1);
    set(&mut world, DriveType::Force, 2);
    world.set_position_targets(&[AIM; 2]);
    world.step(1);
    for env in 0..ENVS {
        assert_eq!(world.view().qvel().row(env), v.row(0), "environment {env}");
    }
    // Stiffness that is set later is in the unit of the type, too.
    set(&mut world, DriveType::Acceleration, 1);
    world.robot().set_stiffness(&array![[30.0, 30.0]], None, ENV1).unwrap();
    let gains = world.sim.batch().read(1, |env| env.drives.gains[1]);
    assert_number("gain in torque units", gains.kp, 30.0 * M[1], EXACT);
}

/// Saturated, M v' = h limit, to the limit's last bit.
#[test]
fn effort_limits() {
    let mut world = wheels(gains(1e3, 10.0));
    let limits = array![[1.5, f64::INFINITY], [0.25, 3.0], [0.0, 7.0]];
    world.robot().set_qf_limits(&limits, None, None).unwrap();
    assert_eq!(world.view().qf_limits(), limits);
    world.step(1);
    let (v, effort) = (world.view().qvel(), world.view().qf());
    for ((env, joint), &limit) in limits.indexed_iter() {
        if limit.is_finite() {
            assert_eq!(effort[(env, joint)], limit);
            assert_number("M v' = h limit", v[(env, joint)], H * limit / M[joint], EXACT);
        } else {
            assert_number("no limit", v[(env, joint)], first_speed(M[joint], 1e3, 10.0), EXACT);
        }
    }
}

#[test]
fn position_limits() {
    let mut world = ranged();
    world.set_position_targets(&[1.5, 1.5]);
    let tight = array![[[-0.5, 0.5], [-f64::INFINITY, 0.25]]];
    world.robot().set_qpos_limits(&tight, None, ENV1).unwrap();
    let own = array![[-1.0, 2.0], [f64::NEG_INFINITY, f64::INFINITY]];
    for env in 0..ENVS {
        let expected = if env == 1 { tight.index_axis(Axis(0), 0) } else { own.view() };
        assert_eq!(world.view().qpos_limits().index_axis(Axis(0), env), expected, "environment {env}");
    }
    // Current targets are clamped at once, later ones when they are set.
    assert_eq!(world.view().qpos_target(), array![[1.5, 1.5], [0.5, 0.25], [1.5, 1.5]]);
    world.set_position_targets(&[-9.0, -9.0]);
    assert_eq!(world.view().qpos_target(), array![[-1.0, -9.0], [-0.5, -9.0], [-1.0, -9.0]]);
    // Wider again, up to the robot's own limits.
    world.robot().set_qpos_limits(&array![[[-1.0, 2.0]]], FIRST, ENV1).unwrap();
    world.set_position_targets(&[-9.0, -9.0]);
    assert_eq!(world.view().qpos_target().column(0).to_vec(), [-1.0; 3]);
    // Joint stops do not move: a load pushes beyond a tighter limit, but not beyond the stop (which yields by the depth
    // that MuJoCo's constraint needs to hold 40 N m).
    world.robot().set_qpos_limits(&array![[[-0.1, 0.1]]], FIRST, None).unwrap();
    world.robot().set_qf_target(&array![[240.0, 0.0]], None, None).unwrap();
    world.step(500);
    let q = world.q()[0];
    assert!(q > 1.99 && q < 2.1, "{q}");
}

/// Center ± half of the range times the factor.
#[test]
fn soft_limits() {
    let files = TempFiles::default();
    let robot = text_robot(&files, "robot", &urdf(&[Joint::wheel("a", 0.1).range(-1.0, 2.0), Joint::wheel("b", 0.1)]));
    let cfg = |soft_limit_factor| RobotCfg { soft_limit_factor, ..robot.clone() };
    let mut world = load(cfg(0.9), weightless());
    let soft = world.view().soft_qpos_limits();
    assert_number("lower", soft[(0, 0, 0)], 0.5 - 1.35, Tolerance::mixed(1e-15, "two roundings"));
    assert_number("upper", soft[(0, 0, 1)], 0.5 + 1.35, Tolerance::mixed(1e-15, "two roundings"));
    assert_eq!((soft[(0, 1, 0)], soft[(0, 1, 1)]), (f64::NEG_INFINITY, f64::INFINITY));
    world.robot().set_qpos_limits(&array![[[0.0, 1.0]]], FIRST, None).unwrap();
    let limit = Tolerance::mixed(1e-15, "two roundings");
    assert_number("of the limits that are set", world.view().soft_qpos_limits()[(0, 0, 0)], 0.05, limit);
    let whole = load(cfg(1.0), weightless());
    assert_eq!(whole.view().soft_qpos_limits(), whole.view().qpos_limits());
    for bad in [-0.1, 1.1, f64::NAN] {
        let error = kinetoscope_testkit::worlds::sim(weightless()).add_robot(cfg(bad)).unwrap_err();
        assert!(matches!(error, Error::Config { field: "soft_limit_factor", .. }), "{error}");
    }
}

/// Velocity limits come from the file or the configuration and are read back, but do not limit the motion.
#[test]
fn speed_limits() {
    let drive = DriveCfg { max_velocity: Some([("b", 3.0)].into()), ..gains(100.0, 1.0) };
    let mut world = world(&[Joint::wheel("a", 0.1).effort(50.0), Joint::wheel("b", 0.1)], drive, weightless());
    assert_eq!(world.view().qvel_limits(), array![[100.0, 3.0]]);
    world.robot().set_qvel_limits(&array![[0.5]], SECOND, None).unwrap();
    assert_eq!(world.view().qvel_limits(), array![[100.0, 0.5]]);
    world.set_position_targets(&[1.0, 1.0]);
    world.step(10);
    assert!(world.v()[1] > 0.5, "{:?}", world.v());
}

/// Gains and limits persist through a reset, and through the recompilation for another object.
#[test]
fn changes_of_the_world() {
    let mut world = wheels(gains(100.0, 10.0));
    let mut robot = world.robot();
    robot.set_stiffness(&array![[300.0]], SECOND, Some(&[EnvId(2)])).unwrap();
    robot.set_drive_type(DriveType::Acceleration, FIRST, Some(&[EnvId(0)])).unwrap();
    robot.set_qf_limits(&array![[4.0, 5.0]], None, ENV1).unwrap();
    robot.set_qpos_limits(&array![[[-0.5, 0.1]]], FIRST, ENV1).unwrap();
    let before = settings(&world);
    add_ball(&mut world.sim, "ball", [0.0; 3]);
    assert_eq!(settings(&world), before);
    world.sim.reset(None).unwrap();
    world.set_position_targets(&[AIM; 2]);
    assert_eq!(settings(&world), before);
    world.step(1);
    assert_number("the law of the new gains", world.view().qvel()[(2, 1)], first_speed(M[1], 300.0, 10.0), EXACT);
}

/// A call of a setter, and parts of its error message.
type Mistake = (fn(&mut RobotMut<'_>) -> Result<()>, &'static [&'static str]);

/// Error messages of the setters; invalid numbers and indices of every writer are in `tests/input/every_writer.rs`.
const MISTAKES: &[Mistake] = &[
    (|r| r.set_stiffness(&array![[1.0]], None, None), &["set_stiffness has shape [1, 1]", "[3, 2]", "one row for all"]),
    (|r| r.set_stiffness(&array![[-1.0, 1.0]], None, None), &["set_stiffness[0, 0]", "joint \"a\"", "-1", ">= 0"]),
    (|r| r.set_stiffness(&array![[1.0, f64::INFINITY]], None, None), &["[0, 1]", "joint \"b\"", "finite"]),
    (|r| r.set_damping(&array![[f64::NAN, 1.0]], None, None), &["set_damping[0, 0]", "NaN"]),
    (|r| r.set_damping(&array![[1.0]], Some(&[JointIndex(2)]), None), &["joint 2 does not exist", "there are 2"]),
    (|r| r.set_damping(&array![[1.0, 1.0]], None, Some(&[EnvId(3)])), &["environment 3 does not exist"]),
    (|r| r.set_drive_type(DriveType::None, Some(&[JointIndex(9)]), None), &["joint 9 does not exist"]),
    (|r| r.set_drive_type(DriveType::None, None, Some(&[EnvId(usize::MAX)])), &["environment 18446744073709551615"]),
    (|r| r.set_qf_target(&array![[f64::NAN, 0.0]], None, None), &["set_qf_target[0, 0]", "finite"]),
    (|r| r.set_qf_limits(&array![[-0.5, 1.0]], None, None), &["set_qf_limits[0, 0]", "or infinite for no limit"]),
    (|r| r.set_qvel_limits(&array![[1.0, f64::NAN]], None, None), &["set_qvel_limits[0, 1]", "joint \"b\"", "NaN"]),
    (|r| r.set_qvel_limits(&Array2::zeros((2, 2)), None, None), &["[2, 2]", "[3, 2]"]),
    (|r| r.set_qpos_limits(&Array3::zeros((3, 1, 2)), None, None), &["[3, 1, 2]", "[3, 2, 2]", "lower and upper end"]),
    (|r| r.set_qpos_limits(&Array3::zeros((3, 2, 3)), None, None), &["[3, 2, 3]", "[3, 2, 2]"]),
    (|r| r.set_qpos_limits(&Array3::zeros((2, 2, 2)), None, None), &["[2, 2, 2]", "[3, 2, 2]"]),
    (
        |r| r.set_qpos_limits(&array![[[0.5, 0.2]]], FIRST, None),
        &["set_qpos_limits[0, 0]", "lower end of joint \"a\"", "at most the upper end, 0.2"],
    ),
    (
        |r| r.set_qpos_limits(&array![[[0.0, 2.5]]], FIRST, None),
        &["upper end of joint \"a\"", "is 2.5", "-1 to 2", "added with"],
    ),
    (|r| r.set_qpos_limits(&array![[[0.0, f64::NAN]]], SECOND, None), &["upper end", "NaN"]),
    (
        |r| r.set_qpos_limits(&array![[[f64::INFINITY, f64::INFINITY]]], SECOND, None),
        &["lower end of joint \"b\"", "inf"],
    ),
    (|r| r.set_qpos_limits(&Array3::zeros((1, 1, 2)), Some(&[JointIndex(5)]), None), &["joint 5 does not exist"]),
];

/// A setter that is called with a row of `n` columns.
type Setter = fn(&mut RobotMut<'_>, usize, Option<&[JointIndex]>, Option<&[EnvId]>) -> Result<()>;

const SETTERS: [(&str, Setter); 6] = [
    ("set_stiffness", |r, n, j, e| r.set_stiffness(&Array2::ones((1, n)), j, e)),
    ("set_damping", |r, n, j, e| r.set_damping(&Array2::ones((1, n)), j, e)),
    ("set_drive_type", |r, _, j, e| r.set_drive_type(DriveType::None, j, e)),
    ("set_qf_limits", |r, n, j, e| r.set_qf_limits(&Array2::ones((1, n)), j, e)),
    ("set_qvel_limits", |r, n, j, e| r.set_qvel_limits(&Array2::ones((1, n)), j, e)),
    ("set_qpos_limits", |r, n, j, e| r.set_qpos_limits(&Array3::zeros((1, n, 2)), j, e)),
];

#[test]
fn mistakes() {
    let mut world = ranged();
    let before = settings(&world);
    for (i, (call, parts)) in MISTAKES.iter().enumerate() {
        let message = call(&mut world.robot()).unwrap_err().to_string();
        assert!(
            parts.iter().all(|part| message.contains(part)),
            "mistake {i}: {message:?} must contain all of {parts:?}"
        );
        assert_eq!(settings(&world), before, "mistake {i}: {message}");
    }
    for (name, call) in SETTERS {
        for (columns, joints, envs, second, what) in [
            (3, Some(&[JointIndex(1), JointIndex(0), JointIndex(1)][..]), None, 2, "joint \"b\""),
            (2, None, Some(&[EnvId(2), EnvId(2)][..]), 1, "environment 2"),
        ] {
            let error = call(&mut world.robot(), columns, joints, envs).unwrap_err();
            assert!(matches!(error, Error::RepeatedItem { first: 0, second: found, .. } if found == second), "{error}");
            assert!(error.to_string().contains(&format!("{name} names {what} twice")), "{error}");
            assert_eq!(settings(&world), before, "{error}");
        }
    }
    // Unique indices are valid in any order.
    let (joints, envs) = ([JointIndex(1), JointIndex(0)], [EnvId(2), EnvId(0)]);
    world.robot().set_stiffness(&array![[1.0, 2.0]], Some(&joints), Some(&envs)).unwrap();
    assert_eq!(world.view().stiffness(), array![[2.0, 1.0], [100.0, 100.0], [2.0, 1.0]]);
}

/// Joints without a drive cannot get one at run time, and MuJoCo's own actuators keep their gains: both errors name a
/// fix.
#[test]
fn drives_that_cannot_change() {
    for (name, call) in SETTERS.into_iter().filter(|(name, _)| *name != "set_qvel_limits") {
        let mut free = world(&[Joint::wheel("j", 0.1)], no_drive(), weightless());
        let error = call(&mut free.robot(), 1, None, None).unwrap_err();
        let right = matches!(&error, Error::NotDriven { argument, joint, .. } if *argument == name && joint == "j");
        assert!(right && error.to_string().contains("drive type none"), "{error}");
        let mut own = world(&[Joint::wheel("j", 0.1)], native(10.0, 1.0), weightless());
        match call(&mut own.robot(), 1, None, None) {
            // Targets are clamped outside of MuJoCo, for any kind of drive.
            Ok(()) => assert_eq!(name, "set_qpos_limits"),
            Err(Error::GainsInModel { argument, joint, .. }) => assert_eq!((argument, &*joint), (name, "j")),
            Err(error) => panic!("{error}"),
        }
    }
    // A passive joint's limit is that of its file.
    let free = world(&[Joint::wheel("j", 0.1).effort(3.0)], no_drive(), weightless());
    assert_eq!((free.limits(), free.view().stiffness()[(0, 0)]), (vec![3.0], 0.0));
    assert_eq!(free.view().drive_types()[(0, 0)], DriveType::None);
}

/// Columns of mimic joints are accepted, and change nothing.
#[test]
fn mimic_joints() {
    let joints = [Joint::wheel("a", 0.1), Joint::wheel("b", 0.1).following("a", 2.0)];
    let mut world = world(&joints, gains(100.0, 10.0), weightless());
    let mut robot = world.robot();
    robot.set_stiffness(&array![[50.0, 999.0]], None, None).unwrap();
    robot.set_qpos_limits(&array![[[-1.0, 1.0], [5.0, -5.0]]], None, None).unwrap();
    assert_eq!(world.view().stiffness(), array![[50.0, 0.0]]);
    assert_eq!(world.view().qf_limits(), array![[f64::INFINITY, f64::INFINITY]]);
    world.set_position_targets(&[3.0, 0.0]);
    assert_eq!(world.target(), [1.0, 2.0]);
}

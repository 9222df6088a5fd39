//! Dry friction, damping and rotor inertia of joints that are changed while they run, per joint and per environment.
//!
//! A slide of mass m with damping b and rotor inertia a, without other loads, has after one step of MuJoCo's Euler, which
//! integrates damping implicitly, the speed v (m + a) / (m + a + h b); pushed by F from rest, h F / (m + a + h b). Both are a
//! handful of operations: 1e-12. Under dry friction f alone it comes to rest after m v² / 2 f; the constraint is soft, and
//! short steps are off by h v: 1 %. Controls: environments that were not named do what they did before, to the last bit.

use crate::drives::worlds::*;
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;

const EXACT: f64 = 1e-12;
const H: f64 = 0.01;
const M: [f64; 2] = [2.0, 0.5];
const ENVS: usize = 3;

/// Two slides that do not feel each other.
fn slides(damping: f64, friction: f64, drive: DriveCfg, dt: f64) -> World {
    let slide = |name: &str, m: f64| Joint { damping, friction, ..Joint::slide(name, m) };
    let cfg = SimulationManagerCfg { num_envs: ENVS, ..at_dt(dt, weightless()) };
    world(&[slide("a", M[0]), slide("b", M[1])], drive, cfg)
}

fn passive() -> DriveCfg {
    DriveCfg { drive_type: DriveType::None, ..Default::default() }
}

fn close(found: &Array2<f64>, expected: impl Fn(usize, usize) -> f64) {
    for ((env, joint), &found) in found.indexed_iter() {
        assert_close(found, expected(env, joint), EXACT, &format!("environment {env}, joint {joint}"));
    }
}

#[test]
fn rotor_inertia_makes_a_joint_slow() {
    let mut world = slides(0.0, 0.0, passive(), H);
    assert_eq!(world.view().get_armature(), Array2::<f64>::zeros((ENVS, 2)));
    let mut robot = world.sim.robot_mut(world.robot);
    robot.set_armature(&array![[3.0], [0.25]], Some(&[JointIndex(1)]), Some(&[EnvId(2), EnvId(0)])).unwrap();
    robot.set_qf(&array![[4.0, 4.0]], None, None).unwrap();
    let armature = array![[0.0, 0.25], [0.0, 0.0], [0.0, 3.0]];
    assert_eq!(world.view().get_armature(), armature);
    world.step(1);
    let v = world.view().get_qvel();
    close(&v, |env, joint| H * 4.0 / (M[joint] + armature[(env, joint)]));
    let mut other = slides(0.0, 0.0, passive(), H);
    other.sim.robot_mut(other.robot).set_qf(&array![[4.0, 4.0]], None, None).unwrap();
    other.step(1);
    assert_eq!(v.row(1), other.view().get_qvel().row(1), "bit for bit");
}

#[test]
fn damping_of_a_joint_is_not_that_of_its_drive() {
    // A drive without stiffness and damping: an implicit row that gives nothing.
    for drive in [passive(), gains(0.0, 0.0)] {
        let mut world = slides(1.5, 0.0, drive, H);
        assert_eq!(world.view().get_joint_damping(), Array2::<f64>::from_elem((ENVS, 2), 1.5));
        let before = world.view().get_damping();
        let mut robot = world.sim.robot_mut(world.robot);
        robot.set_joint_damping(&array![[40.0, 0.0]], None, Some(&[EnvId(1)])).unwrap();
        robot.write_qvel(&array![[1.0, 1.0]], None, None).unwrap();
        let damping = array![[1.5, 1.5], [40.0, 0.0], [1.5, 1.5]];
        assert_eq!((world.view().get_joint_damping(), world.view().get_damping()), (damping.clone(), before));
        world.step(1);
        close(&world.view().get_qvel(), |env, joint| M[joint] / (M[joint] + H * damping[(env, joint)]));
    }
}

/// Implicit damping has a half of its own in MuJoCo's armature, of which nothing shows.
#[test]
fn rotor_inertia_is_what_was_asked_for_to_the_last_bit() {
    let (rotor, damping) = (1e-3, 40.0);
    // The control: what is found where the half is taken off again.
    assert_ne!((rotor + H * damping) - H * damping, rotor);
    let mut world = slides(damping, 0.0, DriveCfg { armature: rotor.into(), ..gains(0.0, 0.0) }, H);
    assert_eq!(world.view().get_armature(), Array2::from_elem((ENVS, 2), rotor));
    let read = world.view().get_armature();
    world.sim.robot_mut(world.robot).set_armature(&read, None, None).unwrap();
    assert_eq!(world.sim.property_bytes(EnvId(0)).unwrap(), 0, "nothing is another");
}

#[test]
fn dry_friction_stops_a_joint_sooner() {
    // An explicit model beside a row, or beside an actuator.
    let beside = |model| DriveCfg { model, actuators: vec![("a".into(), IdealPd {}.into())], ..gains(0.0, 0.0) };
    let explicit = [beside(DriveModel::Implicit), beside(DriveModel::Actuator)];
    for drive in [passive(), gains(0.0, 0.0)].into_iter().chain(explicit) {
        let mut world = slides(0.0, 1.0, drive, 5e-4);
        let mut robot = world.sim.robot_mut(world.robot);
        robot.set_friction(&array![[4.0, 0.5]], None, Some(&[EnvId(1)])).unwrap();
        robot.write_qvel(&array![[1.0, 1.0]], None, None).unwrap();
        let friction = array![[1.0, 1.0], [4.0, 0.5], [1.0, 1.0]];
        assert_eq!(world.view().get_friction(), friction);
        world.step(6000);
        let (view, limits) = (world.view(), world.view().get_friction());
        for ((env, joint), &way) in view.get_qpos().indexed_iter() {
            let expected = M[joint] / (2.0 * limits[(env, joint)]);
            assert!((way / expected - 1.0).abs() < 0.01, "environment {env}, joint {joint}: {way}, not {expected}");
        }
        assert_eq!(view.get_qpos().row(0), view.get_qpos().row(2), "bit for bit");
    }
}

#[test]
fn they_stay_until_they_are_changed() {
    let mut world = slides(1.5, 1.0, gains(10.0, 1.0), H);
    let nominal = |world: &World| {
        let view = world.view();
        (view.get_friction(), view.get_joint_damping(), view.get_armature())
    };
    let at_first = nominal(&world);
    let mut robot = world.sim.robot_mut(world.robot);
    robot.set_friction(&array![[0.5, 2.5]], None, Some(&[EnvId(1)])).unwrap();
    robot.set_joint_damping(&array![[0.25, 8.0]], None, Some(&[EnvId(1)])).unwrap();
    robot.set_armature(&array![[0.125, 0.75]], None, Some(&[EnvId(1)])).unwrap();
    let set = nominal(&world);
    assert_eq!(set.0.row(1), array![0.5, 2.5]);
    assert_eq!(set.1.row(1), array![0.25, 8.0]);
    assert_eq!(set.2.row(1), array![0.125, 0.75]);
    world.sim.reset(None).unwrap();
    assert_eq!(nominal(&world), set, "through a reset");
    world.sim.add_rigid_object(RigidObjectCfg::default()).unwrap();
    assert_eq!(nominal(&world), set, "when more is added");
    // They are the environment's properties, by the same numbers.
    let properties = world.sim.properties(EnvId(1)).unwrap();
    let uid = world.view().uid().to_string();
    assert_eq!(properties.get(Property::DryFriction, &format!("{uid}/b")).unwrap(), [2.5]);
    assert_eq!(properties.get(Property::Armature, &format!("{uid}/a")).unwrap(), [0.125]);
    assert_eq!(world.sim.property_bytes(EnvId(0)).unwrap(), 0, "others share everything");
    world.sim.reset_properties(None).unwrap();
    assert_eq!(nominal(&world), at_first);
}

/// A snapshot holds the state, and what a drive was told; these belong to the environment.
#[test]
fn restoring_a_snapshot_leaves_them() {
    let mut world = slides(1.5, 1.0, gains(10.0, 1.0), H);
    let (snapshot, stiffness) = (world.sim.snapshot(None).unwrap(), world.view().get_stiffness());
    let mut robot = world.sim.robot_mut(world.robot);
    robot.set_stiffness(&array![[70.0, 80.0]], None, None).unwrap();
    let set = [array![[0.5, 2.5]], array![[0.25, 8.0]], array![[0.125, 0.75]]];
    robot.set_friction(&set[0], None, None).unwrap();
    robot.set_joint_damping(&set[1], None, None).unwrap();
    robot.set_armature(&set[2], None, None).unwrap();
    world.sim.restore(&snapshot, None).unwrap();
    let view = world.view();
    assert_eq!(view.get_stiffness(), stiffness, "control: what is restored");
    for (found, set) in [view.get_friction(), view.get_joint_damping(), view.get_armature()].iter().zip(&set) {
        assert_eq!(found, set.broadcast((ENVS, 2)).unwrap());
    }

    // Both halves of the damping that is integrated with the drives stay: the model's and the environment's.
    let mut world = slides(1.5, 0.0, gains(0.0, 0.0), H);
    let snapshot = world.sim.snapshot(None).unwrap();
    let damping = [40.0, 8.0];
    world.sim.robot_mut(world.robot).set_joint_damping(&array![damping], None, None).unwrap();
    world.sim.restore(&snapshot, None).unwrap();
    world.sim.robot_mut(world.robot).write_qvel(&array![[1.0, 1.0]], None, None).unwrap();
    world.step(1);
    close(&world.view().get_qvel(), |_, joint| M[joint] / (M[joint] + H * damping[joint]));
}

#[test]
fn what_is_read_can_be_set() {
    let joints = [Joint { damping: 1.5, friction: 1.0, ..Joint::slide("a", M[0]) }, Joint::slide("b", M[1])];
    for drive in [passive(), gains(10.0, 1.0)] {
        let mut world = world(&joints, drive, SimulationManagerCfg { num_envs: ENVS, ..weightless() });
        let (friction, damping, armature) =
            (world.view().get_friction(), world.view().get_joint_damping(), world.view().get_armature());
        assert_eq!((friction.row(0), damping.row(0)), (array![1.0, 0.0].view(), array![1.5, 0.0].view()));
        let mut robot = world.sim.robot_mut(world.robot);
        robot.set_friction(&friction, None, None).unwrap();
        robot.set_joint_damping(&damping, None, None).unwrap();
        robot.set_armature(&armature, None, None).unwrap();
        // Both at once: what joint b has none of stays 0.
        robot.set_friction(&array![[2.0, 0.0]], None, Some(&[EnvId(1)])).unwrap();
        robot.set_joint_damping(&array![[0.0, 0.0]], None, Some(&[EnvId(2)])).unwrap();
        let expected = (array![[1.0, 0.0], [2.0, 0.0], [1.0, 0.0]], array![[1.5, 0.0], [1.5, 0.0], [0.0, 0.0]]);
        assert_eq!((world.view().get_friction(), world.view().get_joint_damping()), expected);
        // The control: an implicit drive without a place beside it has no friction.
        let mut robot = world.sim.robot_mut(world.robot);
        let more = robot.set_friction(&array![[1.0, 0.1]], None, None);
        if world.view().get_stiffness()[(0, 1)] > 0.0 {
            let error = more.unwrap_err().to_string();
            assert!(error.contains("/b") && error.contains("drive.friction"), "{error}");
            assert_eq!((world.view().get_friction(), world.view().get_joint_damping()), expected);
        } else {
            more.unwrap();
            assert_eq!(world.view().get_friction(), Array2::from_shape_fn((ENVS, 2), |(_, joint)| [1.0, 0.1][joint]));
        }
    }
}

#[test]
fn mistakes_are_named_and_change_nothing() {
    let mut world = slides(1.5, 1.0, passive(), H);
    let before = world.view().get_friction();
    let mut robot = world.sim.robot_mut(world.robot);
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        let error = robot.set_friction(&array![[2.0, bad]], None, None).unwrap_err().to_string();
        assert!(error.contains("set_friction") && error.contains("\"b\""), "{bad}: {error}");
    }
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        let error = robot.set_joint_damping(&array![[bad, 2.0]], None, None).unwrap_err().to_string();
        assert!(error.contains("set_joint_damping") && error.contains("\"a\""), "{bad}: {error}");
        let error = robot.set_armature(&array![[bad, 2.0]], None, None).unwrap_err().to_string();
        assert!(error.contains("set_armature") && error.contains("\"a\""), "{bad}: {error}");
    }
    assert!(matches!(robot.set_friction(&array![[1.0]], None, None), Err(Error::Shape { .. })));
    let nowhere = Some(&[EnvId(ENVS)][..]);
    assert!(matches!(robot.set_armature(&array![[1.0, 1.0]], None, nowhere), Err(Error::UnknownIndex { .. })));
    let none = Some(&[JointIndex(2)][..]);
    assert!(matches!(robot.set_armature(&array![[1.0]], none, None), Err(Error::UnknownIndex { .. })));
    let twice = Some(&[JointIndex(0), JointIndex(0)][..]);
    assert!(matches!(robot.set_friction(&array![[1.0, 1.0]], twice, None), Err(Error::Repeated { .. })));
    assert_eq!(world.view().get_friction(), before);

    let mut bare = slides(0.0, 0.0, gains(10.0, 1.0), H);
    let mut robot = bare.sim.robot_mut(bare.robot);
    let error = robot.set_friction(&array![[1.0, 1.0]], None, None).unwrap_err().to_string();
    assert!(error.contains("dry friction") && error.contains("/a"), "{error}");
    assert_eq!(bare.view().get_friction(), Array2::<f64>::zeros((ENVS, 2)));
}

/// What joints have that were added without: damping and rotor inertia of every joint, dry friction of all but those whose
/// implicit drive has its place, unless the robot was given room for it.
#[test]
fn joints_that_had_nothing_get_it_while_they_run() {
    for drive in [passive(), gains(0.0, 0.0)] {
        let mut world = slides(0.0, 0.0, drive, H);
        assert_eq!(world.view().get_joint_damping(), Array2::<f64>::zeros((ENVS, 2)));
        let mut robot = world.sim.robot_mut(world.robot);
        robot.set_joint_damping(&array![[40.0, 3.0]], None, Some(&[EnvId(1)])).unwrap();
        robot.set_armature(&array![[0.5, 0.25]], None, Some(&[EnvId(1)])).unwrap();
        robot.write_qvel(&array![[1.0, 1.0]], None, None).unwrap();
        world.step(1);
        let own = |env: usize, values: [f64; 2], joint: usize| if env == 1 { values[joint] } else { 0.0 };
        let law = |env, joint| {
            let mass = M[joint] + own(env, [0.5, 0.25], joint);
            mass / (mass + H * own(env, [40.0, 3.0], joint))
        };
        close(&world.view().get_qvel(), law);
        assert_eq!(world.view().get_qvel().row(0), array![1.0, 1.0], "without any of it nothing slows down");
    }
    let beside = |model| DriveCfg { model, actuators: vec![("a".into(), IdealPd {}.into())], ..gains(0.0, 0.0) };
    let room = DriveCfg { friction: Some(0.0.into()), ..gains(0.0, 0.0) };
    for drive in [passive(), beside(DriveModel::Actuator), room] {
        let mut world = slides(0.0, 0.0, drive, 5e-4);
        let mut robot = world.sim.robot_mut(world.robot);
        robot.set_friction(&array![[4.0, 0.5]], None, Some(&[EnvId(1)])).unwrap();
        robot.write_qvel(&array![[1.0, 1.0]], None, None).unwrap();
        world.step(6000);
        let (view, friction) = (world.view(), [4.0, 0.5]);
        for joint in 0..2 {
            let (way, expected) = (view.get_qpos()[(1, joint)], M[joint] / (2.0 * friction[joint]));
            assert!((way / expected - 1.0).abs() < 0.01, "joint {joint}: {way}, not {expected}");
            assert!((view.get_qpos()[(0, joint)] - 3.0).abs() < 1e-9, "the others go on: {}", view.get_qpos());
        }
        // And is told none again: it slides on.
        let mut robot = world.sim.robot_mut(world.robot);
        robot.set_friction(&array![[0.0, 0.0]], None, None).unwrap();
        robot.write_qvel(&array![[1.0, 1.0]], None, None).unwrap();
        world.step(100);
        assert!(world.view().get_qvel().iter().all(|v| (v - 1.0).abs() < 1e-12), "{}", world.view().get_qvel());
    }
}

/// A joint in front of one with an implicit drive gets dry friction in one environment, which moves the rows that MuJoCo
/// makes for both. Each is the law still: the drive's effort is kp (q* - q') - kd v' at the end of the step.
#[test]
fn friction_in_front_of_a_drive_does_not_move_it() {
    let drive = DriveCfg {
        drive_type: DriveType::Force,
        model: DriveModel::Implicit,
        actuators: vec![("a".into(), IdealPd {}.into())],
        friction: None,
        ..gains(50.0, 4.0)
    };
    let mut world = slides(0.0, 0.0, drive, H);
    let mut robot = world.sim.robot_mut(world.robot);
    robot.set_friction(&array![[1.5]], Some(&[JointIndex(0)]), Some(&[EnvId(1)])).unwrap();
    robot.set_qpos(&array![[0.0, 0.2]], None, None).unwrap();
    robot.write_qvel(&array![[1.0, -0.5]], None, None).unwrap();
    for _ in 0..50 {
        world.step(1);
        let (q, v, effort) = (world.view().get_qpos(), world.view().get_qvel(), world.view().get_qf());
        for env in 0..ENVS {
            let law = 50.0 * (0.2 - q[(env, 1)]) - 4.0 * v[(env, 1)];
            assert!((effort[(env, 1)] - law).abs() < 1e-9, "environment {env}: {}, not {law}", effort[(env, 1)]);
        }
        // The solver takes other steps to the same minimum.
        for (a, b) in [(q[(0, 1)], q[(1, 1)]), (v[(0, 1)], v[(1, 1)])] {
            assert!((a - b).abs() < 1e-12, "the other joint's friction changes nothing here: {a} {b}");
        }
    }
    let q = world.view().get_qpos();
    assert!((q[(1, 0)] - q[(0, 0)]).abs() > 1e-3, "control: it slows its own joint: {q}");
}

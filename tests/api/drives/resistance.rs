//! Changes of dry friction, damping and rotor inertia at run time, per joint and per environment.
//!
//! A slide of mass m with damping b and rotor inertia a, without other loads, has the speed v (m + a) / (m + a + h b)
//! after one step of MuJoCo's Euler, which integrates damping implicitly. Pushed by F from rest, its speed is h F /
//! (m + a + h b). Both are a few operations: 1e-12. Under dry friction f alone it stops after m v² / 2 f; the
//! constraint is soft, and short steps are off by h v: 1 %. Controls: the motion of the other environments stays
//! bit-identical.

use crate::drives::worlds::*;
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::{DriveModel, IdealPd};
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::tolerance::assert_close;

const EXACT: Tolerance = Tolerance::mixed(1e-12, "a handful of operations");
const M: [f64; 2] = [2.0, 0.5];
const ENVS: usize = 3;
const ENV1: Option<&[EnvId]> = Some(&[EnvId(1)]);

/// Two independent slides.
fn slides(damping: f64, friction: f64, drive: DriveCfg, dt: f64) -> World {
    let slide = |name: &str, m: f64| Joint::slide(name, m).damped(damping).rough(friction);
    world(&[slide("a", M[0]), slide("b", M[1])], drive, at_dt(dt, weightless_envs(ENVS)))
}

/// An explicit model of joint a next to a row or an actuator.
fn beside(model: DriveModel) -> DriveCfg {
    DriveCfg { model, actuators: vec![("a".into(), IdealPd {}.into())], ..gains(0.0, 0.0) }
}

/// Dry friction, damping and rotor inertia.
fn resistance(world: &World) -> [Array2<f64>; 3] {
    let view = world.view();
    [view.friction(), view.joint_damping(), view.armature()]
}

fn set_all(world: &mut World, [friction, damping, armature]: &[Array2<f64>; 3], envs: Option<&[EnvId]>) {
    let mut robot = world.robot();
    robot.set_friction(friction, None, envs).unwrap();
    robot.set_joint_damping(damping, None, envs).unwrap();
    robot.set_armature(armature, None, envs).unwrap();
}

/// Asserts the speeds by environment and joint.
fn assert_speeds(world: &World, expected: impl Fn((usize, usize)) -> f64) {
    assert_close("speeds", world.view().qvel(), Array2::from_shape_fn((ENVS, 2), expected), EXACT);
}

fn zeros() -> Array2<f64> {
    Array2::zeros((ENVS, 2))
}

#[test]
fn rotor_inertia() {
    let [mut world, mut other] = [(); 2].map(|()| slides(0.0, 0.0, no_drive(), H));
    assert_eq!(world.view().armature(), zeros());
    let envs = [EnvId(2), EnvId(0)];
    world.robot().set_armature(&array![[3.0], [0.25]], Some(&[JointIndex(1)]), Some(&envs)).unwrap();
    let armature = array![[0.0, 0.25], [0.0, 0.0], [0.0, 3.0]];
    assert_eq!(world.view().armature(), armature);
    for world in [&mut world, &mut other] {
        world.robot().set_qf_target(&array![[4.0, 4.0]], None, None).unwrap();
        world.step(1);
    }
    let v = world.view().qvel();
    assert_speeds(&world, |at| H * 4.0 / (M[at.1] + armature[at]));
    assert_eq!(v.row(1), other.view().qvel().row(1), "bit for bit");
    // Implicit damping has its own share in MuJoCo's armature, which must not show in the results.
    let (rotor, damping) = (1e-3, 40.0);
    assert_ne!((rotor + H * damping) - H * damping, rotor, "the control: where the half is taken off again");
    let mut world = slides(damping, 0.0, DriveCfg { armature: rotor.into(), ..gains(0.0, 0.0) }, H);
    let read = world.view().armature();
    assert_eq!(read, Array2::from_elem((ENVS, 2), rotor));
    world.robot().set_armature(&read, None, None).unwrap();
    assert_eq!(world.sim.properties().bytes(EnvId(0)).unwrap(), 0, "no property was changed");
}

/// The damping of a joint is independent of its drive's; a drive without stiffness and damping is a row without effort.
#[test]
fn damping() {
    for drive in [no_drive(), gains(0.0, 0.0)] {
        let mut world = slides(1.5, 0.0, drive, H);
        assert_eq!(world.view().joint_damping(), Array2::<f64>::from_elem((ENVS, 2), 1.5));
        let before = world.view().damping();
        let mut robot = world.robot();
        robot.set_joint_damping(&array![[40.0, 0.0]], None, ENV1).unwrap();
        robot.write_qvel(&array![[1.0, 1.0]], None, None).unwrap();
        let damping = array![[1.5, 1.5], [40.0, 0.0], [1.5, 1.5]];
        assert_eq!((world.view().joint_damping(), world.view().damping()), (damping.clone(), before));
        world.step(1);
        assert_speeds(&world, |at| M[at.1] / (M[at.1] + H * damping[at]));
    }
}

/// Friction of the file, and friction of joints without any in the file. The latter can be set except for joints with
/// an implicit drive, which uses the friction row, unless the robot's configuration reserves another row.
#[test]
fn dry_friction() {
    let with_friction_row = DriveCfg { friction: Some(0.0.into()), ..gains(0.0, 0.0) };
    for (own, drive) in [
        (1.0, no_drive()),
        (1.0, gains(0.0, 0.0)),
        (1.0, beside(DriveModel::Implicit)),
        (1.0, beside(DriveModel::Actuator)),
        (0.0, no_drive()),
        (0.0, beside(DriveModel::Actuator)),
        (0.0, with_friction_row),
    ] {
        let mut world = slides(0.0, own, drive, 5e-4);
        let mut robot = world.robot();
        robot.set_friction(&array![[4.0, 0.5]], None, ENV1).unwrap();
        robot.write_qvel(&array![[1.0, 1.0]], None, None).unwrap();
        let friction = array![[own, own], [4.0, 0.5], [own, own]];
        assert_eq!(world.view().friction(), friction);
        world.step(6000);
        let ways = world.view().qpos();
        for (at, &way) in ways.indexed_iter() {
            let stops = M[at.1] / (2.0 * friction[at]);
            let right = if friction[at] > 0.0 { (way / stops - 1.0).abs() < 0.01 } else { (way - 3.0).abs() < 1e-9 };
            assert!(right, "{at:?}: {way}, not {stops}");
        }
        assert_eq!(ways.row(0), ways.row(2), "bit for bit");
        if own == 0.0 {
            // Without friction it slides on.
            let mut robot = world.robot();
            robot.set_friction(&array![[0.0, 0.0]], None, None).unwrap();
            robot.write_qvel(&array![[1.0, 1.0]], None, None).unwrap();
            world.step(100);
            assert!(world.view().qvel().iter().all(|v| (v - 1.0).abs() < 1e-12), "{}", world.view().qvel());
        }
    }
}

/// Damping and rotor inertia of joints that were added without either.
#[test]
fn joints_without_any() {
    for drive in [no_drive(), gains(0.0, 0.0)] {
        let mut world = slides(0.0, 0.0, drive, H);
        assert_eq!(world.view().joint_damping(), zeros());
        let mut robot = world.robot();
        robot.set_joint_damping(&array![[40.0, 3.0]], None, ENV1).unwrap();
        robot.set_armature(&array![[0.5, 0.25]], None, ENV1).unwrap();
        robot.write_qvel(&array![[1.0, 1.0]], None, None).unwrap();
        world.step(1);
        assert_speeds(&world, |(env, joint)| {
            let own = |values: [f64; 2]| if env == 1 { values[joint] } else { 0.0 };
            let mass = M[joint] + own([0.5, 0.25]);
            mass / (mass + H * own([40.0, 3.0]))
        });
        assert_eq!(world.view().qvel().row(0), array![1.0, 1.0], "without any of it nothing slows down");
    }
}

/// The values persist through a reset, a recompilation and a restored snapshot. A snapshot holds the state and the
/// settings of drives; resistance belongs to the environment.
#[test]
fn lasting() {
    let mut world = slides(1.5, 1.0, gains(10.0, 1.0), H);
    let at_first = resistance(&world);
    let own = [array![[0.5, 2.5]], array![[0.25, 8.0]], array![[0.125, 0.75]]];
    set_all(&mut world, &own, ENV1);
    let set = resistance(&world);
    for (found, own) in set.iter().zip(&own) {
        assert_eq!(found.row(1), own.row(0));
    }
    world.sim.reset(None).unwrap();
    assert_eq!(resistance(&world), set, "through a reset");
    world.sim.add_rigid_object(RigidObjectCfg::default()).unwrap();
    assert_eq!(resistance(&world), set, "when more is added");
    // The values are properties of the environment.
    let properties = world.sim.properties().of(EnvId(1)).unwrap();
    assert_eq!(properties.get(Property::DryFriction, "robot/b").unwrap(), [2.5]);
    assert_eq!(properties.get(Property::Armature, "robot/a").unwrap(), [0.125]);
    assert_eq!(world.sim.properties().bytes(EnvId(0)).unwrap(), 0, "others share everything");
    world.sim.properties_mut().reset(None).unwrap();
    assert_eq!(resistance(&world), at_first);

    let (snapshot, stiffness) = (world.sim.snapshot(None).unwrap(), world.view().stiffness());
    world.robot().set_stiffness(&array![[70.0, 80.0]], None, None).unwrap();
    set_all(&mut world, &own, None);
    world.sim.restore(&snapshot, None).unwrap();
    assert_eq!(world.view().stiffness(), stiffness, "control: what is restored");
    for (found, own) in resistance(&world).iter().zip(&own) {
        assert_eq!(found, own.broadcast((ENVS, 2)).unwrap());
    }
    // Both parts of the damping that is integrated with the drives persist: the model's and the environment's.
    let mut world = slides(1.5, 0.0, gains(0.0, 0.0), H);
    let (snapshot, damping) = (world.sim.snapshot(None).unwrap(), [40.0, 8.0]);
    world.robot().set_joint_damping(&array![damping], None, None).unwrap();
    world.sim.restore(&snapshot, None).unwrap();
    world.robot().write_qvel(&array![[1.0, 1.0]], None, None).unwrap();
    world.step(1);
    assert_speeds(&world, |(_, joint)| M[joint] / (M[joint] + H * damping[joint]));
}

#[test]
fn read_and_set_again() {
    let joints = [Joint::slide("a", M[0]).damped(1.5).rough(1.0), Joint::slide("b", M[1])];
    for (drive, has_friction_row) in [(no_drive(), true), (gains(10.0, 1.0), false)] {
        let mut world = world(&joints, drive, weightless_envs(ENVS));
        let read = resistance(&world);
        assert_eq!([read[0].row(0), read[1].row(0)], [array![1.0, 0.0].view(), array![1.5, 0.0].view()]);
        set_all(&mut world, &read, None);
        // Both at once: joint b stays without resistance.
        let mut robot = world.robot();
        robot.set_friction(&array![[2.0, 0.0]], None, ENV1).unwrap();
        robot.set_joint_damping(&array![[0.0, 0.0]], None, Some(&[EnvId(2)])).unwrap();
        let expected = [array![[1.0, 0.0], [2.0, 0.0], [1.0, 0.0]], array![[1.5, 0.0], [1.5, 0.0], [0.0, 0.0]]];
        assert_eq!(resistance(&world)[..2], expected);
        // Control: an implicit drive without a separate friction row cannot have friction.
        let more = world.robot().set_friction(&array![[1.0, 0.1]], None, None);
        if has_friction_row {
            more.unwrap();
            assert_eq!(world.view().friction(), Array2::from_shape_fn((ENVS, 2), |(_, joint)| [1.0, 0.1][joint]));
        } else {
            assert_error(more, "", &["/b", "drive.friction"]);
            assert_eq!(resistance(&world)[..2], expected);
        }
    }
}

/// Negative numbers, and friction without a row; other mistakes are in `tests/input/every_writer.rs`.
#[test]
fn mistakes() {
    let mut world = slides(1.5, 1.0, no_drive(), H);
    let before = resistance(&world);
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        let (first, second) = (array![[bad, 2.0]], array![[2.0, bad]]);
        assert_error(world.robot().set_friction(&second, None, None), "", &["set_friction", "\"b\""]);
        assert_error(world.robot().set_joint_damping(&first, None, None), "", &["set_joint_damping", "\"a\""]);
        assert_error(world.robot().set_armature(&first, None, None), "", &["set_armature", "\"a\""]);
    }
    assert_eq!(resistance(&world), before);
    let mut bare = slides(0.0, 0.0, gains(10.0, 1.0), H);
    assert_error(bare.robot().set_friction(&array![[1.0, 1.0]], None, None), "", &["dry friction", "/a"]);
    assert_eq!(bare.view().friction(), zeros());
}

/// A joint in front of one with an implicit drive gets dry friction in one environment, which shifts MuJoCo's rows for
/// both. The law still holds: the drive's effort is kp (q* - q') - kd v' at the end of the step.
#[test]
fn friction_in_front_of_a_drive() {
    let (stiffness, damping) = (50.0.into(), 4.0.into());
    let mut world = slides(0.0, 0.0, DriveCfg { stiffness, damping, ..beside(DriveModel::Implicit) }, H);
    let mut robot = world.robot();
    robot.set_friction(&array![[1.5]], Some(&[JointIndex(0)]), ENV1).unwrap();
    robot.set_qpos_target(&array![[0.0, 0.2]], None, None).unwrap();
    robot.write_qvel(&array![[1.0, -0.5]], None, None).unwrap();
    for _ in 0..50 {
        world.step(1);
        let (q, v, effort) = (world.view().qpos(), world.view().qvel(), world.view().qf());
        for env in 0..ENVS {
            let law = 50.0 * (0.2 - q[(env, 1)]) - 4.0 * v[(env, 1)];
            assert!((effort[(env, 1)] - law).abs() < 1e-9, "environment {env}: {}, not {law}", effort[(env, 1)]);
        }
        // The solver takes other iterations to the same minimum.
        for (a, b) in [(q[(0, 1)], q[(1, 1)]), (v[(0, 1)], v[(1, 1)])] {
            assert!((a - b).abs() < 1e-12, "the other joint's friction changes nothing here: {a} {b}");
        }
    }
    let q = world.view().qpos();
    assert!((q[(1, 0)] - q[(0, 0)]).abs() > 1e-3, "control: it slows its own joint: {q}");
}

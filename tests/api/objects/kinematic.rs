//! Objects that are moved by hand: where they are put, whom they push, what remembers them.

use super::{empty, object, weightless};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::sensors::ray::{HitTargets, RayCasterCfg};

fn paddle() -> RigidObjectCfg {
    let cfg = object("paddle", ObjectShape::Box { size: [0.1, 1.0, 1.0] }, [0.0; 3]);
    RigidObjectCfg { body_type: BodyType::Kinematic, ..cfg }
}

/// A paddle that advances 1 mm per step in one environment, against a heavy ball in both: the ball is kept ahead of it there,
/// the paddle is exactly where it was put, and the ball in the other environment rests.
#[test]
fn a_paddle_pushes_and_is_not_pushed() {
    let mut sim = weightless(2);
    let paddle = sim.add_rigid_object(paddle()).unwrap();
    let ball = object("ball", ObjectShape::Sphere { radius: 0.2 }, [0.4, 0.0, 0.0]);
    let ball = sim.add_rigid_object(RigidObjectCfg { mass: Some(1000.0), ..ball }).unwrap();
    for step in 1..=1000 {
        let x = 1e-3 * f64::from(step);
        let row = array![[x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]];
        sim.rigid_object_mut(paddle).write_pose(&row, Some(&[EnvId(1)])).unwrap();
        sim.update(1);
        let pose = sim.rigid_object(paddle).get_pose();
        assert_eq!([pose[(1, 0)], pose[(0, 0)]], [x, 0.0]);
    }
    let (x, v) = (sim.rigid_object(ball).get_pose(), sim.rigid_object(ball).get_velocity());
    // Ahead of the face at 1.05 m by its radius, at the paddle's 1 m/s. To MuJoCo the paddle stands: the contact is where
    // b v = k r, with the defaults of solref (0.02 s, 1) and solimp (0.95) r = 2 * 0.95 * 0.02 s * 1 m/s.
    assert!((1.25 - x[(1, 0)] - 0.038).abs() < 2e-3 && (v[(1, 0)] - 1.0).abs() < 1e-3, "{x} {v}");
    assert_eq!([x[(0, 0)], v[(0, 0)]], [0.4, 0.0]);
    assert!(sim.rigid_object(paddle).get_velocity().iter().all(|v| *v == 0.0));
}

/// It holds up what lies on it, as high as it is.
#[test]
fn a_table_that_is_raised_raises_what_lies_on_it() {
    let mut sim = empty(2);
    let table = object("table", ObjectShape::Box { size: [1.0, 1.0, 0.1] }, [0.0; 3]);
    let table = sim.add_rigid_object(RigidObjectCfg { body_type: BodyType::Kinematic, ..table }).unwrap();
    let cube = sim.add_rigid_object(object("cube", ObjectShape::cube(0.2), [0.0, 0.0, 0.15])).unwrap();
    for step in 1..=1000 {
        let z = 2e-4 * f64::from(step);
        let rows = array![[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.0, 0.0, z, 2.0, 0.0, 0.0, 0.0]];
        sim.rigid_object_mut(table).write_pose(&rows, None).unwrap();
        sim.update(1);
    }
    sim.update(500);
    let z = sim.rigid_object(cube).get_pose();
    assert!((z[(0, 2)] - 0.15).abs() < 1e-3 && (z[(1, 2)] - 0.35).abs() < 1e-3, "{z}");
    // The quaternion of length 2 was normalised.
    assert_eq!(sim.rigid_object(table).get_pose()[(1, 3)], 1.0);
}

#[test]
fn reset_snapshots_and_additions_know_where_it_is() {
    let mut sim = empty(3);
    let cfg = RigidObjectCfg { init_pose: Pose::translation(1.0, 2.0, 3.0), ..paddle() };
    let paddle = sim.add_rigid_object(cfg).unwrap();
    let init = [1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0];
    let there = Array2::from_shape_fn((3, 7), |(e, k)| [e as f64, 0.5, -1.0, 0.0, 1.0, 0.0, 0.0][k]);
    sim.rigid_object_mut(paddle).write_pose(&there, None).unwrap();
    sim.update(5);
    assert_eq!(sim.rigid_object(paddle).get_pose(), there);
    let snapshot = sim.snapshot(None).unwrap();
    // What is added later comes before it in MuJoCo's lists, or after: it stays where it is.
    let other = RigidObjectCfg { body_type: BodyType::Kinematic, ..object("other", ObjectShape::cube(0.1), [9.0; 3]) };
    let other = sim.add_rigid_object(other).unwrap();
    sim.add_rigid_object(object("cube", ObjectShape::cube(0.1), [5.0; 3])).unwrap();
    assert_eq!(sim.rigid_object(paddle).get_pose(), there);
    assert_eq!(sim.rigid_object(other).get_pose()[(2, 0)], 9.0);
    sim.update(5);
    assert_eq!(sim.rigid_object(paddle).get_pose(), there);
    sim.reset(Some(&[EnvId(1)])).unwrap();
    let pose = sim.rigid_object(paddle).get_pose();
    assert_eq!(pose.row(1).to_vec(), init);
    assert_eq!((pose.row(0), pose.row(2)), (there.row(0), there.row(2)));
    // The snapshot is of the scene before more was added.
    assert!(sim.restore(&snapshot, None).is_err());
    let now = sim.snapshot(None).unwrap();
    sim.reset(None).unwrap();
    sim.restore(&now, Some(&[EnvId(2), EnvId(0), EnvId(1)])).unwrap();
    let pose = sim.rigid_object(paddle).get_pose();
    assert_eq!((pose.row(2), pose.row(0), pose.row(1).to_vec()), (there.row(0), pose.row(0), there.row(2).to_vec()));
    assert_eq!(pose.row(0).to_vec(), init);
}

/// A ray sees it where it was put, at once, in each environment where it is there.
#[test]
fn rays_see_it_where_it_was_put() {
    let mut sim = empty(2);
    let paddle = sim.add_rigid_object(paddle()).unwrap();
    let ray = RayCasterCfg {
        offset: Pose::translation(-3.0, 0.0, 0.0),
        pattern: kinetoscope::sensors::ray::pattern::Custom {
            directions: vec![[1.0, 0.0, 0.0]],
            starts: vec![[0.0; 3]],
        }
        .into(),
        targets: HitTargets::Named(vec!["paddle".into()]),
        ..RayCasterCfg::default()
    };
    let ray = sim.add_sensor("ray", ray).unwrap();
    sim.update(1);
    assert!(sim.sensor(ray).unwrap().distances().iter().all(|d| (d - 2.95).abs() < 1e-9));
    let rows = array![[1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.25, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]];
    sim.rigid_object_mut(paddle).write_pose(&rows, None).unwrap();
    let distances = sim.sensor(ray).unwrap().distances().to_owned();
    assert!((distances[(0, 0)] - 3.95).abs() < 1e-9 && (distances[(1, 0)] - 3.2).abs() < 1e-9, "{distances}");
}

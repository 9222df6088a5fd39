//! Objects with written poses: kinematic objects, which push but are not pushed, and static objects, which may have a
//! different pose in each environment.

use super::*;
use kinetoscope::ndarray::Array2;
use kinetoscope::sensors::ray::pattern::Custom;
use kinetoscope::sensors::ray::{HitTargets, RayCasterCfg};
use kinetoscope::sim::RigidObjectId;

fn paddle() -> RigidObjectCfg {
    kinematic(object("paddle", ObjectShape::Box { size: [0.1, 1.0, 1.0] }, [0.0; 3]))
}

fn at(x: f64, z: f64) -> [f64; 7] {
    [x, 0.0, z, 1.0, 0.0, 0.0, 0.0]
}

/// A paddle advances 1 mm per step in one environment, toward a heavy ball. The ball is pushed ahead of it, the paddle
/// has exactly its written pose, and the ball in the other environment rests.
#[test]
fn paddle_pushes() {
    let mut sim = weightless(2);
    let paddle = sim.add_rigid_object(paddle()).unwrap();
    let ball = sim.add_rigid_object(ball("ball", 0.2, 1000.0, [0.4, 0.0, 0.0])).unwrap();
    for step in 1..=1000 {
        let x = 1e-3 * f64::from(step);
        sim.rigid_object_mut(paddle).write_pose(&row(at(x, 0.0)), Some(SECOND)).unwrap();
        sim.update(1);
        let pose = sim.rigid_object(paddle).pose();
        assert_eq!([pose[(1, 0)], pose[(0, 0)]], [x, 0.0]);
    }
    let (x, v) = (sim.rigid_object(ball).pose(), sim.rigid_object(ball).velocity());
    // The ball is ahead of the face at 1.05 m by its radius, with the paddle's 1 m/s. For MuJoCo the paddle is static:
    // the contact is where b v = k r, with the defaults of solref (0.02 s, 1) and solimp (0.95) r = 2 * 0.95 * 0.02 s *
    // 1 m/s.
    assert!((1.25 - x[(1, 0)] - 0.038).abs() < 2e-3 && (v[(1, 0)] - 1.0).abs() < 1e-3, "{x} {v}");
    assert_eq!([x[(0, 0)], v[(0, 0)]], [0.4, 0.0]);
    assert!(sim.rigid_object(paddle).velocity().iter().all(|v| *v == 0.0));
}

/// Reset, snapshots and additions handle the pose of a kinematic object.
#[test]
fn kinematic_state() {
    let mut sim = empty(3);
    let cfg = RigidObjectCfg { init_pose: Pose::translation(1.0, 2.0, 3.0), ..paddle() };
    let paddle = sim.add_rigid_object(cfg).unwrap();
    let init = [1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0];
    let there = Array2::from_shape_fn((3, 7), |(e, k)| [e as f64, 0.5, -1.0, 0.0, 1.0, 0.0, 0.0][k]);
    sim.rigid_object_mut(paddle).write_pose(&there, None).unwrap();
    sim.update(5);
    assert_eq!(sim.rigid_object(paddle).pose(), there);
    let snapshot = sim.snapshot(None).unwrap();
    // A later object comes before or after it in MuJoCo's lists: the pose is kept.
    let other = sim.add_rigid_object(kinematic(object("other", ObjectShape::cube(0.1), [9.0; 3]))).unwrap();
    sim.add_rigid_object(object("cube", ObjectShape::cube(0.1), [5.0; 3])).unwrap();
    assert_eq!(sim.rigid_object(paddle).pose(), there);
    assert_eq!(sim.rigid_object(other).pose()[(2, 0)], 9.0);
    sim.update(5);
    assert_eq!(sim.rigid_object(paddle).pose(), there);
    sim.reset(Some(SECOND)).unwrap();
    let pose = sim.rigid_object(paddle).pose();
    assert_eq!(pose.row(1).to_vec(), init);
    assert_eq!((pose.row(0), pose.row(2)), (there.row(0), there.row(2)));
    // The snapshot belongs to the scene before the addition.
    assert!(sim.restore(&snapshot, None).is_err());
    let now = sim.snapshot(None).unwrap();
    sim.reset(None).unwrap();
    sim.restore(&now, Some(&[EnvId(2), EnvId(0), EnvId(1)])).unwrap();
    let pose = sim.rigid_object(paddle).pose();
    assert_eq!((pose.row(2), pose.row(0).to_vec(), pose.row(1)), (there.row(0), init.to_vec(), there.row(2)));
}

/// A ray hits a kinematic object at its written pose, at once, in each environment.
#[test]
fn rays_see_it() {
    let mut sim = empty(2);
    let paddle = sim.add_rigid_object(paddle()).unwrap();
    let ray = RayCasterCfg {
        offset: Pose::translation(-3.0, 0.0, 0.0),
        pattern: Custom { directions: vec![[1.0, 0.0, 0.0]], starts: vec![[0.0; 3]] }.into(),
        targets: HitTargets::Named(vec!["paddle".into()]),
        ..RayCasterCfg::default()
    };
    let ray = sim.add_sensor("ray", ray).unwrap();
    sim.update(1);
    assert!(sim.sensor(ray).unwrap().distances().iter().all(|d| (d - 2.95).abs() < 1e-9));
    sim.rigid_object_mut(paddle).write_pose(&Array2::from(vec![at(1.0, 0.0), at(0.25, 0.0)]), None).unwrap();
    let distances = sim.sensor(ray).unwrap().distances().to_owned();
    assert!((distances[(0, 0)] - 3.95).abs() < 1e-9 && (distances[(1, 0)] - 3.2).abs() < 1e-9, "{distances}");
}

/// A shelf of 4 cm thickness and a ball above it.
pub(super) fn shelf(num_envs: usize, height: f64) -> (SimulationManager, RigidObjectId, RigidObjectId) {
    let mut sim = empty(num_envs);
    let size = ObjectShape::Box { size: [0.4, 0.4, 0.04] };
    let shelf = sim.add_rigid_object(fixed(object("shelf", size, [0.0, 0.0, height]))).unwrap();
    let ball = sim.add_rigid_object(object("ball", ObjectShape::Sphere { radius: 0.05 }, [0.0, 0.0, 1.2])).unwrap();
    (sim, shelf, ball)
}

/// A ball rests on the shelf of its environment.
#[test]
fn shelves() {
    let heights = [0.5, 0.8, 1.0];
    let (mut sim, shelf_id, ball) = shelf(3, heights[0]);
    let rows = Array2::from(vec![at(0.0, heights[2]), at(0.0, heights[1])]);
    sim.rigid_object_mut(shelf_id).write_pose(&rows, Some(&[EnvId(2), EnvId(1)])).unwrap();
    let places = Array2::from(heights.map(|z| at(0.0, z)).to_vec());
    assert_eq!(sim.rigid_object(shelf_id).pose(), places);
    sim.update(1500);
    let lies = sim.rigid_object(ball).pose();
    for (env, height) in heights.into_iter().enumerate() {
        assert_number(&format!("environment {env}"), lies[(env, 2)], height + 0.07, SOFT);
        // Reference: a scene built with that height.
        let (mut built, _, ball) = shelf(3, height);
        built.update(1500);
        assert_eq!(built.rigid_object(ball).pose().row(env), lies.row(env), "bit for bit");
    }
    // The environment that was not named shares everything; the others have two own arrays and those derived from them.
    let base = sim.batch().model().clone();
    assert!(sim.batch().read(0, |env| env.data().model().unshared_arrays(&base).is_empty()));
    let own: Vec<&str> = sim.batch().read(1, |env| env.data().model().own_arrays().map(|(name, _)| name).collect());
    assert!(own.contains(&"body_pos") && own.len() <= 4, "{own:?}");
    // The pose persists through a reset and an addition, until properties are nominal again.
    sim.reset(None).unwrap();
    sim.add_rigid_object(object("late", ObjectShape::cube(0.1), [5.0; 3])).unwrap();
    assert_eq!(sim.rigid_object(shelf_id).pose(), places);
    sim.properties_mut().reset(Some(SECOND)).unwrap();
    let pose = sim.rigid_object(shelf_id).pose();
    assert_eq!((pose[(1, 2)], pose[(2, 2)]), (heights[0], heights[2]));
}

/// A ramp at angle a: a ball that slides without friction has the acceleration g sin a along the ramp.
#[test]
fn ramp() {
    let (mut sim, shelf_id, ball) = shelf(2, 0.5);
    let angle = 0.3_f64;
    let (sin, cos) = (angle / 2.0).sin_cos();
    // Quaternions are normalized.
    let turned = row([0.0, 0.0, 0.5, 3.0 * cos, 0.0, 3.0 * sin, 0.0]);
    sim.rigid_object_mut(shelf_id).write_pose(&turned, Some(SECOND)).unwrap();
    let read = sim.rigid_object(shelf_id).pose();
    assert!((read[(1, 3)] - cos).abs() < 1e-15 && (read[(1, 5)] - sin).abs() < 1e-15, "{read}");
    sim.properties_mut()
        .randomize_with(None, |_, _, p| {
            p.set(Property::Friction, "shelf", &[0.0])?;
            p.set(Property::Friction, "ball", &[0.0])
        })
        .unwrap();
    // On the surface, which is 2 cm from the shelf's middle: the ball's center is 7 cm along the normal.
    let place = at(0.07 * angle.sin(), 0.5 + 0.07 * angle.cos());
    sim.rigid_object_mut(ball).write_pose(&row(place), Some(SECOND)).unwrap();
    sim.update(150);
    let v = sim.rigid_object(ball).velocity();
    let along = v[(1, 0)] * angle.cos() - v[(1, 2)] * angle.sin();
    let expected = 9.81 * angle.sin() * 0.15;
    // MuJoCo's contact without friction is soft along its normal only: 1 %.
    assert!((along / expected - 1.0).abs() < 0.01, "{along}, not {expected}");
}

/// Randomized poses by name, as for any property; rays hit the shelf where MuJoCo's rays do.
#[test]
fn randomized_poses() {
    let (mut sim, shelf_id, _) = shelf(2, 0.5);
    // Off edges, where rounding decides.
    let rays = RayCasterCfg { offset: Pose::translation(0.013, 0.007, 3.0), ..Default::default() };
    let rays = sim.add_sensor("rays", rays).unwrap();
    let draw = Randomization::new().with(Property::Position, "shelf", RandomizationOp::Add([-0.05, 0.05]));
    sim.properties_mut().randomize(&draw, Some(SECOND)).unwrap();
    let place = sim.rigid_object(shelf_id).pose();
    let moved: Vec<f64> = (0..3).map(|k| place[(1, k)] - place[(0, k)]).collect();
    assert!(moved.iter().all(|d| d.abs() <= 0.05 && *d != 0.0), "{moved:?}");
    let rays = sim.sensor(rays).unwrap();
    for env in 0..2 {
        for k in 0..rays.num_rays() {
            let start = [0, 1, 2].map(|axis| rays.ray_starts()[(env, k, axis)]);
            let hit = sim.batch().read(env, |env| env.data().ray(start, [0.0, 0.0, -1.0], 0b111)).unwrap();
            let (ours, theirs) = (rays.distances()[(env, k)], hit.map_or(f64::INFINITY, |hit| hit.distance));
            assert!(ours == theirs || (ours - theirs).abs() < 1e-6, "environment {env}, ray {k}: {ours}, not {theirs}");
        }
    }
}

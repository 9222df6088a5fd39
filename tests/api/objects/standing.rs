//! Static objects that stand elsewhere in each environment.

use super::{empty, object};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::mj::ObjectKind;

/// A shelf of 4 cm in two environments' own places, and a ball above it.
fn shelf(num_envs: usize, height: f64) -> (SimulationManager, ObjectId, ObjectId) {
    let mut sim = empty(num_envs);
    let size = ObjectShape::Box { size: [0.4, 0.4, 0.04] };
    let shelf = RigidObjectCfg { body_type: BodyType::Static, ..object("shelf", size, [0.0, 0.0, height]) };
    let shelf = sim.add_rigid_object(shelf).unwrap();
    let ball = sim.add_rigid_object(object("ball", ObjectShape::Sphere { radius: 0.05 }, [0.0, 0.0, 1.2])).unwrap();
    (sim, shelf, ball)
}

/// Contacts of a ball are soft: it sinks in by (1 - d) g / (d k), at most 0.4 mm with MuJoCo's default reference
/// (d = 0.9, k = 1 / (0.95 · 0.02 s)²).
#[test]
fn what_falls_lies_where_the_shelf_of_its_environment_is() {
    let heights = [0.5, 0.8, 1.0];
    let (mut sim, shelf_id, ball) = shelf(3, heights[0]);
    let pose = |z: f64| [0.0, 0.0, z, 1.0, 0.0, 0.0, 0.0];
    let rows = Array2::from(vec![pose(heights[2]), pose(heights[1])]);
    sim.rigid_object_mut(shelf_id).write_pose(&rows, Some(&[EnvId(2), EnvId(1)])).unwrap();
    assert_eq!(sim.rigid_object(shelf_id).get_pose(), Array2::from(heights.map(pose).to_vec()));
    sim.update(1500);
    let lies = sim.rigid_object(ball).get_pose();
    for (env, height) in heights.into_iter().enumerate() {
        assert!((lies[(env, 2)] - height - 0.07).abs() < 5e-4, "environment {env}: {lies}");
        // The judge: a scene that was built so.
        let (mut built, _, ball) = shelf(3, height);
        built.update(1500);
        assert_eq!(built.rigid_object(ball).get_pose().row(env), lies.row(env), "bit for bit");
    }
    // The environment that was not named shares everything; the others have two arrays and what follows from them.
    let base = sim.batch().model().clone();
    assert!(sim.batch().read(0, |env| env.data().model().arrays_apart(&base).is_empty()));
    let own: Vec<&str> = sim.batch().read(1, |env| env.data().model().own_arrays().map(|(name, _)| name).collect());
    assert!(own.contains(&"body_pos") && own.len() <= 4, "{own:?}");
    // It stands there after a reset and when more is added, until properties are nominal again.
    sim.reset(None).unwrap();
    sim.add_rigid_object(object("late", ObjectShape::cube(0.1), [5.0; 3])).unwrap();
    assert_eq!(sim.rigid_object(shelf_id).get_pose(), Array2::from(heights.map(pose).to_vec()));
    sim.reset_properties(Some(&[EnvId(1)])).unwrap();
    assert_eq!(sim.rigid_object(shelf_id).get_pose()[(1, 2)], heights[0]);
    assert_eq!(sim.rigid_object(shelf_id).get_pose()[(2, 2)], heights[2]);
}

/// A ramp at angle a: what slides without friction has the acceleration g sin a along it.
#[test]
fn a_shelf_that_is_turned_is_a_ramp() {
    let (mut sim, shelf_id, ball) = shelf(2, 0.5);
    let angle = 0.3_f64;
    let (sin, cos) = (angle / 2.0).sin_cos();
    // Quaternions are normalised.
    let row = array![[0.0, 0.0, 0.5, 3.0 * cos, 0.0, 3.0 * sin, 0.0]];
    sim.rigid_object_mut(shelf_id).write_pose(&row, Some(&[EnvId(1)])).unwrap();
    let read = sim.rigid_object(shelf_id).get_pose();
    assert!((read[(1, 3)] - cos).abs() < 1e-15 && (read[(1, 5)] - sin).abs() < 1e-15, "{read}");
    sim.randomize_with(None, |_, _, p| {
        p.set(Property::Friction, "shelf", &[0.0])?;
        p.set(Property::Friction, "ball", &[0.0])
    })
    .unwrap();
    // On the surface, which is 2 cm thick from its middle: the ball's middle is 7 cm along the normal.
    let (x, z) = (0.07 * angle.sin(), 0.5 + 0.07 * angle.cos());
    sim.rigid_object_mut(ball).write_pose(&array![[x, 0.0, z, 1.0, 0.0, 0.0, 0.0]], Some(&[EnvId(1)])).unwrap();
    sim.update(150);
    let v = sim.rigid_object(ball).get_velocity();
    let along = v[(1, 0)] * angle.cos() - v[(1, 2)] * angle.sin();
    let expected = 9.81 * angle.sin() * 0.15;
    // MuJoCo's contact without friction is soft along its normal only: 1 %.
    assert!((along / expected - 1.0).abs() < 0.01, "{along}, not {expected}");
}

/// Random places by name, as any property; cameras look where it is.
#[test]
fn places_are_drawn_and_seen() {
    let (mut sim, shelf_id, _) = shelf(2, 0.5);
    let camera = CameraCfg {
        width: 9,
        height: 9,
        intrinsics: Intrinsics::Pixels { fx: 9.0, fy: 9.0, cx: 4.5, cy: 4.5 },
        channels: Channels::from_names(&["depth"]).unwrap(),
        ..Default::default()
    };
    // Off edges, where rounding decides.
    let rays = RayCasterCfg { offset: Pose::translation(0.013, 0.007, 3.0), ..Default::default() };
    let (camera, rays) = (sim.add_sensor("camera", camera).unwrap(), sim.add_sensor("rays", rays).unwrap());
    let eye = sim.sensor_mut(camera).unwrap();
    eye.look_at(&[[0.1, 0.1, 3.0]], &[[0.1, 0.1, 0.0]], &[[1.0, 0.0, 0.0]], None).unwrap();
    let draw = Randomization::new().with(Property::Position, "shelf", Draw::Add([-0.05, 0.05]));
    sim.randomize(&draw, Some(&[EnvId(1)])).unwrap();
    let place = sim.rigid_object(shelf_id).get_pose();
    let moved: Vec<f64> = (0..3).map(|k| place[(1, k)] - place[(0, k)]).collect();
    assert!(moved.iter().all(|d| d.abs() <= 0.05 && *d != 0.0), "{moved:?}");
    let depth = sim.sensor(camera).unwrap().depth().unwrap().to_owned();
    // The ball is not in the way of the middle of the picture, 10 cm beside it in both directions.
    for env in 0..2 {
        let expected = 3.0 - place[(env, 2)] - 0.02;
        assert!((f64::from(depth[(env, 4, 4)]) - expected).abs() < 3e-6, "{}", depth[(env, 4, 4)]);
    }
    // MuJoCo's own rays in the model of each environment.
    let rays = sim.sensor(rays).unwrap();
    let (starts, distances) = (rays.ray_starts(), rays.distances());
    for env in 0..2 {
        let theirs = sim.batch().read(env, |env_| {
            let row = |k: usize| std::array::from_fn(|axis| starts[(env, k, axis)]);
            (0..rays.num_rays()).map(|k| env_.data().ray(row(k), [0.0, 0.0, -1.0], 0b111).unwrap()).collect::<Vec<_>>()
        });
        for (k, theirs) in theirs.into_iter().enumerate() {
            let (ours, theirs) = (distances[(env, k)], theirs.map_or(f64::INFINITY, |hit| hit.distance));
            assert!(ours == theirs || (ours - theirs).abs() < 1e-6, "environment {env}, ray {k}: {ours}, not {theirs}");
        }
    }
}

#[test]
fn places_that_cannot_be_are_named() {
    let (mut sim, shelf_id, _) = shelf(2, 0.5);
    let before = sim.rigid_object(shelf_id).get_pose();
    let mut shelf = sim.rigid_object_mut(shelf_id);
    let flat = shelf.write_pose(&array![[0.0; 7]], None);
    assert!(matches!(flat, Err(Error::Config { field: "write_pose", .. })), "{flat:?}");
    assert!(matches!(shelf.write_pose(&array![[0.0; 6]], None), Err(Error::Shape { .. })));
    let nan = array![[0.0, f64::NAN, 0.0, 1.0, 0.0, 0.0, 0.0]];
    assert!(matches!(shelf.write_pose(&nan, None), Err(Error::NotFinite { column: 1, .. })));
    let moving = shelf.write_velocity(&array![[0.0; 6]], None);
    assert!(matches!(moving, Err(Error::FixedBody(uid)) if uid == "shelf"));
    let set = |sim: &mut SimulationManager, property, name: &str, value: &[f64]| {
        sim.randomize_with(None, |_, _, p| p.set(property, name, value)).unwrap_err().to_string()
    };
    assert!(set(&mut sim, Property::Rotation, "shelf", &[1.0, 1.0, 0.0, 0.0]).contains("length 1"));
    assert!(set(&mut sim, Property::Position, "shelf", &[f64::INFINITY, 0.0, 0.0]).contains("finite"));
    assert!(set(&mut sim, Property::Position, "ball", &[0.0; 3]).contains("static object called"));
    assert_eq!(sim.rigid_object(shelf_id).get_pose(), before);
    let model = sim.batch().model();
    assert!(model.id(ObjectKind::Body, "shelf").is_some() && sim.property_bytes(EnvId(0)).unwrap() == 0);
}

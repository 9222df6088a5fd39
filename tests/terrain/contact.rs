//! What lies on a terrain, and what falls through where there is none.

use super::empty;
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;

const RADIUS: f64 = 0.25;

/// A bowl of points 0.1 m apart, 1 m deep at 2 m from the middle.
fn bowl() -> TerrainCfg {
    let heights = Array2::from_shape_fn((41, 41), |(r, c)| {
        let (x, y) = (0.1 * c as f64 - 2.0, 0.1 * r as f64 - 2.0);
        0.25 * (x * x + y * y)
    });
    TerrainCfg { uid: "bowl".into(), heights, size: [4.0, 4.0], ..Default::default() }
}

/// A ball beside the middle, above the surface.
fn ball() -> RigidObjectCfg {
    RigidObjectCfg {
        uid: "ball".into(),
        shape: ObjectShape::Sphere { radius: RADIUS },
        mass: Some(0.5),
        init_pose: Pose::translation(0.13, -0.08, 0.5),
        ..Default::default()
    }
}

/// The ball comes to rest on the surface: the nearest point of it is a radius away, and MuJoCo's soft contact lets a ball of
/// 0.5 kg sink by less than a millimetre. Points of the surface are tried every 2 mm, which finds the nearest one to
/// (1.4 mm)² / (2 · 0.25 m) = 4e-6 m where the surface is flat; in an edge or a corner that looks up, it is a little more.
#[test]
fn a_ball_comes_to_rest_on_it() {
    let mut sim = empty();
    let (terrain, ball) = (sim.add_terrain(bowl()).unwrap(), sim.add_rigid_object(ball()).unwrap());
    sim.update(1500);
    let (pose, velocity) = (sim.rigid_object(ball).get_pose(), sim.rigid_object(ball).get_velocity());
    for env in 0..2 {
        let center = [0, 1, 2].map(|k| pose[(env, k)]);
        assert!(velocity.row(env).iter().all(|v| v.abs() < 0.02), "{velocity}");
        let mut nearest = f64::INFINITY;
        for (i, j) in (-150..=150).flat_map(|i| (-150..=150).map(move |j| (i, j))) {
            let [x, y] = [center[0] + 0.002 * f64::from(i), center[1] + 0.002 * f64::from(j)];
            let z = sim.terrain(terrain).height_at([x, y]).unwrap();
            let d = [x - center[0], y - center[1], z - center[2]];
            nearest = nearest.min(d.iter().map(|x| x * x).sum::<f64>().sqrt());
        }
        println!("the surface is {nearest} m from the middle of the ball at {center:?}");
        assert!((nearest - RADIUS).abs() < 1e-3, "{nearest}");
    }
    // Gravity is carried by the bowl.
    assert!(center_of(&sim, ball) > 0.2);
}

fn center_of(sim: &SimulationManager, ball: ObjectId) -> f64 {
    sim.rigid_object(ball).get_pose()[(0, 2)]
}

/// The control: without the bowl it falls, g t² / 2.
#[test]
fn without_it_the_ball_falls() {
    let mut sim = empty();
    let ball = sim.add_rigid_object(ball()).unwrap();
    sim.update(100);
    assert!(center_of(&sim, ball) < -4.0);
}

/// It can be added when things are falling already, which go on from where they are.
#[test]
fn it_can_be_added_later() {
    let mut sim = empty();
    let ball = sim.add_rigid_object(ball()).unwrap();
    sim.update(10);
    let (before, velocity) = (sim.rigid_object(ball).get_pose(), sim.rigid_object(ball).get_velocity());
    sim.add_terrain(bowl()).unwrap();
    assert_eq!(before, sim.rigid_object(ball).get_pose());
    assert_eq!(velocity, sim.rigid_object(ball).get_velocity());
    sim.update(300);
    assert!(center_of(&sim, ball) > 0.2);
}

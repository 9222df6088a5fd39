//! What lies on a terrain, and what falls through where there is none.

use super::empty;
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;

const RADIUS: f64 = 0.25;

/// A pit of four flat walls that rise by 1 m per metre from the middle, points 0.1 m apart.
fn pit() -> TerrainCfg {
    let heights = Array2::from_shape_fn((41, 41), |(r, c)| {
        let (x, y) = (0.1 * c as f64 - 2.0, 0.1 * r as f64 - 2.0);
        x.abs().max(y.abs())
    });
    TerrainCfg { uid: "pit".into(), heights, size: [4.0, 4.0], ..Default::default() }
}

/// A ball beside the middle, above the surface.
fn ball() -> RigidObjectCfg {
    RigidObjectCfg {
        uid: "ball".into(),
        shape: ObjectShape::Sphere { radius: RADIUS },
        mass: Some(0.5),
        init_pose: Pose::translation(0.13, -0.08, 0.8),
        ..Default::default()
    }
}

/// The ball comes to rest on all four walls, each at 45 degrees, a radius away from its middle: which is sqrt(2) radii above
/// the bottom. MuJoCo's soft contacts let a ball of 0.5 kg sink by less than a millimetre.
#[test]
fn a_ball_comes_to_rest_on_it() {
    let mut sim = empty();
    let (terrain, ball) = (sim.add_terrain(pit()).unwrap(), sim.add_rigid_object(ball()).unwrap());
    assert_eq!((sim.terrain(terrain).uid(), sim.terrain(terrain).cfg()), ("pit", &pit()));
    sim.update(1000);
    let (pose, velocity) = (sim.rigid_object(ball).get_pose(), sim.rigid_object(ball).get_velocity());
    for env in 0..2 {
        let center = [0, 1, 2].map(|k| pose[(env, k)]);
        println!("{center:?}, {:?}", velocity.row(env));
        assert!(velocity.row(env).iter().all(|v| v.abs() < 1e-3), "{velocity}");
        let place = [0.0, 0.0, 2.0_f64.sqrt() * RADIUS];
        assert!(center.iter().zip(place).all(|(a, b)| (a - b).abs() < 2e-3), "{center:?}, not {place:?}");
        // Where it touches, half a radius times sqrt(2) from the middle, the surface is a radius away.
        let side = RADIUS / 2.0_f64.sqrt();
        for [x, y] in [[side, 0.0], [-side, 0.0], [0.0, side], [0.0, -side]] {
            let z = sim.terrain(terrain).height_at([x, y]).unwrap();
            let d = [x - center[0], y - center[1], z - center[2]];
            let distance = d.iter().map(|x| x * x).sum::<f64>().sqrt();
            assert!((distance - RADIUS).abs() < 2e-3, "{distance} at ({x}, {y})");
        }
    }
}

fn center_of(sim: &SimulationManager, ball: ObjectId) -> f64 {
    sim.rigid_object(ball).get_pose()[(0, 2)]
}

/// Contact sensors feel it as a part of the world: at rest, its walls together carry the ball's weight.
#[test]
fn contact_sensors_feel_the_weight() {
    let mut sim = empty();
    sim.add_terrain(pit()).unwrap();
    sim.add_rigid_object(ball()).unwrap();
    let feel = ContactSensorCfg { filters: vec!["world".into()], ..ContactSensorCfg::of("ball") };
    let sensor = sim.add_sensor("contact", feel).unwrap();
    sim.update(1000);
    let sensor = sim.sensor(sensor).unwrap();
    for env in 0..2 {
        let total = [0, 1, 2].map(|k| sensor.total_forces_w()[(env, 0, k)]);
        // What is left of the motion, below 1e-3 m/s, is braked at some 0.01 s: below 0.05 N.
        let weight = [0.0, 0.0, 0.5 * 9.81];
        assert!(total.iter().zip(weight).all(|(a, b)| (a - b).abs() < 0.05), "{total:?}");
        let normal = [0, 1, 2].map(|k| sensor.net_forces_w()[(env, 0, k)]);
        let matrix = [0, 1, 2].map(|k| sensor.force_matrix_w()[(env, 0, 0, k)]);
        assert!(normal.iter().zip(matrix).all(|(a, b)| (a - b).abs() < 1e-9), "{normal:?} {matrix:?}");
    }
}

/// The control: without the pit it falls, g t² / 2.
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
    sim.add_terrain(pit()).unwrap();
    assert_eq!(before, sim.rigid_object(ball).get_pose());
    assert_eq!(velocity, sim.rigid_object(ball).get_velocity());
    sim.update(300);
    assert!(center_of(&sim, ball) > 0.2);
}

//! Motion of rigid objects, and configurations that are refused.

use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use nalgebra::UnitQuaternion;
use testkit::worlds::{ball, cfg, object, pose_in, sim, weightless_cfg};

/// Free fall by semi-implicit Euler: v = -g h n, z = z0 - g h² n (n + 1) / 2.
#[test]
fn fall() {
    let mut sim = sim(cfg(2, 2));
    let cube = sim.add_rigid_object(object("cube", ObjectShape::cube(0.1), [0.3, -0.2, 5.0])).unwrap();
    sim.update(50);
    let (pose, velocity) = (sim.rigid_object(cube).get_pose(), sim.rigid_object(cube).get_velocity());
    for env in 0..2 {
        let expected = 5.0 - 9.81 * 1e-4 * 50.0 * 51.0 / 2.0;
        assert!((pose[(env, 2)] - expected).abs() < 1e-12, "{}", pose[(env, 2)]);
        assert!((velocity[(env, 2)] + 9.81 * 0.5).abs() < 1e-12);
        assert_eq!([pose[(env, 0)], pose[(env, 1)], pose[(env, 3)]], [0.3, -0.2, 1.0]);
    }
}

/// Spin about a principal axis goes on; velocities are in world axes however the object lies.
#[test]
fn velocities_in_world_axes() {
    let mut sim = sim(weightless_cfg(1));
    let ball = sim.add_rigid_object(ball("ball", 0.1, 1.0, [0.0; 3])).unwrap();
    // A quarter turn about x, and a spin about the world's z.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    sim.rigid_object_mut(ball).write_pose(&array![[0.0, 0.0, 1.0, half, half, 0.0, 0.0]], None).unwrap();
    let written = array![[0.5, 0.0, 0.0, 0.0, 0.0, 2.0]];
    sim.rigid_object_mut(ball).write_velocity(&written, None).unwrap();
    sim.update(100);
    let velocity = sim.rigid_object(ball).get_velocity();
    assert!((&velocity - &written).iter().all(|error| error.abs() < 1e-9), "{velocity}");
    // After one second it has turned by 2 rad about z: R = Rz(2) Rx(90°).
    let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, 2.0)
        * UnitQuaternion::from_euler_angles(std::f64::consts::FRAC_PI_2, 0.0, 0.0);
    let found = pose_in(&sim.rigid_object(ball).get_pose(), 0);
    assert!((found.translation.x - 0.5).abs() < 1e-9 && found.rotation.angle_to(&turned) < 1e-9, "{found}");
}

#[test]
fn refused() {
    let mut sim = sim(cfg(1, 1));
    let cfg = |uid: &str| object(uid, ObjectShape::cube(0.1), [0.0; 3]);
    sim.add_rigid_object(cfg("ball")).unwrap();
    for cfg in [
        cfg("ball"),
        cfg("world"),
        cfg("a/b"),
        RigidObjectCfg { shape: ObjectShape::cube(0.0), ..cfg("c") },
        RigidObjectCfg { shape: ObjectShape::Sphere { radius: f64::NAN }, ..cfg("c") },
        RigidObjectCfg { density: 0.0, ..cfg("c") },
        RigidObjectCfg { friction: Some([-1.0, 0.0, 0.0]), ..cfg("c") },
        RigidObjectCfg { rgba: [2.0, 0.0, 0.0, 1.0], ..cfg("c") },
    ] {
        let shown = format!("{cfg:?}");
        assert!(sim.add_rigid_object(cfg).is_err(), "{shown}");
    }
}

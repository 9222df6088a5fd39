//! Rigid objects: what cameras look at in the tutorial.

use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;

fn sim() -> SimulationManager {
    SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() }).unwrap()
}

/// Free fall of a semi-implicit Euler: v = -g h n, z = z0 - g h² n (n + 1) / 2.
#[test]
fn objects_fall() {
    let mut sim = sim();
    let cfg = RigidObjectCfg { init_pose: Pose::translation(0.3, -0.2, 5.0), ..Default::default() };
    let cube = sim.add_rigid_object(cfg).unwrap();
    sim.update(50);
    let (pose, velocity) = (sim.rigid_object(cube).get_pose(), sim.rigid_object(cube).get_velocity());
    for env in 0..2 {
        let expected = 5.0 - 9.81 * 1e-4 * 50.0 * 51.0 / 2.0;
        assert!((pose[(env, 2)] - expected).abs() < 1e-12, "{}", pose[(env, 2)]);
        assert!((velocity[(env, 2)] + 9.81 * 0.5).abs() < 1e-12);
        assert_eq!([pose[(env, 0)], pose[(env, 1)], pose[(env, 3)]], [0.3, -0.2, 1.0]);
    }
}

/// The tutorial's cube, 5 cm and 1 kg, dropped from 10 cm, comes to rest on the ground: MuJoCo's soft contacts let it sink
/// by much less than a millimetre.
#[test]
fn a_cube_comes_to_rest_on_the_ground() {
    let mut sim = sim();
    let cfg = RigidObjectCfg {
        shape: ObjectShape::cube(0.05),
        mass: Some(1.0),
        init_pose: Pose::translation(1.2, -0.2, 0.1),
        ..Default::default()
    };
    let cube = sim.add_rigid_object(cfg).unwrap();
    assert_eq!(sim.rigid_object(cube).mass(), 1.0);
    sim.update(200);
    let (pose, velocity) = (sim.rigid_object(cube).get_pose(), sim.rigid_object(cube).get_velocity());
    assert!((pose[(0, 2)] - 0.025).abs() < 1e-3, "{}", pose[(0, 2)]);
    assert!(velocity.iter().all(|v| v.abs() < 1e-3), "{velocity}");
}

/// Spin about a principal axis goes on; world axes are world axes however the object lies.
#[test]
fn velocities_are_in_world_axes() {
    let mut sim =
        SimulationManager::new(SimulationManagerCfg { ground: None, gravity: [0.0; 3].into(), ..Default::default() })
            .unwrap();
    let ball = RigidObjectCfg { shape: ObjectShape::Sphere { radius: 0.1 }, ..Default::default() };
    let ball = sim.add_rigid_object(ball).unwrap();
    // A quarter turn about x, and a spin about the world's z.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    sim.rigid_object_mut(ball).write_pose(&array![[0.0, 0.0, 1.0, half, half, 0.0, 0.0]], None).unwrap();
    sim.rigid_object_mut(ball).write_velocity(&array![[0.5, 0.0, 0.0, 0.0, 0.0, 2.0]], None).unwrap();
    sim.update(100);
    let (pose, velocity) = (sim.rigid_object(ball).get_pose(), sim.rigid_object(ball).get_velocity());
    assert!((pose[(0, 0)] - 0.5).abs() < 1e-9);
    for (found, expected) in velocity.iter().zip([0.5, 0.0, 0.0, 0.0, 0.0, 2.0]) {
        assert!((found - expected).abs() < 1e-9, "{velocity}");
    }
    // After one second it has turned by 2 rad about z: R = Rz(2) Rx(90°).
    let turned = nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, 2.0)
        * nalgebra::UnitQuaternion::from_euler_angles(std::f64::consts::FRAC_PI_2, 0.0, 0.0);
    let row: Vec<f64> = pose.row(0).to_vec();
    let found = kinetoscope::scene::pose::from_row(&row.try_into().unwrap()).rotation;
    assert!(found.angle_to(&turned) < 1e-9);
}

/// Friction: on a slope (gravity tilted by 20°), tan 20° = 0.364 lies between the two.
#[test]
fn friction_holds_or_does_not() {
    let tilt = 20f64.to_radians();
    let moved = |friction: f64| {
        let mut sim = SimulationManager::new(SimulationManagerCfg {
            gravity: [9.81 * tilt.sin(), 0.0, -9.81 * tilt.cos()].into(),
            friction: [0.0, 0.005, 0.0001],
            ..SimulationManagerCfg::manipulation()
        })
        .unwrap();
        let cfg = RigidObjectCfg {
            shape: ObjectShape::Box { size: [0.2, 0.2, 0.05] },
            friction: Some([friction, 0.005, 0.0001]),
            init_pose: Pose::translation(0.0, 0.0, 0.025),
            ..Default::default()
        };
        let cube = sim.add_rigid_object(cfg).unwrap();
        sim.update(100);
        sim.rigid_object(cube).get_pose()[(0, 0)]
    };
    assert!(moved(0.5) < 0.01, "{}", moved(0.5));
    // x = (sin a - mu cos a) g t² / 2.
    let expected = 9.81 * (tilt.sin() - 0.2 * tilt.cos()) / 2.0;
    assert!((moved(0.2) / expected - 1.0).abs() < 0.05, "{} {expected}", moved(0.2));
}

#[test]
fn static_objects_stand_and_wrong_numbers_are_errors() {
    let mut sim = sim();
    let shelf = RigidObjectCfg {
        uid: "shelf".into(),
        body_type: BodyType::Static,
        shape: ObjectShape::Box { size: [0.3, 0.3, 0.02] },
        init_pose: Pose::translation(0.0, 0.0, 0.5),
        ..Default::default()
    };
    let shelf = sim.add_rigid_object(shelf).unwrap();
    let ball = RigidObjectCfg {
        uid: "ball".into(),
        shape: ObjectShape::Sphere { radius: 0.05 },
        init_pose: Pose::translation(0.0, 0.0, 0.6),
        ..Default::default()
    };
    let ball = sim.add_rigid_object(ball).unwrap();
    sim.update(200);
    assert!((sim.rigid_object(ball).get_pose()[(0, 2)] - 0.56).abs() < 1e-3, "the ball lies on the shelf");
    assert_eq!(sim.rigid_object(shelf).get_pose()[(0, 2)], 0.5);
    let there = array![[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]];
    let still = array![[0.0; 6]];
    let error = sim.rigid_object_mut(shelf).write_velocity(&still, None).unwrap_err().to_string();
    assert!(error.contains("shelf") && error.contains("Dynamic"), "{error}");
    for bad in [array![[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]], array![[f64::NAN, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]]] {
        assert!(sim.rigid_object_mut(ball).write_pose(&bad, None).is_err());
    }
    assert!(sim.rigid_object_mut(ball).write_pose(&array![[0.0; 6]], None).is_err());
    assert!(sim.rigid_object_mut(ball).write_pose(&there, Some(&[EnvId(2)])).is_err());
    let cfg = |uid: &str| RigidObjectCfg { uid: uid.into(), ..Default::default() };
    for cfg in [
        cfg("ball"),
        cfg("world"),
        cfg("a/b"),
        RigidObjectCfg { shape: ObjectShape::cube(0.0), ..cfg("c") },
        RigidObjectCfg { shape: ObjectShape::Sphere { radius: f64::NAN }, ..cfg("c") },
        RigidObjectCfg { mass: Some(-1.0), ..cfg("c") },
        RigidObjectCfg { density: 0.0, ..cfg("c") },
        RigidObjectCfg { friction: Some([-1.0, 0.0, 0.0]), ..cfg("c") },
        RigidObjectCfg { rgba: [2.0, 0.0, 0.0, 1.0], ..cfg("c") },
    ] {
        let shown = format!("{cfg:?}");
        assert!(sim.add_rigid_object(cfg).is_err(), "{shown}");
    }
}

/// The class that an object is given is what the table of mask ids says of it; `object` where it is given none.
#[test]
fn classes_are_those_of_the_configuration() {
    let mut sim = sim();
    let cup = RigidObjectCfg { uid: "cup".into(), semantic_class: Some("dishes".into()), ..Default::default() };
    let (cup, cube) = (sim.add_rigid_object(cup).unwrap(), sim.add_rigid_object(RigidObjectCfg::default()).unwrap());
    let class = |id: i32| sim.mask_ids().iter().find(|entry| entry.id == id).unwrap().class.as_str();
    assert_eq!(class(sim.rigid_object(cup).mask_id()), "dishes");
    assert_eq!(class(sim.rigid_object(cube).mask_id()), "object");
}

//! Entities by name and type, and the errors of a wrong name or type.

use kinetoscope::prelude::*;
use kinetoscope::sensors::camera::Camera;
use kinetoscope::sensors::{ContactSensor, Imu};
use kinetoscope::sim::Error;
use kinetoscope_testkit::worlds::row;

fn cube(x: f64) -> RigidObjectCfg {
    RigidObjectCfg { shape: ObjectShape::cube(0.2), init_pose: Pose::translation(x, 0.0, 0.1), ..Default::default() }
}

fn two_cubes() -> SceneCfg {
    // The sensor is listed before the body that it measures.
    SceneCfg::new(SimulationManagerCfg { num_envs: 3, ..Default::default() })
        .with("touch", ContactSensorCfg::for_bodies("{ENV_REGEX_NS}/zebra"))
        .with("zebra", cube(0.0))
        .with("{ENV}/apple", cube(1.0))
}

#[test]
fn names_in_order() {
    let mut scene = InteractiveScene::new(two_cubes()).unwrap();
    assert_eq!(scene.keys().collect::<Vec<_>>(), ["touch", "zebra", "apple"]);
    assert_eq!(scene.rigid_object("apple").unwrap().uid(), "apple");
    assert_eq!(scene.rigid_object_id("{ENV_REGEX_NS}/apple").unwrap(), scene.rigid_object_id("apple").unwrap());
    assert_eq!(scene.sim().entities().rigid_object_id("zebra").unwrap(), scene.rigid_object_id("zebra").unwrap());
    let pose = row([3.0, 2.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    scene.rigid_object_mut("apple").unwrap().write_pose(&pose, Some(&[EnvId(2)])).unwrap();
    let poses = scene.rigid_object("apple").unwrap().pose();
    assert_eq!((poses.row(2), poses[(1, 0)]), (pose.row(0), 1.0));
    assert!(scene.sensor::<ContactSensor>("touch").is_ok());
}

/// A handle of a sensor of unknown type names the type, and converts to a handle of that type only.
#[test]
fn sensor_handles() {
    use kinetoscope::sim::AnySensorCfg;
    let mut sim = SimulationManager::new(SimulationManagerCfg::default()).unwrap();
    sim.add_rigid_object(RigidObjectCfg { uid: "cube".into(), ..cube(0.0) }).unwrap();
    let kinds: [(&str, Box<dyn AnySensorCfg>); 2] =
        [("ContactSensor", Box::new(ContactSensorCfg::for_bodies("cube"))), ("Imu", Box::new(ImuCfg::on("cube")))];
    let handles = kinds.map(|(name, cfg)| (name, cfg.add_to(&mut sim, name).unwrap()));
    for (name, handle) in &handles {
        assert_eq!(handle.type_name(), *name);
    }
    let imu = handles[1].1.get::<Imu>().unwrap();
    assert_eq!(sim.entities().sensor_ids::<Imu>(), [("Imu".to_string(), imu)]);
    assert!(handles[0].1.get::<Imu>().is_none());
}

#[test]
fn mistakes() {
    let mut scene = InteractiveScene::new(two_cubes()).unwrap();
    for (error, expected) in [
        (scene.robot("zebra").unwrap_err(), "\"zebra\" is a rigid object, not a robot"),
        (scene.rigid_object("touch").unwrap_err(), "\"touch\" is a sensor of type ContactSensor, not a rigid object"),
        (
            scene.sensor::<Camera>("touch").unwrap_err(),
            "\"touch\" is a sensor of type ContactSensor, not a sensor of type Camera",
        ),
        (scene.sensor::<Imu>("apple").unwrap_err(), "\"apple\" is a rigid object, not a sensor of type Imu"),
    ] {
        assert!(matches!(error, Error::EntityType { .. }));
        assert_eq!(error.to_string(), expected);
    }
    assert!(matches!(scene.robot_mut("zebra"), Err(Error::EntityType { .. })));
    assert!(matches!(scene.sensor_mut::<Camera>("touch"), Err(Error::EntityType { .. })));
    let message = scene.rigid_object("zebre").unwrap_err().to_string();
    let start = "unknown scene entity \"zebre\"; known names: \"zebra\", ";
    assert!(message.starts_with(start) && message.contains("apple") && message.contains("touch"), "{message}");
    for cfg in [two_cubes().with("zebra", cube(2.0)), two_cubes().with("{ENV}/touch", cube(2.0))] {
        assert!(matches!(InteractiveScene::new(cfg), Err(Error::DuplicateUid(_))));
    }
    let cfg = SceneCfg::default().with("touch", ContactSensorCfg::for_bodies("{ENV}/cube"));
    let message = InteractiveScene::new(cfg).unwrap_err().to_string();
    assert!(message.contains("\"touch\"") && message.contains("\"cube\""), "{message}");
}

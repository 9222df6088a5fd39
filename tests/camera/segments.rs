//! Segments and boxes of a simulation: ids, classes and frames are those of what was added.

use kinetoscope::prelude::*;
use kinetoscope::sensors::camera::Thing;

fn world() -> (SimulationManager, SensorId<Camera>) {
    let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() }).unwrap();
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    sim.add_robot(RobotCfg { uid: "sr5".into(), urdf, ..Default::default() }).unwrap();
    for (uid, x, class) in [("table", 0.8, None), ("shelf", -0.8, None), ("cup", 0.5, Some("toy".to_string()))] {
        let cfg = RigidObjectCfg {
            uid: uid.into(),
            shape: ObjectShape::Box { size: [0.2, 0.3, 0.4] },
            init_pose: Pose::translation(x, 0.6, 0.2),
            semantic_class: class,
            ..Default::default()
        };
        sim.add_rigid_object(cfg).unwrap();
    }
    let placement = Placement::LookAt { eye: [1.8, 1.8, 1.3], target: [0.0, 0.2, 0.4], up: [0.0, 0.0, 1.0] };
    let camera = CameraCfg {
        width: 160,
        height: 120,
        intrinsics: Intrinsics::Fovy { radians: 1.0 },
        extrinsics: Extrinsics { placement, ..Default::default() },
        channels: Channels { mask: true, position: true, ..Default::default() },
        ..Default::default()
    };
    let id = sim.add_sensor("camera", camera).unwrap();
    (sim, id)
}

#[test]
fn classes_are_those_of_labels_and_of_what_was_added() {
    let (sim, id) = world();
    let names = |cfg: &SegmentationCfg, level| -> Vec<String> {
        sim.segmentation(cfg).unwrap().segments(level).iter().map(|segment| segment.name.clone()).collect()
    };
    let plain = SegmentationCfg::default();
    assert_eq!(names(&plain, SegmentLevel::Instance), ["ground", "sr5", "table", "shelf", "cup"]);
    assert_eq!(names(&plain, SegmentLevel::Semantic), ["ground", "robot", "object", "toy"]);
    let cfg = SegmentationCfg::labeled(&[("table|shelf", "furniture"), ("sr5/link6", "tip")]);
    assert_eq!(names(&cfg, SegmentLevel::Semantic), ["ground", "robot", "tip", "furniture", "toy"]);
    let links = names(&plain, SegmentLevel::Link);
    assert!(links.iter().any(|name| name == "sr5/link6"), "{links:?}");
    // Every mask id is in the table; colours differ where classes do.
    let all = sim.segmentation(&cfg).unwrap();
    let camera = sim.sensor(id).unwrap();
    let mask = camera.mask().unwrap();
    let classes = all.segment(SegmentLevel::Semantic, mask);
    let colors = all.colorize(SegmentLevel::Semantic, mask);
    assert_eq!(colors.dim(), (2, 120, 160, 4));
    for (((env, v, u), &class), &id) in classes.indexed_iter().zip(mask) {
        let entry = sim.mask_ids().iter().find(|entry| entry.id == id);
        let expected = entry.map(|entry| match entry.object.as_str() {
            "table" | "shelf" => "furniture",
            _ if entry.link.as_deref() == Some("link6") => "tip",
            _ => entry.class.as_str(),
        });
        let found = all.segments(SegmentLevel::Semantic).iter().find(|segment| segment.id == class);
        assert_eq!(found.map(|segment| segment.name.as_str()), expected, "{env} {v} {u}");
        assert_eq!(colors[(env, v, u, 3)] == 0, id == 0);
    }
    let error = sim.segmentation(&SegmentationCfg::labeled(&[("tabl", "x")])).unwrap_err().to_string();
    assert!(error.starts_with("labels: there is no object or link \"tabl\"; known are \"table\""), "{error}");
    assert!(Thing::from(&sim.mask_ids()[0]).name() == "ground");
}

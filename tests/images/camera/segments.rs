//! Segmentation and 3D boxes in a simulation: ids, classes and frames agree with its robots and objects.

use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::prelude::*;
use kinetoscope::sensors::camera::{Box3d, Camera, SegmentLevel, SegmentationCfg, SegmentedEntity};
use kinetoscope_testkit::worlds::{cfg, look_at, object, pose_of_row, sr5};
use nalgebra::Point3;

fn world() -> (SimulationManager, RobotId, SensorId<Camera>) {
    let mut sim = kinetoscope_testkit::worlds::sim(cfg(2, 2));
    let robot = sim.add_robot(sr5("sr5")).unwrap();
    for (uid, x, class) in [("table", 0.8, None), ("shelf", -0.8, None), ("cup", 0.5, Some("toy".to_string()))] {
        let cfg = object(uid, ObjectShape::Box { size: [0.2, 0.3, 0.4] }, [x, 0.6, 0.2]);
        sim.add_rigid_object(RigidObjectCfg { semantic_class: class, ..cfg }).unwrap();
    }
    let camera = CameraCfg {
        width: 160,
        height: 120,
        intrinsics: Intrinsics::Fovy { radians: 1.0 },
        extrinsics: look_at([1.8, 1.8, 1.3], [0.0, 0.2, 0.4]),
        channels: Channels { mask: true, position: true, ..Default::default() },
        ..Default::default()
    };
    let id = sim.add_sensor("camera", camera).unwrap();
    (sim, robot, id)
}

/// Classes come from the configuration of an object and from labels.
#[test]
fn classes() {
    let (sim, _, id) = world();
    let names = |cfg: &SegmentationCfg, level| -> Vec<String> {
        sim.scene().segmentation(cfg).unwrap().segments(level).iter().map(|segment| segment.name.clone()).collect()
    };
    let plain = SegmentationCfg::default();
    assert_eq!(names(&plain, SegmentLevel::Instance), ["ground", "sr5", "table", "shelf", "cup"]);
    assert_eq!(names(&plain, SegmentLevel::Semantic), ["ground", "robot", "object", "toy"]);
    let class =
        |object: &str| sim.scene().mask_ids().iter().find(|entry| entry.object == object).unwrap().class.as_str();
    assert_eq!((class("cup"), class("table")), ("toy", "object"));
    let cfg = SegmentationCfg::labeled(&[("table|shelf", "furniture"), ("sr5/link6", "tip")]);
    assert_eq!(names(&cfg, SegmentLevel::Semantic), ["ground", "robot", "tip", "furniture", "toy"]);
    let links = names(&plain, SegmentLevel::Link);
    assert!(links.iter().any(|name| name == "sr5/link6"), "{links:?}");
    // Every mask id is in the table; colors differ between classes.
    let all = sim.scene().segmentation(&cfg).unwrap();
    let mask = sim.sensor(id).unwrap().mask().unwrap();
    let classes = all.segment(SegmentLevel::Semantic, mask);
    let colors = all.colorize(SegmentLevel::Semantic, mask);
    assert_eq!(colors.dim(), (2, 120, 160, 4));
    for (((env, v, u), &class), &id) in classes.indexed_iter().zip(mask) {
        let entry = sim.scene().mask_ids().iter().find(|entry| entry.id == id);
        let expected = entry.map(|entry| match entry.object.as_str() {
            "table" | "shelf" => "furniture",
            _ if entry.link.as_deref() == Some("link6") => "tip",
            _ => entry.class.as_str(),
        });
        let found = all.segments(SegmentLevel::Semantic).iter().find(|segment| segment.id == class);
        assert_eq!(found.map(|segment| segment.name.as_str()), expected, "{env} {v} {u}");
        assert_eq!(colors[(env, v, u, 3)] == 0, id == 0);
    }
    let error = sim.scene().segmentation(&SegmentationCfg::labeled(&[("tabl", "x")])).unwrap_err().to_string();
    assert!(error.starts_with("labels: unknown object or link \"tabl\"; known names: \"table\""), "{error}");
    assert!(SegmentedEntity::from(&sim.scene().mask_ids()[0]).name() == "ground");
}

/// 3D boxes are in the frames of the links: they do not change with the motion of the arm, and contain every visible
/// point of the link.
#[test]
fn boxes() {
    let (mut sim, robot, id) = world();
    let all = sim.scene().segmentation(&SegmentationCfg::default()).unwrap();
    let boxes = |sim: &SimulationManager, env| all.boxes_3d(SegmentLevel::Link, sim.sensor(id).unwrap(), env).unwrap();
    let before = boxes(&sim, 0);
    let angle = |(env, k): (usize, usize)| 0.15 * (k as f64 + 1.0) * (env as f64 + 1.0);
    let turned = Array2::from_shape_fn((2, sim.robot(robot).dof()), angle);
    sim.robot_mut(robot).write_qpos(turned.view(), None, None).unwrap();
    let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-6);
    let mut moved = 0;
    for env in 0..2 {
        let camera = sim.sensor(id).unwrap();
        let (mask, position) = (camera.mask().unwrap(), camera.position().unwrap());
        for found in boxes(&sim, env) {
            let Box3d { id, pose: of_box, min, max } = found;
            let entry = sim.scene().mask_ids().iter().find(|entry| entry.id == id).unwrap();
            let expected = match &entry.link {
                Some(link) => sim.robot(robot).link_pose(link).unwrap(),
                None if entry.object == "ground" => continue,
                None => sim.rigid_object(sim.entities().rigid_object_id(&entry.object).unwrap()).pose(),
            };
            let expected = pose_of_row(&expected, env);
            // Render poses are in single precision.
            let apart = (of_box.translation.vector - expected.translation.vector).norm();
            let angle = of_box.rotation.angle_to(&expected.rotation);
            assert!(apart < 1e-6 && angle < 1e-6, "{entry:?}: {of_box} {expected}");
            let then = before.iter().find(|then| then.id == id).unwrap();
            assert!(near(then.min, min) && near(then.max, max), "{entry:?}");
            moved += usize::from((then.center()[0] - found.center()[0]).abs() > 0.01);
            if entry.link.is_none() {
                assert!(near(max, [0.1, 0.15, 0.2]) && near(min, [-0.1, -0.15, -0.2]));
            }
            for ((v, u), _) in mask.index_axis(Axis(0), env).indexed_iter().filter(|(_, seen)| **seen == id) {
                let p = Point3::from([0, 1, 2].map(|k| f64::from(position[(env, v, u, k)])));
                let local = of_box.inverse() * p;
                // Level of detail moves points by at most 1 mm.
                assert!((0..3).all(|k| local[k] > min[k] - 1.1e-3 && local[k] < max[k] + 1.1e-3), "{entry:?}: {local}");
            }
        }
    }
    assert!(moved > 5, "{moved} boxes of links moved");
    // The box of the whole robot is in the frame of its base.
    let whole = all.boxes_3d(SegmentLevel::Instance, sim.sensor(id).unwrap(), 0).unwrap();
    let ids: Vec<i32> = all.segments(SegmentLevel::Instance).iter().map(|segment| segment.id).collect();
    assert!(whole.iter().map(|found| found.id).eq(ids.iter().copied()));
    assert_eq!((whole[0].min, whole[0].max), ([-50.0, -50.0, 0.0], [50.0, 50.0, 0.0]), "the ground");
    let base = before.iter().find(|found| found.id == ids[1]).unwrap();
    assert!((whole[1].pose.translation.vector - base.pose.translation.vector).norm() < 1e-6);
    assert!(whole[1].size()[2] > base.size()[2] + 0.3, "the arm is higher than its base");
}

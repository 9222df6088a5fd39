//! Placement of cameras, and content of their images, in every environment.

use kinetoscope::ndarray::{Axis, array};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::{from_wxyz, from_xyz_rpy};
use kinetoscope::sensors::camera::CameraConvention;
use kinetoscope::sim::RigidObjectId;
use kinetoscope_testkit::worlds::{cfg, cube, pose_of_row, sr5, urdf_robot};

fn sim(num_envs: usize, threads: usize) -> (SimulationManager, RobotId, RigidObjectId) {
    let mut sim = kinetoscope_testkit::worlds::sim(cfg(num_envs, threads));
    let robot = sim.add_robot(sr5("sr5")).unwrap();
    let cube = sim.add_rigid_object(cube("cube", 0.05, 1.0, [1.2, -0.2, 0.025])).unwrap();
    (sim, robot, cube)
}

/// The camera of the tutorial: above the cube, looking straight down.
fn above() -> CameraCfg {
    let placement = Placement::Pose { pos: [1.2, -0.2, 1.5], rotation: from_wxyz([0.0, 0.0, 1.0, 0.0]) };
    CameraCfg {
        width: 160,
        height: 120,
        intrinsics: Intrinsics::Pixels { fx: 150.0, fy: 150.0, cx: 80.0, cy: 60.0 },
        near: 0.01,
        far: 10.0,
        extrinsics: Extrinsics { placement, ..Default::default() },
        channels: Channels { color: true, depth: true, mask: true, normal: true, ..Channels::NONE },
        ..Default::default()
    }
}

/// A camera on a link renders the same bits as a free camera at the composed pose.
#[test]
fn camera_on_a_link() {
    let (mut sim, robot, _) = sim(1, 1);
    sim.robot_mut(robot).set_qpos_target(&array![[0.1, 0.4, -0.9, 0.2, -0.5, 0.3]], None, None).unwrap();
    let link_from_camera = from_xyz_rpy([0.09, 0.05, 0.04], [2.4, 0.3, -0.2]);
    let (pos, rotation) = (link_from_camera.translation.vector.into(), link_from_camera.rotation);
    let placement = Placement::Pose { pos, rotation };
    let extrinsics = Extrinsics { parent: Some("ee_link".into()), placement, ..Default::default() };
    let on_link = sim.add_sensor("on link", CameraCfg { extrinsics, ..above() }).unwrap();
    let free = sim.add_sensor("free", above()).unwrap();
    sim.update(50);
    let world_from_camera = pose_of_row(&sim.robot(robot).link_pose("ee_link").unwrap(), 0) * link_from_camera;
    sim.sensor_mut(free).unwrap().set_local_pose(&world_from_camera, None, CameraConvention::Ros).unwrap();
    let (a, b) = (sim.sensor(on_link).unwrap(), sim.sensor(free).unwrap());
    let apart = a.pose_w(CameraConvention::Ros) - b.pose_w(CameraConvention::Ros);
    assert!(apart.iter().all(|x| x.abs() < 1e-12), "{apart}");
    assert_eq!(a.depth().unwrap(), b.depth().unwrap());
    assert_eq!(a.color().unwrap(), b.color().unwrap());
    assert!(a.mask().unwrap().iter().any(|&m| m != 0));
}

/// An object moved in one environment moves only in the images of that environment.
#[test]
fn environments() {
    let (mut sim, _, cube) = sim(3, 2);
    let id = sim.add_sensor("camera", above()).unwrap();
    let of_cube = sim.rigid_object(cube).mask_id();
    let before = sim.sensor(id).unwrap().mask().unwrap().to_owned();
    sim.rigid_object_mut(cube).write_pose(&array![[5.0, 5.0, 0.5, 1.0, 0.0, 0.0, 0.0]], Some(&[EnvId(1)])).unwrap();
    // A write refreshes the images at once.
    let mask = sim.sensor(id).unwrap().mask().unwrap().to_owned();
    for env in 0..3 {
        let [mask, before] = [&mask, &before].map(|mask| mask.index_axis(Axis(0), env));
        assert!(before.iter().any(|&m| m == of_cube));
        assert!(if env == 1 { mask.iter().all(|&m| m != of_cube) } else { mask == before }, "environment {env}");
    }
}

/// Fused links keep their own ids, and ids do not change when entities are added.
#[test]
fn mask_ids() {
    let (mut sim, ..) = sim(1, 1);
    let before = sim.scene().mask_ids().to_vec();
    let links = before.iter().filter(|id| id.link.is_some()).count();
    assert!(links >= 6 && before.iter().all(|id| id.id != 0), "{before:?}");
    sim.add_robot(urdf_robot("hand", assets::path("revo1_left/revo1_left.urdf").unwrap())).unwrap();
    let after = sim.scene().mask_ids();
    assert!(after.len() > before.len());
    for id in &before {
        assert!(after.contains(id), "{id:?} is gone or changed");
    }
    let mut ids: Vec<i32> = after.iter().map(|id| id.id).collect();
    ids.dedup();
    assert_eq!(ids.len(), after.len(), "an id is used twice");
}

#[test]
fn refused() {
    let (mut sim, ..) = sim(1, 1);
    let channels = Channels { depth: true, ..Channels::NONE };
    let id = sim.add_sensor("camera", CameraCfg { channels, ..above() }).unwrap();
    let error = sim.sensor(id).unwrap().mask().unwrap_err().to_string();
    assert!(error.contains("mask") && error.contains("depth"), "{error}");
    let nan = array![[f64::NAN, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]];
    assert!(sim.sensor_mut(id).unwrap().set_local_pose(&nan, None, CameraConvention::Ros).is_err());
    assert!(sim.sensor(id).unwrap().depth().is_ok(), "nothing was changed");
}

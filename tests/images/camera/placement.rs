//! Cameras see the right thing from the right place: attached to links, in every environment its own.

use kinetoscope::ndarray::{Axis, array};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::{from_row, from_wxyz, from_xyz_rpy};

const ALL: Channels = Channels { color: true, depth: true, mask: true, normal: true, ..NONE };
const NONE: Channels = Channels::NONE;

fn sim(num_envs: usize, threads: usize) -> (SimulationManager, RobotId, ObjectId) {
    let cfg = SimulationManagerCfg { num_envs, threads: Some(threads), ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    let robot = sim.add_robot(RobotCfg { uid: "sr5".into(), urdf, ..Default::default() }).unwrap();
    let cube = RigidObjectCfg {
        uid: "cube".into(),
        shape: ObjectShape::cube(0.05),
        init_pose: Pose::translation(1.2, -0.2, 0.025),
        ..Default::default()
    };
    let cube = sim.add_rigid_object(cube).unwrap();
    (sim, robot, cube)
}

/// The tutorial's camera, above the cube and looking straight down.
fn above() -> CameraCfg {
    let rotation = from_wxyz([0.0, 0.0, 1.0, 0.0]);
    CameraCfg {
        width: 160,
        height: 120,
        intrinsics: Intrinsics::Pixels { fx: 150.0, fy: 150.0, cx: 80.0, cy: 60.0 },
        near: 0.01,
        far: 10.0,
        extrinsics: Extrinsics { placement: Placement::Pose { pos: [1.2, -0.2, 1.5], rotation }, ..Default::default() },
        channels: ALL,
        ..Default::default()
    }
}

/// The ground is 1.5 m away, the cube's upper face 1.45 m, its picture 150 * 0.05 / 1.45 = 5.17 pixels wide.
#[test]
fn a_cube_seen_from_above_has_its_size_and_distance() {
    let (mut sim, _, cube) = sim(2, 1);
    let id = sim.add_sensor("camera", above()).unwrap();
    let camera = sim.sensor(id).unwrap();
    let (depth, mask, normal) = (camera.depth().unwrap(), camera.mask().unwrap(), camera.normal().unwrap());
    let mask_id = sim.rigid_object(cube).mask_id();
    for env in 0..2 {
        assert!((f64::from(depth[(env, 5, 5)]) - 1.5).abs() < 1e-6);
        // The drop of the first step is not done yet: the cube lies where it was put.
        assert!((f64::from(depth[(env, 60, 80)]) - 1.45).abs() < 1e-6);
        assert_eq!(mask[(env, 60, 80)], mask_id);
        let pixels = mask.index_axis(Axis(0), env).iter().filter(|&&m| m == mask_id).count();
        assert!((20..=36).contains(&pixels), "{pixels} pixels for 5.17 x 5.17");
        assert!((normal[(env, 60, 80, 2)] - 1.0).abs() < 1e-6);
    }
    let ground = sim.mask_ids().iter().find(|id| id.object == "ground").unwrap();
    assert_eq!((ground.id, ground.class.as_str()), (mask[(0, 5, 5)], "ground"));
}

/// A camera on a link is a free camera at the composed pose: the same bits.
#[test]
fn an_attached_camera_is_a_free_one_at_the_composed_pose() {
    let (mut sim, robot, _) = sim(1, 1);
    sim.robot_mut(robot).set_qpos(&array![[0.1, 0.4, -0.9, 0.2, -0.5, 0.3]], None, None).unwrap();
    let link_from_camera = from_xyz_rpy([0.09, 0.05, 0.04], [2.4, 0.3, -0.2]);
    let (pos, rotation) = (link_from_camera.translation.vector.into(), link_from_camera.rotation);
    let attached = CameraCfg {
        extrinsics: Extrinsics {
            parent: Some("ee_link".into()),
            placement: Placement::Pose { pos, rotation },
            ..Default::default()
        },
        ..above()
    };
    let on_link = sim.add_sensor("on link", attached).unwrap();
    let free = sim.add_sensor("free", above()).unwrap();
    sim.update(50);
    let row: Vec<f64> = sim.robot(robot).link_pose("ee_link").unwrap().row(0).to_vec();
    let world_from_link = from_row(&row.try_into().unwrap());
    let pose = world_from_link * link_from_camera;
    sim.sensor_mut(free).unwrap().set_local_pose(&pose, None, CameraConvention::Ros).unwrap();
    let (a, b) = (sim.sensor(on_link).unwrap(), sim.sensor(free).unwrap());
    let far = (a.pose_w(CameraConvention::Ros) - b.pose_w(CameraConvention::Ros))
        .mapv(f64::abs)
        .into_iter()
        .fold(0.0, f64::max);
    assert!(far < 1e-12, "poses {far} apart");
    assert_eq!(a.depth().unwrap(), b.depth().unwrap());
    assert_eq!(a.color().unwrap(), b.color().unwrap());
    assert!(a.mask().unwrap().iter().any(|&m| m != 0));
}

/// Objects moved in one environment are seen there only.
#[test]
fn every_environment_sees_its_own_objects() {
    let (mut sim, _, cube) = sim(3, 2);
    let id = sim.add_sensor("camera", above()).unwrap();
    let mask_id = sim.rigid_object(cube).mask_id();
    let before = sim.sensor(id).unwrap().mask().unwrap().to_owned();
    sim.rigid_object_mut(cube).write_pose(&array![[5.0, 5.0, 0.5, 1.0, 0.0, 0.0, 0.0]], Some(&[EnvId(1)])).unwrap();
    // A write is seen at once: nothing stale.
    let mask = sim.sensor(id).unwrap().mask().unwrap().to_owned();
    for env in [0, 2] {
        assert_eq!(mask.index_axis(Axis(0), env), before.index_axis(Axis(0), env));
    }
    assert!(mask.index_axis(Axis(0), 1).iter().all(|&m| m != mask_id));
    assert!(before.index_axis(Axis(0), 1).iter().any(|&m| m == mask_id));
}

/// The same bits for any number of threads and environments.
#[test]
fn pictures_do_not_depend_on_threads_or_environments() {
    let pictures = |num_envs, threads| {
        let (mut sim, robot, _) = sim(num_envs, threads);
        let id = sim.add_sensor("camera", above()).unwrap();
        sim.robot_mut(robot).set_qpos(&array![[0.0, 0.5, -1.5, 0.3, -0.5, 0.0]], None, None).unwrap();
        sim.update(100);
        let camera = sim.sensor(id).unwrap();
        let color = camera.color().unwrap().index_axis(Axis(0), num_envs - 1).to_owned();
        (color, camera.depth().unwrap().index_axis(Axis(0), num_envs - 1).to_owned())
    };
    let one = pictures(1, 1);
    for (num_envs, threads) in [(1, 2), (3, 2), (5, 3)] {
        assert_eq!(pictures(num_envs, threads), one, "{num_envs} environments, {threads} threads");
    }
}

/// Links that were fused keep ids of their own, and ids stay when more is added.
#[test]
fn ids_are_per_link_and_stay() {
    let (mut sim, ..) = sim(1, 1);
    let before = sim.mask_ids().to_vec();
    let links: Vec<_> = before.iter().filter_map(|id| id.link.as_deref()).collect();
    assert!(links.len() >= 6 && before.iter().all(|id| id.id != 0), "{before:?}");
    let urdf = UrdfCfg::single(assets::path("revo1_left/revo1_left.urdf").unwrap());
    sim.add_robot(RobotCfg { uid: "hand".into(), urdf, ..Default::default() }).unwrap();
    let after = sim.mask_ids();
    assert!(after.len() > before.len());
    for id in &before {
        assert!(after.contains(id), "{id:?} is gone or changed");
    }
    let mut ids: Vec<i32> = after.iter().map(|id| id.id).collect();
    ids.dedup();
    assert_eq!(ids.len(), after.len(), "an id is used twice");
}

#[test]
fn what_is_wrong_is_said() {
    let (mut sim, ..) = sim(1, 1);
    let text = |sim: &mut SimulationManager, cfg: CameraCfg| sim.add_sensor("c", cfg).unwrap_err().to_string();
    let parent = |name: &str| Extrinsics { parent: Some(name.into()), ..Default::default() };
    let error = text(&mut sim, CameraCfg { extrinsics: parent("ee_lnik"), ..above() });
    assert!(error.contains("ee_lnik") && error.contains("sr5/ee_link"), "{error}");
    for cfg in [
        CameraCfg { width: 0, ..above() },
        CameraCfg { height: 100_000, ..above() },
        CameraCfg { near: 2.0, far: 1.0, ..above() },
        CameraCfg { near: f64::NAN, ..above() },
        CameraCfg { intrinsics: Intrinsics::Fovy { radians: f64::INFINITY }, ..above() },
        CameraCfg { update_period: 0.013, ..above() },
        CameraCfg { env_ids: Some(vec![1]), ..above() },
        CameraCfg { channels: NONE, ..above() },
    ] {
        text(&mut sim, cfg);
    }
    let id = sim.add_sensor("camera", CameraCfg { channels: Channels { depth: true, ..NONE }, ..above() }).unwrap();
    let error = sim.sensor(id).unwrap().mask().unwrap_err().to_string();
    assert!(error.contains("mask") && error.contains("depth"), "{error}");
    let nan = array![[f64::NAN, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]];
    assert!(sim.sensor_mut(id).unwrap().set_local_pose(&nan, None, CameraConvention::Ros).is_err());
    assert!(sim.sensor(id).unwrap().depth().is_ok(), "nothing was changed");
}

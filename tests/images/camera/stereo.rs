//! Stereo cameras in a simulation, from a scene file and on a robot.

use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::prelude::*;
use kinetoscope::sensors::camera::{CameraConvention, StereoCamera, StereoCameraCfg};
use kinetoscope::sim::EntityTypes;
use kinetoscope_testkit::worlds::{cfg, pose_of_row, sr5};
use nalgebra::Point3;

const SCENE: &str = r#"
    [entities.eyes]
    type = "stereo_camera"
    left_to_right_pos = [0.1, 0, 0]

    [entities.eyes.camera]
    width = 96
    height = 64
    intrinsics.fovy.radians = 1.2
    channels = ["rgb", "depth", "mask", "position"]
    update_period = 0.01
    extrinsics.placement.look_at = { eye = [1.6, 0.3, 0.8], target = [0.2, 0, 0.5] }

    [entities.ball]
    type = "rigid_object"
    shape.sphere.radius = 0.1
    init_pose = { pos = [0.6, 0.1, 1.2] }
"#;

fn scene() -> InteractiveScene {
    let mut cfg = SceneCfg::from_toml(SCENE, "scene.toml", &EntityTypes::default()).unwrap();
    cfg.simulation.num_envs = 3;
    let mut scene = InteractiveScene::new(cfg).unwrap();
    scene.update(25);
    scene
}

/// Points computed from the disparity, z = fx b / d, agree with the position channel to a few ulps of a meter and of
/// ten meters of depth.
#[test]
fn disparity() {
    let scene = scene();
    let stereo = scene.sensor::<StereoCamera>("eyes").unwrap();
    assert!((stereo.left().stamps()[2] - 0.25).abs() < 1e-12, "{}", stereo.left().stamps());
    let (disparity, position) = (stereo.disparity().unwrap(), stereo.left().position().unwrap());
    let (mask, k) = (stereo.left().mask().unwrap(), stereo.left().intrinsic_matrices());
    let poses = stereo.left().pose_w(CameraConvention::Ros);
    let ball = scene.rigid_object("ball").unwrap();
    let (mut of_ball, mut judged) = (0, 0);
    for env in 0..3 {
        let world_from_camera = pose_of_row(&poses, env);
        let middle = Point3::from(pose_of_row(&ball.pose(), env).translation.vector);
        for ((v, u), &d) in disparity.index_axis(Axis(0), env).indexed_iter() {
            if mask[(env, v, u)] == 0 {
                assert_eq!(d, 0.0);
                continue;
            }
            let z = k[(env, 0, 0)] * 0.1 / f64::from(d);
            let (x, y) = (u as f64 + 0.5 - k[(env, 0, 2)], v as f64 + 0.5 - k[(env, 1, 2)]);
            let point = world_from_camera * Point3::new(x / k[(env, 0, 0)] * z, y / k[(env, 1, 1)] * z, z);
            let seen = Point3::new(0, 1, 2).map(|axis| f64::from(position[(env, v, u, axis)]));
            assert!((point - seen).norm() < 1e-5 * z.max(1.0), "{point} is not {seen}");
            judged += 1;
            if mask[(env, v, u)] == ball.mask_id() {
                assert!(((point - middle).norm() - 0.1).abs() < 1e-5);
                of_ball += 1;
            }
        }
    }
    assert!(judged > 3000 && of_ball > 100, "{judged}, {of_ball} of them of the ball");
}

/// On a robot, both cameras move with the link.
#[test]
fn on_a_link() {
    let mut sim = kinetoscope_testkit::worlds::sim(cfg(2, 2));
    let robot = sim.add_robot(sr5("sr5")).unwrap();
    let extrinsics = Extrinsics { parent: Some("ee_link".into()), ..Default::default() };
    let camera = CameraCfg { width: 32, height: 24, extrinsics, ..Default::default() };
    let cfg = StereoCameraCfg { camera, left_to_right_pos: [0.06, 0.0, 0.0], ..Default::default() };
    let id = sim.add_sensor("stereo", cfg).unwrap();
    let target = Array2::from_shape_fn((2, sim.robot(robot).dof()), |(env, k)| 0.1 * (env + k) as f64);
    sim.robot_mut(robot).set_qpos_target(target.view(), None, None).unwrap();
    sim.update(50);
    let link = sim.robot(robot).link_pose("ee_link").unwrap();
    let stereo = sim.sensor(id).unwrap();
    for (camera, x) in [(stereo.left(), -0.03), (stereo.right(), 0.03)] {
        let poses = camera.pose_w(CameraConvention::Ros);
        for env in 0..2 {
            let (found, expected) =
                (pose_of_row(&poses, env), pose_of_row(&link, env) * Pose::translation(x, 0.0, 0.0));
            let apart = (found.translation.vector - expected.translation.vector).norm();
            assert!(apart < 1e-9 && found.rotation.angle_to(&expected.rotation) < 1e-6, "{found} is not {expected}");
        }
    }
    let error = stereo.disparity().unwrap_err().to_string();
    assert_eq!(error, "the camera does not measure depth; it measures color");
}

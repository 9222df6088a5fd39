//! A pair of eyes in a simulation: from a scene file, and on a robot.

use kinetoscope::ndarray::Axis;
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_row;
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

fn scene(threads: usize) -> InteractiveScene {
    let mut cfg = SceneCfg::from_toml(SCENE, "scene.toml", &EntityTypes::default()).unwrap();
    cfg.simulation.num_envs = 3;
    cfg.simulation.threads = Some(threads);
    let mut scene = InteractiveScene::new(cfg).unwrap();
    scene.update(25);
    scene
}

/// Points that are computed of the disparity, z = fx b / d, are those of the position channel: to some ulps of a metre, and
/// of depths of ten.
#[test]
fn points_of_the_disparity_are_where_things_are() {
    let scene = scene(1);
    let stereo = scene.sensor::<StereoCamera>("eyes").unwrap();
    assert!((stereo.left().stamps()[2] - 0.25).abs() < 1e-12, "{}", stereo.left().stamps());
    let (disparity, position) = (stereo.disparity().unwrap(), stereo.left().position().unwrap());
    let (mask, k) = (stereo.left().mask().unwrap(), stereo.left().intrinsic_matrices());
    let poses = stereo.left().pose_w(CameraConvention::Ros);
    let ball = scene.rigid_object("ball").unwrap();
    let center = ball.get_pose();
    let (mut of_ball, mut judged) = (0, 0);
    for env in 0..3 {
        let pose = from_row(&std::array::from_fn(|i| poses[(env, i)]));
        for ((v, u), &d) in disparity.index_axis(Axis(0), env).indexed_iter() {
            if mask[(env, v, u)] == 0 {
                assert_eq!(d, 0.0);
                continue;
            }
            let z = k[(env, 0, 0)] * 0.1 / f64::from(d);
            let (x, y) = (u as f64 + 0.5 - k[(env, 0, 2)], v as f64 + 0.5 - k[(env, 1, 2)]);
            let point = pose * Point3::new(x / k[(env, 0, 0)] * z, y / k[(env, 1, 1)] * z, z);
            let seen = Point3::new(0, 1, 2).map(|axis| f64::from(position[(env, v, u, axis)]));
            assert!((point - seen).norm() < 1e-5 * z.max(1.0), "{point} is not {seen}");
            judged += 1;
            if mask[(env, v, u)] == ball.mask_id() {
                let middle = Point3::new(center[(env, 0)], center[(env, 1)], center[(env, 2)]);
                assert!(((point - middle).norm() - 0.1).abs() < 1e-5);
                of_ball += 1;
            }
        }
    }
    assert!(judged > 3000 && of_ball > 100, "{judged}, {of_ball} of them of the ball");
}

#[test]
fn threads_change_no_bit() {
    let said = |threads| {
        let scene = scene(threads);
        let stereo = scene.sensor::<StereoCamera>("eyes").unwrap();
        let mut bits: Vec<u32> = stereo.disparity().unwrap().iter().map(|d| d.to_bits()).collect();
        for eye in [stereo.left(), stereo.right()] {
            bits.extend(eye.color().unwrap().iter().map(|&x| u32::from(x)));
            bits.extend(eye.position().unwrap().iter().map(|x| x.to_bits()));
        }
        bits
    };
    let one = said(1);
    assert_eq!(one, said(2));
    assert!(one.iter().any(|bits| *bits != one[0]));
}

#[test]
fn eyes_on_a_robot_move_with_its_link() {
    let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() }).unwrap();
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    let robot = sim.add_robot(RobotCfg { uid: "sr5".into(), urdf, ..Default::default() }).unwrap();
    let extrinsics = Extrinsics { parent: Some("ee_link".into()), ..Default::default() };
    let camera = CameraCfg { width: 32, height: 24, extrinsics, ..Default::default() };
    let cfg = StereoCameraCfg { camera, left_to_right_pos: [0.06, 0.0, 0.0], ..Default::default() };
    let id = sim.add_sensor("stereo", cfg).unwrap();
    let arm = sim.robot(robot).dof();
    let target = kinetoscope::ndarray::Array2::from_shape_fn((2, arm), |(env, k)| 0.1 * (env + k) as f64);
    sim.robot_mut(robot).set_qpos(target.view(), None, None).unwrap();
    sim.update(50);
    let link = sim.robot(robot).link_pose("ee_link").unwrap();
    let stereo = sim.sensor(id).unwrap();
    for (eye, x) in [(stereo.left(), -0.03), (stereo.right(), 0.03)] {
        let poses = eye.pose_w(CameraConvention::Ros);
        for env in 0..2 {
            let link = from_row(&std::array::from_fn(|k| link[(env, k)]));
            let expected = link * Pose::translation(x, 0.0, 0.0);
            let found = from_row(&std::array::from_fn(|k| poses[(env, k)]));
            assert!(
                (found.translation.vector - expected.translation.vector).norm() < 1e-9,
                "{found} is not {expected}"
            );
            assert!(found.rotation.angle_to(&expected.rotation) < 1e-6);
        }
    }
    let error = stereo.disparity().unwrap_err().to_string();
    assert_eq!(error, "the camera does not measure depth; it measures color");
}

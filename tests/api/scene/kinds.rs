//! Entities of every type from a file, including a user-defined sensor.

use crate::sensors::custom::{Speed, SpeedCfg};
use kinetoscope::prelude::*;
use kinetoscope::robot::urdf::{NameCase, NameCaseCfg};
use kinetoscope::sensors::camera::imperfection::{Holes, ReadNoise, ShotNoise, Vignetting};
use kinetoscope::sensors::camera::{CameraConvention, DepthMiss, Imperfections, StereoCameraCfg, StereoOrigin};
use kinetoscope::sensors::ray::pattern::{Bpearl, Custom, Grid, GridOrder, Lidar, Pinhole};
use kinetoscope::sensors::ray::{HitTargets, RayAlignment, RayPattern};
use kinetoscope::sensors::{FrameTransformerCfg, JointStateCfg, JointWrenchCfg, NoiseCfg, TargetFrameCfg};
use kinetoscope::sim::{DcMotor, DelayedPd, DriveModel, DriveType, EntityTypes, Error, Integrator, PerJoint};
use std::path::Path;

fn read(text: &str) -> SceneCfg {
    SceneCfg::from_toml(text, "somewhere/scene.toml", &EntityTypes::default()).unwrap()
}

/// Asserts that a file of these lines declares a sensor `s` of this type with this configuration.
#[track_caller]
fn assert_sensor<C: std::fmt::Debug + PartialEq + 'static>(kind: &str, lines: &str, expected: &C) {
    let scene = read(&format!("[entities.s]\ntype = \"{kind}\"\n{lines}"));
    let [(_, EntityCfg::Sensor(sensor))] = scene.entities.as_slice() else { panic!("{scene:?}") };
    let any: &dyn std::any::Any = sensor.as_ref();
    assert_eq!(any.downcast_ref::<C>(), Some(expected), "{kind}");
}

#[test]
fn presets() {
    assert_eq!(read("").simulation, SimulationManagerCfg::default());
    assert_eq!(read("[simulation]\npreset = \"legged\"").simulation, SimulationManagerCfg::legged());
    let text = "[simulation]\nimpratio = 7\npreset = \"legged\"\nground = false\nlights = []\nintegrator = \"rk4\"\n\
                gravity = [0, 0, -1.62]\nthreads = 1";
    let expected = SimulationManagerCfg {
        impratio: 7.0,
        ground: None,
        lights: Vec::new(),
        integrator: Integrator::Rk4,
        gravity: [0.0, 0.0, -1.62].into(),
        threads: Some(1),
        ..SimulationManagerCfg::legged()
    };
    assert_eq!(read(text).simulation, expected);
}

#[test]
fn robot_of_components() {
    let text = r#"
        [entities.arm]
        type = "robot"
        self_collision = true
        control_parts = { hand = ["finger.*", "thumb"], arm = ["joint[1-6]"] }
        payload = { "ee.*" = 0.5 }
        hull = { max_vertices = 32, min_thickness = false }
        init_pose = { pos = [0, 0, 1], rpy_deg = [0, 0, 90] }

        [entities.arm.drive]
        drive_type = "acceleration"
        model = "actuator"
        stiffness = { "z.*" = 2, arm = 1e3 }
        max_effort = inf
        actuators."f.*".dc_motor.saturation_effort = 120
        actuators.arm.delayed_pd = { delay = 2 }

        [entities.arm.urdf]
        name_case.joint = "upper"
        packages.meshes = "../meshes"
        components = [
            { name = "arm", urdf = "arm.urdf" },
            { name = "hand", urdf = "/abs/hand.urdf", transform = [0, 0, 0.1, 1, 0, 0, 0], prefix = "h_" },
        ]
    "#;
    let scene = read(text);
    let [(name, EntityCfg::Robot(robot))] = scene.entities.as_slice() else { panic!("{scene:?}") };
    assert_eq!((name.as_str(), robot.uid.as_str()), ("arm", "arm"));
    let [arm, hand] = robot.urdf.components.as_slice() else { panic!("{robot:?}") };
    let paths = [arm, hand].map(|part| part.urdf.as_path());
    assert_eq!(paths, ["somewhere/arm.urdf", "/abs/hand.urdf"].map(Path::new));
    assert_eq!((hand.transform, hand.prefix.as_deref()), (Pose::translation(0.0, 0.0, 0.1), Some("h_")));
    assert_eq!(robot.urdf.packages["meshes"], Path::new("somewhere/../meshes"));
    assert_eq!(robot.urdf.name_case, NameCaseCfg { joint: NameCase::Upper, link: NameCase::Original });
    assert_eq!(robot.control_parts[0], ("hand".into(), vec!["finger.*".into(), "thumb".into()]), "the order is kept");
    assert_eq!(robot.drive.stiffness, PerJoint::By(vec![("z.*".into(), 2.0), ("arm".into(), 1e3)]));
    assert_eq!(robot.drive.damping, DriveCfg::default().damping);
    assert_eq!(robot.drive.max_effort, Some(PerJoint::All(f64::INFINITY)));
    assert_eq!((robot.drive.drive_type, robot.drive.model), (DriveType::Acceleration, DriveModel::Actuator));
    let (motor, delayed) = (DcMotor { saturation_effort: 120.0 }.into(), DelayedPd { delay: 2, max_delay: 0 }.into());
    assert_eq!(robot.drive.actuators, [("f.*".to_string(), motor), ("arm".to_string(), delayed)]);
    assert_eq!((robot.hull.max_vertices, robot.hull.min_thickness), (32, None));
    assert!(robot.self_collision && robot.fix_base);
    assert_eq!(robot.payload, [("ee.*".to_string(), 0.5)]);
    let scene = read("[entities.arm]\ntype = \"robot\"\nmjcf = \"odd.xml\"\ndrive.stiffness = 500.0\n");
    let [(_, EntityCfg::Robot(of_mjcf))] = scene.entities.as_slice() else { panic!("{scene:?}") };
    assert_eq!(of_mjcf.mjcf.as_ref().unwrap().path, Path::new("somewhere/odd.xml"));
    let turned = robot.init_pose * nalgebra::Point3::new(1.0, 0.0, 0.0);
    assert!((turned - nalgebra::Point3::new(0.0, 1.0, 1.0)).norm() < 1e-15);
}

#[test]
fn shapes() {
    let brick = ObjectShape::Mesh { path: "somewhere/b.obj".into(), scale: [2.0, 1.0, 1.0], hull: Default::default() };
    for (shape, expected) in [
        ("shape.box.size = [1, 2, 3]", ObjectShape::Box { size: [1.0, 2.0, 3.0] }),
        ("shape.sphere.radius = 0.5", ObjectShape::Sphere { radius: 0.5 }),
        ("shape.cylinder = { radius = 0.5, length = 2 }", ObjectShape::Cylinder { radius: 0.5, length: 2.0 }),
        ("shape = { capsule = { radius = 0.5, length = 2 } }", ObjectShape::Capsule { radius: 0.5, length: 2.0 }),
        ("shape.cone = { radius = 0.1, height = 0.3 }", ObjectShape::Cone { radius: 0.1, height: 0.3 }),
        ("shape.mesh = { path = \"b.obj\", scale = [2, 1, 1] }", brick),
    ] {
        let scene = read(&format!("[entities.o]\ntype = \"rigid_object\"\nbody_type = \"static\"\n{shape}"));
        let [(_, EntityCfg::RigidObject(object))] = scene.entities.as_slice() else { panic!("{scene:?}") };
        let expected =
            RigidObjectCfg { uid: "o".into(), shape: expected, body_type: BodyType::Static, ..Default::default() };
        assert_eq!(**object, expected);
    }
}

#[test]
fn sensors() {
    let sampling = SamplingCfg {
        update_period: 0.01,
        history_length: 3,
        latency_steps: 1,
        dropout: 0.5,
        noise: [("lin_acc_b".to_string(), NoiseCfg { std: 0.1, bias_walk: 0.01, ..Default::default() })].into(),
        ..Default::default()
    };
    assert_sensor(
        "imu",
        "body = \"base\"\ngravity_bias = [0, 0, 0]\n\
         [entities.s.sampling]\nupdate_period = 0.01\nhistory_length = 3\nlatency_steps = 1\ndropout = 0.5\n\
         noise.lin_acc_b = { std = 0.1, bias_walk = 0.01 }",
        &ImuCfg { gravity_bias: Some([0.0; 3].into()), sampling, ..ImuCfg::on("base") },
    );
    let (name, offset) = (Some("tool".into()), Pose::translation(0.0, 0.0, 1.0));
    let tool = TargetFrameCfg { name, offset, ..TargetFrameCfg::for_bodies("tip") };
    assert_sensor(
        "frame_transformer",
        "source = \"base\"\n\
         targets = [{ bodies = \".*_FOOT\" }, { bodies = \"tip\", name = \"tool\", offset = { pos = [0, 0, 1] } }]",
        &FrameTransformerCfg::new("base", vec![TargetFrameCfg::for_bodies(".*_FOOT"), tool]),
    );
    let joints = JointStateCfg { joints: Some(vec!["a".into()]), ..Default::default() };
    assert_sensor("joint_state", "joints = [\"a\"]", &joints);
    let links = JointWrenchCfg { links: vec!["a".into()], ..Default::default() };
    assert_sensor("joint_wrench", "links = [\"a\"]", &links);
    let down = Custom { starts: vec![[0.0; 3]], directions: vec![[0.0, 0.0, -1.0]] };
    let intrinsics = Intrinsics::Fovy { radians: 0.9 };
    let patterns: [(&str, &str, RayPattern); 5] = [
        ("grid.order = \"yx\"", "grid", Grid { order: GridOrder::Yx, ..Default::default() }.into()),
        ("lidar = { channels = 4 }", "lidar", Lidar { channels: 4, ..Default::default() }.into()),
        ("bpearl.horizontal_fov_deg = 90", "bpearl", Bpearl { horizontal_fov_deg: 90.0, ..Default::default() }.into()),
        ("pinhole.intrinsics.fovy.radians = 0.9", "pinhole", Pinhole { intrinsics, ..Default::default() }.into()),
        ("custom = { starts = [[0, 0, 0]], directions = [[0, 0, -1]] }", "custom", down.into()),
    ];
    for (text, name, pattern) in patterns {
        assert_eq!(pattern.name(), name);
        assert!(pattern.rays().is_ok_and(|rays| !rays.is_empty()));
        let expected = RayCasterCfg { pattern, targets: HitTargets::StaticOnly, ..Default::default() };
        assert_sensor("ray_caster", &format!("targets = \"static_only\"\npattern.{text}"), &expected);
    }
    // A variant without fields may be named alone or with an empty table; fields with defaults may be left out.
    let expected =
        RayCasterCfg { alignment: RayAlignment::World, targets: HitTargets::StaticOnly, ..RayCasterCfg::default() };
    let text = "pattern.grid = {}\nalignment = { world = {} }\ntargets = \"static_only\"";
    assert_sensor("ray_caster", text, &expected);
}

#[test]
fn cameras() {
    let expected = CameraCfg {
        intrinsics: Intrinsics::Fovy { radians: 0.9 },
        depth_miss: DepthMiss::Far,
        raster: RasterCfg { samples: 1, ..CameraCfg::default().raster },
        extrinsics: Extrinsics {
            convention: CameraConvention::OpenGl,
            ..kinetoscope_testkit::worlds::look_at([1.0, 0.0, 1.0], [0.0; 3])
        },
        ..Default::default()
    };
    assert_sensor(
        "camera",
        "intrinsics.fovy.radians = 0.9\ndepth_miss = \"far\"\nraster.samples = 1\n\
         extrinsics = { convention = \"opengl\", placement = { look_at = { eye = [1, 0, 1], target = [0, 0, 0] } } }",
        &expected,
    );
    let channels = Channels { color: true, depth: true, ..Default::default() };
    let expected = StereoCameraCfg {
        camera: CameraCfg { width: 320, channels, ..Default::default() },
        intrinsics_right: Some(Intrinsics::Fovy { radians: 0.9 }),
        lens_right: None,
        channels_right: Some(Channels { mask: true, ..Default::default() }),
        imperfections_right: Some(Imperfections { read_noise: Some(ReadNoise { std: 0.01 }), ..Default::default() }),
        noise_right: Some([("rgb".to_string(), NoiseCfg::white(2.0))].into()),
        left_to_right_pos: [0.1, 0.0, 0.0],
        left_to_right_rot: nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, 90f64.to_radians()),
        origin: StereoOrigin::Left,
    };
    assert_sensor(
        "stereo_camera",
        "left_to_right_pos = [0.1, 0, 0]\norigin = \"left\"\n\
         left_to_right_rot = { rpy_deg = [0, 0, 90] }\nintrinsics_right.fovy.radians = 0.9\n\
         channels_right = [\"mask\"]\nimperfections_right.read_noise.std = 0.01\nnoise_right.rgb.std = 2\n\
         [entities.s.camera]\nwidth = 320\nchannels = [\"rgb\", \"depth\"]",
        &expected,
    );
    let depth = ("depth".to_string(), NoiseCfg::white(0.01));
    let rgb = ("rgb".to_string(), NoiseCfg { std: 2.0, resolution: 4.0, ..Default::default() });
    let imperfections = Imperfections {
        vignetting: Some(Vignetting { strength: 0.5 }),
        shot_noise: Some(ShotNoise::default()),
        holes: Some(Holes { baseline: -0.05, ..Default::default() }),
        ..Default::default()
    };
    let noise = [depth, rgb].into();
    let expected =
        CameraCfg { latency_steps: 2, history_length: 3, dropout: 0.1, noise, imperfections, ..Default::default() };
    assert_sensor(
        "camera",
        "latency_steps = 2\nhistory_length = 3\ndropout = 0.1\nnoise.depth.std = 0.01\n\
         noise.rgb = { std = 2, resolution = 4 }\nimperfections.vignetting.strength = 0.5\nimperfections.shot_noise = {}\n\
         imperfections.holes = { baseline = -0.05 }",
        &expected,
    );
}

#[test]
fn user_defined_sensor() {
    let types = EntityTypes::default().with_sensor::<SpeedCfg>("speedometer");
    let text = "[entities.ball]\ntype = \"rigid_object\"\nshape.sphere.radius = 0.1\ninit_pose.pos = [0, 0, 5]\n\
                [entities.speed]\ntype = \"speedometer\"\nbody = \"{ENV}/ball\"\nlevel = 1\n";
    let cfg = SceneCfg::from_toml(text, "scene.toml", &types).unwrap();
    let written = cfg.to_toml(&types).unwrap();
    let scene = InteractiveScene::new(SceneCfg::from_toml(&written, "scene.toml", &types).unwrap()).unwrap();
    let speed = scene.sensor::<Speed>("speed").unwrap();
    assert_eq!(speed.sampler.values("speed").iter().copied().collect::<Vec<_>>(), [-1.0], "it rests");

    let error = SceneCfg::from_toml(&text.replace("level", "levle"), "scene.toml", &types).unwrap_err().to_string();
    assert!(error.starts_with("scene.toml:8: ") && error.contains("`level`"), "{error}");
    let error = cfg.to_toml(&EntityTypes::default()).unwrap_err().to_string();
    assert!(error.contains("speed") && error.contains("with_sensor"), "{error}");
    assert!(SceneCfg::from_toml(text, "scene.toml", &EntityTypes::default()).is_err());
    // The same from a file; without the type, the error lists the registered types.
    let files = tempfile::tempdir().unwrap();
    let path = files.path().join("own.toml");
    std::fs::write(&path, text).unwrap();
    let read = SceneCfg::from_file_with(&path, &types).unwrap();
    assert_eq!(read.to_toml(&types).unwrap(), written);
    let error = SceneCfg::from_file(&path).unwrap_err().to_string();
    assert!(error.contains("own.toml:6") && error.contains("\"speed\"") && error.contains("rigid_object"), "{error}");
    let error = SceneCfg::from_file_with(files.path().join("none.toml"), &types).unwrap_err();
    assert!(matches!(&error, Error::File { path, .. } if path.ends_with("none.toml")), "{error:?}");
}

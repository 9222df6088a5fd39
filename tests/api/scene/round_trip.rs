//! A scene is unchanged by writing and reading.

use super::quadruped::declared;
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::sensors::camera::Imperfections;
use kinetoscope::sensors::ray::RayCasterCameraCfg;
use kinetoscope::sensors::ray::pattern::Lidar;
use kinetoscope::sensors::{FrameTransformerCfg, JointStateCfg, JointWrenchCfg, NoiseCfg, TargetFrameCfg};
use kinetoscope::sim::{DcMotor, DelayedPd, EntityTypes, Error, IdealPd};

pub(crate) const QUADRUPED: &str = r#"# As assets/scenes/quadruped.toml begins.
simulation:
  preset: legged
  num_envs: 2
  ground: {color: [0.1, 0.1, 0.1]}
entities:
  robot:
    type: robot
    urdf: ../quadruped/quadruped.urdf
    fix_base: false
    init_pose:
      pos: [0, 0, .6]
    init_qpos: {.*HAA: 0.0, ".*F_HFE": 0.4, .*H_HFE: -0.4, ".*F_KFE": -0.8, ".*H_KFE": 0.8}
    drive: &soft
      stiffness: 80.0
      damping: 5.0
  contact_forces:
    type: contact_sensor
    bodies: ["{ENV_REGEX_NS}/robot/.*_FOOT"]
    sampling.history_length: 6
"#;

/// Entities of every type, with numbers that need all their digits.
pub(crate) fn every_kind() -> SceneCfg {
    let third = 1.0 / 3.0;
    let noise = NoiseCfg { std: third, bias_std: 1e-300, ..Default::default() };
    let sampling = SamplingCfg { noise: [("lin_acc_b".to_string(), noise)].into(), ..SamplingCfg::every(0.02) };
    let rotation = nalgebra::UnitQuaternion::from_euler_angles(0.1, 0.2, third);
    let offset = Pose::from_parts([third, 0.0, -0.0].into(), rotation);
    let object = RigidObjectCfg {
        init_pose: offset,
        shape: ObjectShape::Capsule { radius: third, length: 0.1 },
        friction: Some([third, 0.0, 0.1]),
        ..Default::default()
    };
    let motors = DriveCfg {
        actuators: vec![
            (".*KFE".into(), DcMotor { saturation_effort: third }.into()),
            (".*HAA".into(), DelayedPd { delay: 2, max_delay: 5 }.into()),
            (".*HFE".into(), IdealPd {}.into()),
        ],
        max_velocity: Some(third.into()),
        ..Default::default()
    };
    let urdf = UrdfCfg::single(assets::path("quadruped/quadruped.urdf").unwrap());
    let second = RobotCfg { urdf, drive: motors, soft_limit_factor: third, ..Default::default() };
    declared()
        .with("second", second)
        .with("object", object)
        .with("imu", ImuCfg { offset, sampling, gravity_bias: Some([0.0, third, 0.0].into()), ..ImuCfg::on("base") })
        .with(
            "frames",
            FrameTransformerCfg::new("base", vec![TargetFrameCfg { offset, ..TargetFrameCfg::for_bodies("object") }]),
        )
        .with("joints", JointStateCfg { joints: Some(vec!["LF.*".into()]), ..Default::default() })
        .with("wrench", JointWrenchCfg { links: vec!["LF_SHANK".into()], ..Default::default() })
        .with("hills", TerrainCfg { heights: array![[third, -0.0], [1e-300, 0.1]], ..Default::default() })
        .with(
            "late camera",
            CameraCfg {
                latency_steps: 3,
                noise: [("depth".to_string(), NoiseCfg::white(third))].into(),
                imperfections: Imperfections { depth_noise: Some(Default::default()), ..Default::default() },
                ..Default::default()
            },
        )
        .with("eye", RayCasterCameraCfg { max_distance: third, ..Default::default() })
        .with(
            "lidar",
            RayCasterCfg {
                pattern: Lidar { horizontal_resolution_deg: third, ..Default::default() }.into(),
                max_distance: f64::INFINITY,
                ..Default::default()
            },
        )
}

fn round_trip(cfg: &SceneCfg) -> SceneCfg {
    let types = EntityTypes::default();
    SceneCfg::from_toml(&cfg.to_toml(&types).unwrap(), "elsewhere/scene.toml", &types).unwrap()
}

/// The `Debug` output contains every number with enough digits to identify it.
#[test]
fn every_field() {
    for cfg in [SceneCfg::default(), declared(), every_kind()] {
        let read = round_trip(&cfg);
        assert_eq!(format!("{read:#?}"), format!("{:#?}", round_trip(&read)));
        assert_eq!(read.simulation, cfg.simulation);
        assert_eq!(read.keys().collect::<Vec<_>>(), cfg.keys().collect::<Vec<_>>());
        for ((name, read), (_, cfg)) in read.entities.iter().zip(&cfg.entities) {
            // The uid is the name, regardless of the written uid.
            let cfg = match cfg.clone() {
                EntityCfg::Robot(robot) => RobotCfg { uid: name.clone(), ..*robot }.into(),
                EntityCfg::RigidObject(object) => RigidObjectCfg { uid: name.clone(), ..*object }.into(),
                EntityCfg::Terrain(terrain) => TerrainCfg { uid: name.clone(), ..*terrain }.into(),
                other => other,
            };
            assert_eq!(format!("{read:#?}"), format!("{cfg:#?}"));
        }
    }
}

#[test]
fn seed_beyond_toml() {
    let cfg = SceneCfg::new(SimulationManagerCfg { seed: u64::MAX, ..Default::default() });
    let message = cfg.to_toml(&EntityTypes::default()).unwrap_err().to_string();
    assert!(message.contains("simulation"), "{message}");
}

/// Writes a TOML value as YAML lines, with tables and lists below their keys.
fn yaml(value: &toml::Value, indent: usize, out: &mut String) {
    use std::fmt::Write as _;
    let space = " ".repeat(indent);
    match value {
        toml::Value::Table(table) if !table.is_empty() => {
            for (key, value) in table {
                write!(out, "\n{space}{key:?}:").unwrap();
                yaml(value, indent + 2, out);
            }
        }
        toml::Value::Array(list) if !list.is_empty() => {
            for value in list {
                write!(out, "\n{space}-").unwrap();
                yaml(value, indent + 2, out);
            }
        }
        toml::Value::Table(_) => out.push_str(" {}"),
        toml::Value::Array(_) => out.push_str(" []"),
        toml::Value::Float(x) if x.is_infinite() => out.push_str(" .inf"),
        toml::Value::Float(x) => write!(out, " {x:?}").unwrap(),
        toml::Value::Integer(x) => write!(out, " {x}").unwrap(),
        toml::Value::Boolean(x) => write!(out, " {x}").unwrap(),
        toml::Value::String(text) => write!(out, " {text:?}").unwrap(),
        toml::Value::Datetime(_) => panic!("no scene has a date"),
    }
}

/// The same scene in YAML is the same scene.
#[test]
fn in_yaml() {
    let types = EntityTypes::default();
    for cfg in [SceneCfg::default(), declared(), every_kind()] {
        let text = cfg.to_toml(&types).unwrap();
        let mut in_yaml = String::new();
        yaml(&toml::Value::Table(text.parse().unwrap()), 0, &mut in_yaml);
        let read =
            SceneCfg::from_yaml(&in_yaml, "elsewhere/scene.yaml", &types).unwrap_or_else(|e| panic!("{e}\n{in_yaml}"));
        let without_places = |cfg: SceneCfg| format!("{:#?}", SceneCfg { sources: Default::default(), ..cfg });
        assert_eq!(without_places(read), without_places(round_trip(&cfg)));
    }
}

#[test]
fn yaml_files() {
    let folder = tempfile::tempdir().unwrap();
    let text =
        QUADRUPED.replace("    sampling.history_length: 6\n", "    sampling:\n      history_length: 6\n").replace(
            "../quadruped/quadruped.urdf",
            &assets::path("quadruped/quadruped.urdf").unwrap().display().to_string(),
        );
    for name in ["scene.yaml", "scene.YML"] {
        let path = folder.path().join(name);
        std::fs::write(&path, &text).unwrap();
        let mut scene = InteractiveScene::from_file(&path).unwrap();
        assert_eq!((scene.num_envs(), scene.sim().cfg().physics_dt), (2, 0.005));
        scene.update(1);
        assert_eq!(scene.robot("robot").unwrap().stiffness()[(0, 0)], 80.0);
    }
    // The same text is not valid TOML.
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, &text).unwrap();
    assert!(matches!(SceneCfg::from_file(&path), Err(Error::SceneFile { .. })));
}

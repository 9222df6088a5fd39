//! Configurations beside scene files: written to TOML and read back, with the names of files.

use kinetoscope::prelude::*;
use kinetoscope::record::{Format, OverviewCfg, RecorderCfg, Topic};
use kinetoscope::scene::mesh::{DaeUpAxis, MeshOptions};
use kinetoscope::scene::terrain::TileCfg;
use kinetoscope::sim::inspect::InspectCfg;
use kinetoscope::sim::{PerJoint, Shard};
use kinetoscope::tasks::terms::{JointPositionsCfg, TerrainLevelsCfg, UniformVelocityCfg};
use kinetoscope::tasks::{AutoresetMode, EnvCfg};
use kinetoscope::viewer::{
    EnvSelection, ImageWindowCfg, OrbitCamera, Overlays, ScreenshotCfg, ServeCfg, Speed, WindowCfg,
};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Debug;

/// Asserts that an empty text is the default, and what `check_complete` does.
#[track_caller]
fn check<C: Debug + Default + PartialEq + Serialize + DeserializeOwned>(text: &str, cfg: &C) {
    assert_eq!(toml::from_str::<C>("").unwrap(), C::default());
    check_complete(text, cfg);
}

/// Asserts that `text` is `cfg`, that both survive a round trip, and that unknown keys are errors.
#[track_caller]
fn check_complete<C: Debug + PartialEq + Serialize + DeserializeOwned>(text: &str, cfg: &C) {
    assert_eq!(&toml::from_str::<C>(text).unwrap(), cfg, "{text}");
    let written = toml::to_string(cfg).unwrap();
    assert_eq!(&toml::from_str::<C>(&written).unwrap(), cfg, "{written}");
    let error = toml::from_str::<C>(&format!("nonsense = 1\n{text}")).unwrap_err().to_string();
    assert!(error.contains("nonsense"), "{error}");
}

#[test]
fn recorder() {
    let text = r#"
        path = "run.npz"
        format = "lerobot"
        topics = ["everything", "engine_states", { joint_states = "arm" }, { channel = { sensor = "eye", channel = "rgb" } }]
        envs = [2, 0]
        stream_periods = { camera = 30, "arm/link_poses" = 2 }
        use_videos = false
        [overview]
        size = [64, 48]
        eye = [1, 2, 3.5]
    "#;
    let cfg = RecorderCfg {
        format: Some(Format::LeRobot),
        topics: vec![
            Topic::Everything,
            Topic::EngineStates,
            Topic::JointStates("arm".into()),
            Topic::channel("eye", "rgb"),
        ],
        envs: Some(vec![EnvId(2), EnvId(0)]),
        stream_periods: vec![("camera".into(), 30), ("arm/link_poses".into(), 2)],
        use_videos: false,
        overview: OverviewCfg { size: [64, 48], eye: Some([1.0, 2.0, 3.5]), ..OverviewCfg::default() },
        ..RecorderCfg::new("run.npz")
    };
    check(text, &cfg);
    for (format, name) in [
        (Format::Mcap, "mcap"),
        (Format::Npz, "npz"),
        (Format::Images, "images"),
        (Format::Gif, "gif"),
        (Format::Mp4, "mp4"),
    ] {
        check(&format!("format = \"{name}\""), &RecorderCfg { format: Some(format), ..RecorderCfg::default() });
    }
}

#[test]
fn tiles() {
    let cfg = TileCfg { size: [8.0, 6.0], cell: 0.1, platform: 1.5, seed: 7 };
    check_complete("size = [8, 6]\ncell = 0.1\nplatform = 1.5\nseed = 7", &cfg);
}

#[test]
fn views() {
    let window = WindowCfg { size: [640, 480], speed: Some(Speed::Factor(0.5)), ..WindowCfg::default() };
    check("size = [640, 480]\nspeed.factor = 0.5", &window);
    check("title = \"depth\"", &ImageWindowCfg { title: "depth".into(), ..ImageWindowCfg::default() });
    let serve = ServeCfg { max_viewers: 2, speed: Some(Speed::Unlimited), ..ServeCfg::default() };
    check("max_viewers = 2\nspeed = \"unlimited\"", &serve);
    check("allow_local_frames = true", &ServeCfg { allow_local_frames: true, ..ServeCfg::default() });
    let camera = Some(OrbitCamera { distance: 5.0, ..OrbitCamera::default() });
    let overlays = Overlays { contacts: true, ..Overlays::default() };
    let shot = ScreenshotCfg { camera, envs: EnvSelection::One(3), overlays, ..ScreenshotCfg::default() };
    check("camera.distance = 5\nenvs.one = 3\noverlays.contacts = true", &shot);
}

#[test]
fn tasks_and_files() {
    let autoreset = AutoresetMode::NextStep;
    let task = EnvCfg { decimation: 4, episode_steps: Some(500), autoreset };
    check("decimation = 4\nepisode_steps = 500\nautoreset = \"next_step\"", &task);
    let qpos = vec![("shoulder".into(), 0.5)];
    check(
        "floating_base = true\nqpos.shoulder = 0.5",
        &InspectCfg { floating_base: true, qpos, ..InspectCfg::default() },
    );
    check("rank = 1\nworld = 4", &Shard { rank: 1, world: 4 });
    check("dae_up_axis = \"apply\"", &MeshOptions { dae_up_axis: DaeUpAxis::Apply });
}

#[test]
fn terms_of_tasks() {
    let scale = PerJoint::from([("wrist.*", 0.25)]);
    check("scale = { \"wrist.*\" = 0.25 }", &JointPositionsCfg { scale, ..JointPositionsCfg::default() });
    let bounds = [-1.0, f64::INFINITY];
    check("scale = 2\nbounds = [-1, inf]", &JointPositionsCfg { scale: PerJoint::All(2.0), bounds });
    let levels = TerrainLevelsCfg { max_initial_level: Some(2), command: Some("walk".into()), episode_seconds: 8.0 };
    check("max_initial_level = 2\ncommand = \"walk\"\nepisode_seconds = 8", &levels);
    let velocity = UniformVelocityCfg { heading: Some([-3.0, 3.0]), ..UniformVelocityCfg::default() };
    check("heading = [-3, 3]", &velocity);
    let once = UniformVelocityCfg { resampling_time: None, ..UniformVelocityCfg::default() };
    check("resampling_time = false", &once);
    for wrong in ["true", "5", "[1, 2, 3]"] {
        let error = toml::from_str::<UniformVelocityCfg>(&format!("resampling_time = {wrong}")).unwrap_err();
        assert!(error.message().contains("expected a range [low, high], or false"), "{wrong}: {error}");
    }
}

//! Films of the stage.

use super::readers::{python, said};
use super::*;
use std::path::Path;

const SIZE: [usize; 2] = [96, 64];

/// Records the stage for 0.3 s, at 20 pictures a second.
fn recorded(path: &Path, topics: Vec<Topic>) -> (Recorded, World) {
    let mut world = World::new(2, 2);
    let stage = StageCfg { size: SIZE, rate: 20.0, ..StageCfg::default() };
    let cfg = RecorderCfg { stage, topics, ..RecorderCfg::new(path) };
    let recorder = world.sim.record(cfg).unwrap();
    (0..30).for_each(|step| world.step(step));
    (world.sim.finish_recording(recorder).unwrap(), world)
}

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn every_animation_shows_the_stage() {
    let python = python();
    let folder = tempfile::tempdir().unwrap();
    for (_, end) in Format::all().filter(|(format, _)| format.is_animation()) {
        let path = folder.path().join(format!("run.{end}"));
        recorded(&path, vec![Topic::Stage]);
        if end == "mp4" {
            // What the script asks of its rate is of smaller pictures.
            assert!(std::fs::metadata(&path).unwrap().len() > 1000);
            continue;
        }
        let frames = said(&python, "read_animation.py", &path)["frames"].as_array().unwrap().clone();
        let times: Vec<u64> = frames.iter().map(|frame| frame["from"].as_u64().unwrap()).collect();
        assert_eq!(times, [0, 50, 100, 150, 200, 250, 300], "{end}");
        assert!(frames.iter().all(|frame| frame["size"] == serde_json::json!(SIZE)), "{end}");
        assert!(frames.windows(2).any(|pair| pair[0]["rgb"] != pair[1]["rgb"]), "{end}: something moves");
    }
}

/// The judge is the rasterizer with cameras' settings, whose camera stands where the stage is looked at from: of one environment, both
/// see the same.
#[test]
fn the_stage_is_what_a_camera_there_sees() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pictures");
    let mut world = World::new(1, 1);
    let (eye, target) = ([1.6, 1.1, 1.2], [0.3, 0.1, 0.3]);
    let placement = Placement::LookAt { eye, target, up: [0.0, 0.0, 1.0] };
    let camera = CameraCfg {
        width: SIZE[0],
        height: SIZE[1],
        intrinsics: Intrinsics::Fovy { radians: std::f64::consts::FRAC_PI_4 },
        extrinsics: Extrinsics { placement, ..Extrinsics::default() },
        near: 0.05,
        far: 500.0,
        raster: RasterCfg { samples: 4, ..RasterCfg::default() },
        channels: Channels { color: true, ..Channels::NONE },
        update_period: 0.05,
        ..CameraCfg::default()
    };
    world.sim.add_sensor("judge", camera).unwrap();
    let stage = StageCfg { size: SIZE, rate: 20.0, eye: Some(eye), target: Some(target) };
    let topics = vec![Topic::Stage, Topic::channel("judge", "color")];
    let recorder = world.sim.record(RecorderCfg { stage, topics, ..RecorderCfg::new(&path) }).unwrap();
    (0..20).for_each(|step| world.step(step));
    world.sim.finish_recording(recorder).unwrap();
    let picture = |of: &str, k: usize| std::fs::read(path.join(format!("{of}/color/env_0/{k:06}.png"))).unwrap();
    for k in 0..4 {
        // The stage is drawn at the beginning too.
        assert!(picture("stage", k + 1) == picture("judge", k), "picture {k}");
    }
    assert!(picture("stage", 1) != picture("stage", 4), "the control: it moves");
}

#[test]
fn without_a_camera_the_stage_is_everything_there_is_to_see() {
    let folder = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() }).unwrap();
    let cube = RigidObjectCfg { uid: "cube".into(), shape: ObjectShape::cube(0.2), ..Default::default() };
    sim.add_rigid_object(cube).unwrap();
    for name in ["run.gif", "pictures"] {
        let recorder = sim.record(RecorderCfg::new(folder.path().join(name))).unwrap();
        sim.update(10);
        assert!(sim.finish_recording(recorder).unwrap().packets > 1, "{name}");
    }
    assert!(folder.path().join("pictures/stage/color/env_0/000000.png").is_file());
    for (stage, wrong) in [
        (StageCfg { rate: 0.0, ..StageCfg::default() }, "rate"),
        (StageCfg { size: [0, 10], ..StageCfg::default() }, "pixels"),
        (StageCfg { eye: Some([1.0; 3]), target: Some([1.0; 3]), ..StageCfg::default() }, "from"),
    ] {
        let cfg = RecorderCfg { stage, ..RecorderCfg::new(folder.path().join("wrong.gif")) };
        let error = sim.record(cfg).unwrap_err();
        assert!(matches!(error, RecordError::Stage { .. }) && error.to_string().contains(wrong), "{error}");
    }
}

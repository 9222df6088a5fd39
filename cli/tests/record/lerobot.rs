//! LeRobot datasets, read by pyarrow, and by LeRobot where it is installed.

use super::readers::{python, said};
use super::support::World;
use kinetoscope::ndarray::Axis;
use kinetoscope::prelude::*;
use kinetoscope::sensors::Sampled;

/// What a frame of an environment is expected to be.
#[derive(Clone, Debug, Default)]
struct Row {
    state: Vec<f32>,
    targets: Vec<f32>,
    cube: Vec<f32>,
    /// Measured last since the environment was reset.
    picture: Option<String>,
    imu: bool,
    joints: bool,
}

impl Row {
    /// Everything that a frame needs.
    fn is_whole(&self) -> bool {
        self.picture.is_some() && self.imu && self.joints
    }
}

fn counts(world: &World, env: usize) -> [u64; 3] {
    [
        world.sim.sensor(world.camera).unwrap().frame_counts()[env],
        world.sim.sensor(world.imu).unwrap().sample_counts()[env],
        world.sim.sensor(world.joints).unwrap().sample_counts()[env],
    ]
}

fn row(world: &World, env: usize, before: &Row, were: &mut [u64; 3]) -> Row {
    let single = |values: Vec<f64>| values.into_iter().map(|x| x as f32).collect();
    let robot = world.sim.robot(world.arm);
    let now = counts(world, env);
    let color = || {
        let camera = world.sim.sensor(world.camera).unwrap();
        let color = camera.color().unwrap().index_axis(Axis(0), env).to_owned();
        color.rows().into_iter().flat_map(|p| [p[0], p[1], p[2]]).map(|byte| format!("{byte:02x}")).collect()
    };
    let row = Row {
        state: single(robot.get_qpos().row(env).to_vec()),
        targets: single(robot.get_target_qpos().row(env).to_vec()),
        cube: single(world.sim.rigid_object(world.cube).get_pose().row(env).to_vec()),
        picture: if now[0] == were[0] { before.picture.clone() } else { Some(color()) },
        imu: before.imu || now[1] != were[1],
        joints: before.joints || now[2] != were[2],
    };
    *were = now;
    row
}

#[test]
fn a_dataset_is_what_happened_and_each_action_is_the_one_that_followed() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.lerobot");
    let mut world = World::new(2, 2);
    let cfg = RecorderCfg { task: "wave at the cube".into(), ..RecorderCfg::new(&path) };
    let recorder = world.sim.record(cfg).unwrap();
    // Rows of each environment, from one reset to the next.
    let mut runs: Vec<(usize, Vec<Row>)> = Vec::new();
    let mut were = [counts(&world, 0), counts(&world, 1)];
    for (env, were) in were.iter_mut().enumerate() {
        runs.push((env, vec![row(&world, env, &Row::default(), were)]));
    }
    for step in 0..30 {
        world.step(step);
        for (env, were) in were.iter_mut().enumerate() {
            let (_, rows) = runs.iter_mut().rev().find(|(of, _)| *of == env).unwrap();
            let next = row(&world, env, rows.last().unwrap(), were);
            rows.push(next);
        }
        if step == 12 {
            world.sim.reset(Some(&[EnvId(1)])).unwrap();
            were[1] = counts(&world, 1);
            runs.push((1, vec![row(&world, 1, &Row::default(), &mut were[1])]));
        }
    }
    assert!(!path.exists(), "it has its name when it is whole");
    let recorded = world.sim.finish_recording(recorder).unwrap();
    assert!(recorded.bytes > 0 && recorded.packets > 30, "{recorded}");
    let found = said(&python, "read_lerobot.py", &path);
    let episodes = found["episodes"].as_array().unwrap();
    assert_eq!(episodes.len(), 3);
    let numbers = |value: &serde_json::Value| -> Vec<f32> {
        let bits = |text: &serde_json::Value| f64::from_bits(text.as_str().unwrap().parse().unwrap()) as f32;
        value.as_array().unwrap().iter().map(bits).collect()
    };
    let mut all = 0;
    for (episode, (_, rows)) in episodes.iter().zip(&runs) {
        // The last row has no action.
        let frames: Vec<[&Row; 2]> =
            rows.windows(2).map(|pair| [&pair[0], &pair[1]]).filter(|[row, _]| row.is_whole()).collect();
        let episode = episode.as_array().unwrap();
        assert!(frames.len() > 5 && frames.len() + 1 < rows.len());
        assert_eq!(episode.len(), frames.len());
        all += frames.len();
        for (frame, [row, next]) in episode.iter().zip(frames) {
            assert_eq!(numbers(&frame["state"]), row.state);
            assert_eq!(numbers(&frame["action"]), next.targets);
            assert_ne!(row.targets, next.targets, "an action that came before would be seen");
            assert_eq!(numbers(&frame["cube"]), row.cube);
            assert_eq!(frame["picture"].as_str(), row.picture.as_deref());
        }
    }
    assert_eq!(found["fps"], 100);
    assert_eq!(found["task"], "wave at the cube");
    let joints: Vec<String> =
        world.sim.robot(world.arm).joint_names().iter().map(|name| format!("arm/{name}")).collect();
    assert_eq!(found["states"], serde_json::json!(joints));
    let features: Vec<&str> = found["features"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    for name in ["action", "observation.effort", "observation.velocity", "sensors.imu.lin_acc_b", "target.effort"] {
        assert!(features.contains(&name), "{features:?}");
    }
    match found["read_by_lerobot"].as_u64() {
        Some(0) => eprintln!("note: not read by LeRobot, which is not installed: it brings some gigabytes"),
        read => assert_eq!(read, Some(all as u64)),
    }
}

#[test]
fn a_dataset_that_is_not_whole_has_not_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.lerobot");
    let part = folder.path().join("run.lerobot.part");
    let mut world = World::new(1, 1);
    let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
    // Nothing was measured: there is no frame.
    let error = world.sim.finish_recording(recorder).unwrap_err();
    assert!(error.to_string().contains("no frame"), "{error}");
    assert!(!path.exists() && part.exists());
    // What was left is neither taken for whole nor thrown away.
    let error = world.sim.record(RecorderCfg::new(&path)).unwrap_err();
    assert!(matches!(error, RecordError::Unfinished { recoverable: false, .. }), "{error}");
    let cfg = RecorderCfg { overwrite: true, ..RecorderCfg::new(&path) };
    let recorder = world.sim.record(cfg.clone()).unwrap();
    assert!(matches!(world.sim.record(cfg), Err(RecordError::Busy { .. })), "two recorders, one dataset");
    (0..20).for_each(|step| world.step(step));
    let recorded = world.sim.finish_recording(recorder).unwrap();
    assert!(path.join("meta/info.json").is_file() && !part.exists() && recorded.bytes > 1000, "{recorded}");
}

/// Found by reading: every dataset has `meta/info.json`, so that somebody else's was taken for a recorder's and replaced.
#[test]
fn a_dataset_of_somebody_else_is_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("theirs.lerobot");
    std::fs::create_dir_all(path.join("meta")).unwrap();
    std::fs::write(path.join("meta/info.json"), "{}").unwrap();
    let cfg = RecorderCfg { overwrite: true, ..RecorderCfg::new(&path) };
    let error = World::new(1, 1).sim.record(cfg).unwrap_err();
    assert!(matches!(error, RecordError::Exists { .. }), "{error}");
    assert_eq!(std::fs::read_to_string(path.join("meta/info.json")).unwrap(), "{}");
}

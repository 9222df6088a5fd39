//! LeRobot datasets, read by pyarrow, and by LeRobot where it is installed.

use super::episodes::Expected;
use super::readers::{python, said};
use super::*;

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn a_dataset_is_what_happened_and_each_action_is_the_one_that_followed() {
    let python = python();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.lerobot");
    let mut world = World::new(2, 2);
    let cfg = RecorderCfg { task: "wave at the cube".into(), ..RecorderCfg::new(&path) };
    let recorder = world.sim.record(cfg).unwrap();
    let mut expected = Expected::new(&world);
    for step in 0..30 {
        world.step(step);
        expected.stepped(&world);
        if step == 12 {
            world.sim.reset(Some(&[EnvId(1)])).unwrap();
            expected.begin(&world, 1);
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
    let single = |values: &[f64]| values.iter().map(|x| *x as f32).collect::<Vec<f32>>();
    let mut all = 0;
    for (episode, (_, frames)) in episodes.iter().zip(expected.episodes()) {
        let episode = episode.as_array().unwrap();
        assert_eq!(episode.len(), frames.len());
        all += frames.len();
        for (frame, [row, next]) in episode.iter().zip(frames) {
            assert_eq!(numbers(&frame["state"]), single(&row.positions));
            assert_eq!(numbers(&frame["action"]), single(&next.targets[0]));
            assert_ne!(row.targets, next.targets, "an action that came before would be seen");
            assert_eq!(numbers(&frame["cube"]), single(&row.cube));
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
    let RecordError::BrokenOff { error, kept, .. } = error else { panic!("{error}") };
    assert!(matches!(&*error, RecordError::NoFrame { path: of, .. } if *of == path), "{error}");
    assert_eq!(kept.as_deref(), Some(&*part));
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

//! LeRobot datasets, read by pyarrow, and by LeRobot where it is installed.

use super::episodes::Expected;
use super::*;

/// Frames of a dataset; each has the action that follows.
#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn frames() {
    let (_folder, path) = scratch("run.lerobot");
    let (world, expected, recorded) = Expected::record(&path, 30, 12);
    assert!(recorded.bytes > 0 && recorded.packets > 30, "{recorded}");
    let found = script_output("read_lerobot.py", &path);
    let episodes = list(&found["episodes"]);
    assert_eq!(episodes.len(), 3);
    let single = |values: &[f64]| values.iter().map(|x| *x as f32).collect::<Vec<f32>>();
    let mut all = 0;
    for (episode, (_, frames)) in episodes.iter().zip(expected.episodes()) {
        assert_eq!(list(episode).len(), frames.len());
        all += frames.len();
        for (frame, [row, next]) in list(episode).iter().zip(frames) {
            let found = |name: &str| single(&numbers(&frame[name]));
            assert_eq!(found("state"), single(&row.positions));
            assert_eq!(found("action"), single(&next.targets[0]));
            assert_ne!(row.targets, next.targets, "an action that came before would be seen");
            assert_eq!(found("cube"), single(&row.cube));
            assert_eq!(frame["picture"].as_str(), row.image.as_deref());
        }
    }
    assert_eq!((&found["fps"], &found["task"]), (&json!(100), &json!("wave at the cube")));
    let joints: Vec<String> =
        world.sim.robot(world.arm).joint_names().iter().map(|name| format!("arm/{name}")).collect();
    assert_eq!(found["states"], json!(joints));
    let features = list(&found["features"]);
    for name in ["action", "observation.effort", "observation.velocity", "sensors.imu.lin_acc_b", "target.effort"] {
        assert!(features.contains(&json!(name)), "{features:?}");
    }
    match found["read_by_lerobot"].as_u64() {
        Some(0) => eprintln!("note: not read by LeRobot, which is not installed: it brings some gigabytes"),
        read => assert_eq!(read, Some(all as u64)),
    }
}

/// A dataset has its name only when it is complete.
#[test]
fn unfinished() {
    let (folder, path) = scratch("run.lerobot");
    let part = folder.path().join("run.lerobot.part");
    let mut world = World::new(1, 1);
    let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
    // Without a measurement, there is no frame.
    let error = world.sim.finish_recording(recorder).unwrap_err();
    let RecordError::Aborted { error, partial_file, .. } = error else { panic!("{error}") };
    assert!(matches!(&*error, RecordError::NoFrame { path: of, .. } if *of == path), "{error}");
    assert_eq!(partial_file.as_deref(), Some(&*part));
    assert!(!path.exists() && part.exists());
    // The partial dataset is neither accepted as complete nor deleted.
    let error = world.sim.record(RecorderCfg::new(&path)).unwrap_err();
    assert!(matches!(error, RecordError::Unfinished { recoverable: false, .. }), "{error}");
    let cfg = overwriting(RecorderCfg::new(&path));
    let recorder = world.sim.record(cfg.clone()).unwrap();
    assert!(matches!(world.sim.record(cfg), Err(RecordError::Busy { .. })), "two recorders, one dataset");
    (0..20).for_each(|step| world.step(step));
    let recorded = world.sim.finish_recording(recorder).unwrap();
    assert!(path.join("meta/info.json").is_file() && !part.exists() && recorded.bytes > 1000, "{recorded}");
}

//! LeRobot datasets, read by pyarrow and by LeRobot.

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
    // Episodes are in the order of their ends: the one that the reset ended, then those at the end of the recording.
    let mut wanted = expected.episodes();
    wanted.swap(0, 1);
    for (episode, (_, frames)) in episodes.iter().zip(wanted) {
        assert_eq!(list(episode).len(), frames.len());
        for (frame, [row, next]) in list(episode).iter().zip(frames) {
            let found = |name: &str| single(&numbers(&frame[name]));
            assert_eq!(found("state"), single(&row.positions));
            assert_eq!(found("velocity"), single(&row.velocities));
            assert_eq!(found("effort"), single(&row.efforts));
            assert_eq!(found("acceleration"), single(row.acceleration.as_ref().unwrap()));
            for (action, target) in list(&frame["actions"]).iter().zip(&next.targets) {
                assert_eq!(single(&numbers(action)), single(target));
            }
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
}

/// LeRobot's own loader reads every frame. The script compares each value with those that pyarrow reads.
#[test]
#[ignore = "needs LeRobot (some gigabytes) in the Python that KINETOSCOPE_PYTHON_READERS names"]
fn own_loader() {
    let (_folder, path) = scratch("run.lerobot");
    let (_, expected, _) = Expected::record(&path, 30, 12);
    let frames: usize = expected.episodes().iter().map(|(_, frames)| frames.len()).sum();
    assert_eq!(script_output("read_lerobot.py", &path)["read_by_lerobot"], json!(frames));
}

/// A dataset has its name only when it is complete.
#[test]
#[cfg_attr(not(feature = "lerobot"), ignore = "needs the feature lerobot")]
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

/// Many episodes are many files, and long episodes are many row groups.
#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn many_episodes() {
    const ENVS: usize = 8;
    const RESETS: usize = 40;
    const STEPS: usize = 1500;
    let (_folder, path) = scratch("run.lerobot");
    let cart = r#"<mujoco><worldbody><body name="cart" pos="0 0 1"><joint name="x" type="slide" axis="1 0 0"/>
        <geom size="0.1" mass="1"/></body></worldbody><actuator><motor joint="x"/></actuator></mujoco>"#;
    let mut sim = simulation(ENVS);
    let cart = sim.add_mjcf(MjcfPartCfg::text("cart", cart)).unwrap();
    // All environments are reset every three steps, then no longer.
    let mut positions: Vec<Vec<f32>> = Vec::new();
    record(&mut sim, RecorderCfg::new(&path), |sim| {
        for step in 0..3 * RESETS + STEPS {
            if step % 3 == 0 && step < 3 * RESETS {
                if step > 0 {
                    sim.reset(None).unwrap();
                }
                positions.extend((0..ENVS).map(|_| Vec::new()));
            }
            let begun = positions.len() - ENVS;
            let q = sim.mjcf_part(cart).qpos();
            positions[begun..].iter_mut().enumerate().for_each(|(env, rows)| rows.push(q[(env, 0)] as f32));
            let force = Array2::from_shape_fn((ENVS, 1), |(env, _)| (env + step) as f64 * 0.01);
            sim.mjcf_part_mut(cart).set_ctrl(&force, None, None).unwrap();
            sim.update(1);
        }
    });
    let found = script_output("read_lerobot.py", &path);
    let episodes = list(&found["episodes"]);
    assert_eq!(episodes.len(), ENVS * RESETS);
    for (k, (episode, rows)) in episodes.iter().zip(&positions).enumerate() {
        let states = list(episode).iter().map(|frame| number(&frame["state"]) as f32);
        assert!(states.eq(rows.iter().copied()), "episode {k}");
    }
    assert_eq!(list(episodes.last().unwrap()).len(), STEPS + 3);
}

#[test]
fn feature() {
    let (folder, path) = scratch("run.lerobot");
    match World::new(1, 1).sim.record(RecorderCfg::new(path)) {
        Ok(_) => assert!(Format::LeRobot.is_built()),
        Err(error) => {
            assert!(matches!(error, RecordError::NotBuilt { feature: "lerobot", .. }), "{error}");
            assert!(!Format::LeRobot.is_built() && error.to_string().contains("--features lerobot"), "{error}");
            assert!(names(&folder).is_empty(), "nothing was begun");
        }
    }
}

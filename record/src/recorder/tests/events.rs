//! Events, notes and rates.

use super::*;
use kinetoscope_mujoco as mj;
use serde_json::json;

/// The lines of `notes.jsonl` of a NumPy archive.
fn notes(path: &Path) -> Vec<serde_json::Value> {
    let text = String::from_utf8(crate::tests::member(path, "notes.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Integers of an array of events.
fn whole(path: &Path, name: &str) -> Vec<i32> {
    let (descr, _, data) = rows(path, &format!("events/{name}"));
    match descr.as_str() {
        "<i4" => data.as_chunks::<4>().0.iter().map(|bytes| i32::from_le_bytes(*bytes)).collect(),
        _ => data.iter().map(|byte| i32::from(*byte)).collect(),
    }
}

/// Notes and resets are recorded with their step and environment, and change no state.
#[test]
fn notes_and_resets() {
    let folder = tempfile::tempdir().unwrap();
    let [npz, mcap, plain] = ["run.npz", "run.mcap", "plain.npz"].map(|name| folder.path().join(name));
    for path in [&npz, &mcap, &plain] {
        let with_notes = path != &plain;
        let mut sim = falling(3);
        let envs = Some(vec![EnvId(0), EnvId(2)]);
        let recorder = sim.record(RecorderCfg { envs, ..RecorderCfg::new(path) }).unwrap();
        sim.update(4);
        if with_notes {
            sim.note(recorder, Some(EnvId(2)), "the ball is \"low\"").unwrap();
            sim.note(recorder, Some(EnvId(1)), "of an environment that is not recorded").unwrap();
        }
        sim.reset(Some(&[EnvId(0)])).unwrap();
        sim.update(2);
        if with_notes {
            sim.note(recorder, None, "over").unwrap();
        }
        let error = sim.note(recorder, Some(EnvId(3)), "where").unwrap_err();
        assert!(matches!(error, RecordError::Env { env: 3, count: 3 }), "{error}");
        sim.finish_recording(recorder).unwrap();
        assert!(sim.note(recorder, None, "too late").is_err());
    }
    assert_eq!(numbers_of(&npz, "events/step"), [4.0, 4.0, 6.0, 6.0]);
    assert_eq!(whole(&npz, "env"), [2, 0, 0, 2]);
    assert_eq!(whole(&npz, "kind"), [3, 0, 3, 3]);
    let found = notes(&npz);
    let found: Vec<_> = found.iter().map(|note| ["event", "env", "text"].map(|field| note[field].clone())).collect();
    let expected = [(0, 2, "the ball is \"low\""), (2, 0, "over"), (3, 2, "over")];
    assert_eq!(found, expected.map(|(event, env, text)| [json!(event), json!(env), json!(text)]));
    let logs = logs(&mcap);
    assert_eq!(logs.len(), 4);
    assert!(logs[0].contains("note at step 4") && logs[0].contains("the ball is \"low\""), "{logs:?}");
    assert_eq!(numbers_of(&npz, "ball/state/positions"), numbers_of(&plain, "ball/state/positions"));
}

#[test]
fn divergence() {
    let (_folder, path) = scratch("run.npz");
    let mut sim = falling(2);
    let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
    let ball = sim.entities().mjcf_id("ball").unwrap();
    let blow_up = |sim: &mut SimulationManager| {
        // MuJoCo warns of speeds above its mjMAXVAL, 1e10, and does not do the step.
        let fast = ndarray::array![[0.0, 0.0, 1e12, 0.0, 0.0, 0.0]];
        sim.mjcf_part_mut(ball).write_qvel(&fast, Some(&[EnvId(1)])).unwrap();
    };
    sim.update(3);
    blow_up(&mut sim);
    sim.update(4);
    assert_eq!(sim.diverged().len(), 1, "{}", mj::version_string());
    sim.reset(Some(&[EnvId(1)])).unwrap();
    sim.update(1);
    blow_up(&mut sim);
    sim.update(2);
    sim.finish_recording(recorder).unwrap();
    let (kinds, envs) = (whole(&path, "kind"), whole(&path, "env"));
    assert_eq!(kinds, [1, 2, 0, 1, 2]);
    assert_eq!(envs, [1; 5]);
    assert_eq!(numbers_of(&path, "events/step"), [3.0, 4.0, 7.0, 8.0, 9.0]);
    let why = notes(&path);
    assert_eq!(why.len(), 2);
    assert!(why.iter().all(|note| note["text"].as_str().unwrap().starts_with("step ")), "{why:?}");
}

#[test]
fn rates() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    let recorded = |rates: &[(&str, u64)], path: &Path| {
        let mut sim = falling(1);
        let every = SamplingCfg::every(2.0 * sim.cfg().physics_dt);
        sim.add_sensor("imu", ImuCfg { sampling: every, ..ImuCfg::on("ball/ball") }).unwrap();
        sim.add_sensor("second", ImuCfg::on("ball/ball")).unwrap();
        let stream_periods = rates.iter().map(|(name, steps)| ((*name).to_string(), *steps)).collect();
        let cfg = RecorderCfg { period_steps: 3, stream_periods, overwrite: true, ..RecorderCfg::new(path) };
        let recorder = sim.record(cfg)?;
        sim.update(20);
        sim.finish_recording(recorder)
    };
    recorded(&[("ball", 8), ("imu", 5)], &path).unwrap();
    assert_eq!(numbers_of(&path, "ball/state/step"), [0.0, 8.0, 16.0]);
    // The sensor measures at even steps. Every fifth step records its last measurement.
    assert_eq!(numbers_of(&path, "imu/step"), [5.0, 10.0, 15.0, 20.0]);
    assert_eq!(numbers_of(&path, "second/step").len(), 20, "the other one as ever");
    let dt = falling(1).cfg().physics_dt;
    let captured: Vec<u64> = numbers_of(&path, "imu/time").iter().map(|time| (time / dt).round() as u64).collect();
    // Steps 4, 10, 14, 20; accelerations are those of the beginning of a step.
    assert_eq!(captured, [3, 9, 13, 19]);
    // Control: without `stream_periods`, `period_steps` applies to states, and sensors are recorded at each measurement.
    recorded(&[], &path).unwrap();
    assert_eq!(numbers_of(&path, "ball/state/step"), [0.0, 3.0, 6.0, 9.0, 12.0, 15.0, 18.0]);
    assert_eq!(numbers_of(&path, "imu/step").len(), 10);
    let error = recorded(&[("ball", 0)], &path).unwrap_err();
    assert!(matches!(error, RecordError::OutOfRange { .. }), "{error}");
    let error = recorded(&[("bal", 2)], &path).unwrap_err();
    let RecordError::UnknownName { candidates, .. } = &error else { panic!("{error}") };
    assert_eq!(candidates, &["ball/state", "ball/body_poses", "imu", "second"]);
    if Format::LeRobot.is_built() {
        let dataset = folder.path().join("run.lerobot");
        let error = recorded(&[("ball", 2)], &dataset).unwrap_err();
        assert!(matches!(error, RecordError::UnsupportedTopic { .. }), "{error}");
    }
}

#[test]
fn events_alone() {
    let (folder, path) = scratch("run.mcap");
    let mut sim = falling(2);
    let recorder = sim.record(RecorderCfg::new(&path).with_topics([Topic::Events])).unwrap();
    sim.update(3);
    sim.reset(None).unwrap();
    sim.note(recorder, Some(EnvId(1)), "again").unwrap();
    sim.finish_recording(recorder).unwrap();
    let logs = logs(&path);
    assert_eq!(logs.len(), 3, "{logs:?}");
    let images = folder.path().join("run.gif");
    let error = sim.record(RecorderCfg::new(images).with_topics([Topic::Events])).unwrap_err();
    assert!(matches!(error, RecordError::UnsupportedTopic { .. }), "{error}");
}

#[test]
fn early_failure() {
    let (_folder, path) = scratch("run.mcap");
    let mut sim = falling(4);
    let cfg = RecorderCfg { scene: false, ..RecorderCfg::new(&path) };
    let recorder = Recorder::start(&mut sim, cfg, &StorageFactory::full_after(20_000)).unwrap();
    let recorder = sim.observers_mut().add(recorder);
    assert_eq!(sim.observers().get(recorder).unwrap().failure(), None);
    let begun = Instant::now();
    let why = loop {
        sim.update(10);
        if let Some(why) = sim.observers().get(recorder).unwrap().failure() {
            break why;
        }
        assert!(begun.elapsed() < Duration::from_secs(20), "no failure was reported");
    };
    assert!(why.contains("run.mcap") && why.contains("no space left on this disk"), "{why}");
    // The final error is the same.
    let error = sim.finish_recording(recorder).unwrap_err().to_string();
    assert!(error.contains("no space left on this disk"), "{error}");
}

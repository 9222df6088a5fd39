//! Recordings that cannot be begun, and their errors.

use super::*;
use kinetoscope_testkit::error_tables::assert_error;
use std::fs;

/// A file name for each format that is a file.
fn files() -> impl Iterator<Item = String> {
    let is_file = |format: &Format| format.is_built() && ![Format::Images, Format::LeRobot].contains(format);
    Format::all().filter(move |(format, _)| is_file(format)).map(|(_, end)| format!("run.{end}"))
}

/// Existing files are kept, or replaced at the end with `overwrite`. A folder of another program is never replaced.
#[test]
fn taken_names() {
    let folder = tempfile::tempdir().unwrap();
    let mut world = World::new(1, 1);
    for name in files() {
        let path = folder.path().join(&name);
        fs::write(&path, "precious").unwrap();
        assert_error(world.sim.record(RecorderCfg::new(&path)), "Exists", &[&name]);
        assert_eq!(fs::read_to_string(&path).unwrap(), "precious");
        let recorder = world.sim.record(overwriting(RecorderCfg::new(&path))).unwrap();
        (0..6).for_each(|step| world.step(step));
        assert_eq!(fs::read_to_string(&path).unwrap(), "precious");
        world.sim.finish_recording(recorder).unwrap();
        assert_ne!(fs::read(&path).unwrap(), b"precious");
    }
    // Found by review: every dataset has `meta/info.json`, so that datasets of other programs were taken for a
    // recorder's and replaced.
    let datasets =
        ["run.lerobot/one", "other.lerobot/meta/info.json"].into_iter().filter(|_| Format::LeRobot.is_built());
    for file in ["images/one"].into_iter().chain(datasets) {
        let file = folder.path().join(file);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(&file, "precious").unwrap();
        let cfg = RecorderCfg::new(file.ancestors().find(|path| path.parent() == Some(folder.path())).unwrap());
        for cfg in [cfg.clone(), overwriting(cfg)] {
            assert_error(world.sim.record(cfg), "Exists", &[]);
        }
        assert_eq!(fs::read_to_string(&file).unwrap(), "precious");
    }
    // The recording of a killed process can be recovered, and is not overwritten.
    let part = folder.path().join("killed.mcap.part");
    fs::write(&part, "precious").unwrap();
    assert_error(world.sim.record(RecorderCfg::new(folder.path().join("killed.mcap"))), "Unfinished", &["recover"]);
    assert_eq!(fs::read_to_string(part).unwrap(), "precious");
}

/// Paths that cannot be written.
#[test]
fn places() {
    let folder = tempfile::tempdir().unwrap();
    let mut world = World::new(1, 1);
    // Not even an administrator can write below a file.
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    let dataset = Format::LeRobot.is_built().then(|| "run.lerobot".to_string());
    for name in files().chain(["images".into()]).chain(dataset) {
        assert_error(world.sim.record(RecorderCfg::new(file.join(&name))), "File", &[&name]);
    }
    for name in files() {
        // Folders of images are created; files need an existing folder.
        let missing = folder.path().join("missing").join(&name);
        assert_error(world.sim.record(RecorderCfg::new(missing)), "File", &[&name]);
        // Root cause: the check that a file may not replace a folder was made when the recording ended.
        let path = folder.path().join(&name);
        fs::create_dir(&path).unwrap();
        assert_error(world.sim.record(overwriting(RecorderCfg::new(&path))), "File", &["this is a folder"]);
        fs::remove_dir(&path).unwrap();
    }
    assert_eq!(names(&folder), ["file"], "nothing was left");
}

/// Errors of wrong names and numbers contain the valid ones.
#[test]
fn configurations() {
    let (folder, path) = scratch("run.mcap");
    let new = |name: &str| RecorderCfg::new(folder.path().join(name));
    let with = |topic| new("run.mcap").with_topics([topic]);
    let run = || RecorderCfg::new(&path);
    let ends = [".avi", ".mcap", ".npz", ".gif", ".mp4", ".lerobot"];
    let rows: [(RecorderCfg, &[&str]); 16] = [
        (with(Topic::JointStates("amr".into())), &["amr", "arm"]),
        (with(Topic::Sensor("camra".into())), &["camra", "camera"]),
        (with(Topic::ObjectPose("cub".into())), &["cub", "cube"]),
        (with(Topic::channel("camera", "dept")), &["camera/dept", "camera/depth"]),
        (with(Topic::channel("camera", "normal")), &["camera/normal", "camera/depth"]),
        (with(Topic::channel("imu", "depth")), &["imu/depth"]),
        (RecorderCfg { period_steps: 0, ..run() }, &["period_steps", "at least 1"]),
        (RecorderCfg { packets: 1, ..run() }, &["packets", "at least 2"]),
        (
            RecorderCfg { period_steps: 3, ..new("run.lerobot") },
            &["run.lerobot", "33.333", "valid values of `period_steps`: 2, 4, 1"],
        ),
        (
            new("run.lerobot").with_topics([Topic::Sensor("imu".into())]),
            &["does not support", "a recording of sensors only"],
        ),
        (RecorderCfg { envs: Some(vec![EnvId(3)]), ..run() }, &["environment 3"]),
        (RecorderCfg { envs: Some(vec![EnvId(0); 2]), ..run() }, &["twice"]),
        (RecorderCfg { topics: vec![], ..run() }, &["nothing to record"]),
        (RecorderCfg { envs: Some(vec![]), ..run() }, &["number of envs is 0", "at least 1"]),
        (new("run.avi"), &ends),
        (new("run.gif").with_topics([Topic::JointStates("arm".into())]), &["does not support", "JointStates"]),
    ];
    let mut world = World::new(1, 1);
    for (cfg, parts) in rows {
        if !Format::LeRobot.is_built() && cfg.path.ends_with("run.lerobot") {
            continue;
        }
        assert_error(world.sim.record(cfg), "", parts);
    }
    for uid in ["/tmp/x", "../x", "..", "a\\b", ""] {
        assert_error(world.sim.add_sensor(uid, JointStateCfg::default()), "", &["not usable"]);
    }
    // Root cause: a topic was looked up by its name alone, so that an IMU called `tf` was written as transforms.
    world.sim.add_sensor("tf", ImuCfg::on("cube")).unwrap();
    assert_error(world.sim.record(run()), "DuplicateName { path", &["\"tf\""]);
    assert!(names(&folder).is_empty(), "nothing was left");
    // Control: arrays of archives have names of their own.
    record_steps(&mut world, new("run.npz"), 0);
}

/// The unreadable remainder of a killed archive is replaced. Two recorders cannot write one file.
#[test]
fn busy_archive() {
    let (folder, path) = scratch("run.npz");
    fs::write(folder.path().join("run.npz.part"), "").unwrap();
    let mut world = World::new(1, 1);
    let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
    assert_error(world.sim.record(overwriting(RecorderCfg::new(&path))), "Busy", &[]);
    world.step(0);
    world.sim.finish_recording(recorder).unwrap();
    assert!(path.exists());
}

/// Recorded entities must not change during a recording. Messages remain in a partial file, and no call blocks forever.
#[test]
fn changed_scene() {
    for (name, keeps) in [("run.npz", false), ("run.mcap", true)] {
        let (_folder, path) = scratch(name);
        let mut world = World::new(1, 1);
        let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
        world.step(0);
        // Another object does not change recorded streams.
        kinetoscope_testkit::worlds::add_ball(&mut world.sim, "ball", [0.0; 3]);
        world.step(1);
        assert!(!world.sim.observers().get(recorder).unwrap().has_failed());
        // A second robot adds joints, which the sensor of all joints now measures.
        world.sim.add_robot(kinetoscope_testkit::worlds::sr5("other")).unwrap();
        world.step(2);
        let observer = world.sim.observers_mut().get_mut(recorder).unwrap();
        assert!(observer.has_failed());
        observer.wait_until_written();
        let error = world.sim.finish_recording(recorder).unwrap_err();
        let RecordError::Aborted { error, write_error, partial_file } = error else { panic!("{error}") };
        assert!(matches!(&*error, RecordError::StreamChanged { stream, .. } if stream == "joints"), "{error}");
        assert!(write_error.is_none() && !path.exists(), "{name}");
        assert_eq!(partial_file, keeps.then(|| path.with_extension("mcap.part")));
        if keeps {
            recover(&path).unwrap();
            let steps = steps_of(&messages(&path), "/env_0/arm/joint_states");
            assert_eq!(steps[..3], [0, 1, 2], "{steps:?}");
        }
    }
}

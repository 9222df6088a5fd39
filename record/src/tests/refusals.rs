//! Recordings that cannot be begun, and what is said.

use super::*;
use std::fs;

fn refusal(cfg: RecorderCfg) -> (RecordError, String) {
    let error = World::new(1, 1).sim.record(cfg).unwrap_err();
    let text = error.to_string();
    (error, text)
}

/// A name for each format that is a file.
fn files() -> impl Iterator<Item = String> {
    let is_file = |format: &Format| format.is_built() && ![Format::Pictures, Format::LeRobot].contains(format);
    Format::all().filter(move |(format, _)| is_file(format)).map(|(_, end)| format!("run.{end}"))
}

#[test]
fn files_that_are_there_stay_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    for name in files() {
        let path = folder.path().join(&name);
        fs::write(&path, "precious").unwrap();
        let (error, text) = refusal(RecorderCfg::new(&path));
        assert!(matches!(error, RecordError::Exists { .. }) && text.contains(&name), "{text}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "precious");
        // Replaced, if it may be, at the end.
        let mut world = World::new(1, 1);
        let recorder = world.sim.record(RecorderCfg { overwrite: true, ..RecorderCfg::new(&path) }).unwrap();
        (0..6).for_each(|step| world.step(step));
        assert_eq!(fs::read_to_string(&path).unwrap(), "precious");
        world.sim.finish_recording(recorder).unwrap();
        assert_ne!(fs::read(&path).unwrap(), b"precious");
    }
    for name in ["pictures", "run.lerobot"] {
        let mine = folder.path().join(name);
        fs::create_dir(&mine).unwrap();
        fs::write(mine.join("one"), "precious").unwrap();
        assert!(matches!(refusal(RecorderCfg::new(&mine)).0, RecordError::Exists { .. }));
        // Whatever is allowed: it is no recorder's.
        let cfg = RecorderCfg { overwrite: true, ..RecorderCfg::new(&mine) };
        assert!(matches!(refusal(cfg).0, RecordError::Exists { .. }));
        assert_eq!(fs::read_to_string(mine.join("one")).unwrap(), "precious");
    }
}

#[test]
fn a_recording_that_was_killed_is_not_written_over() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("run.mcap.part"), "precious").unwrap();
    let (error, text) = refusal(RecorderCfg::new(folder.path().join("run.mcap")));
    assert!(matches!(error, RecordError::Unfinished { .. }) && text.contains("recover"), "{text}");
    assert_eq!(fs::read_to_string(folder.path().join("run.mcap.part")).unwrap(), "precious");
}

#[test]
fn folders_where_nothing_can_be_written_are_an_error_at_the_start() {
    let folder = tempfile::tempdir().unwrap();
    // Not even an administrator writes below a file.
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    for name in files().chain(["pictures".into(), "run.lerobot".into()]) {
        for place in [file.join(&name), folder.path().join("missing").join(&name)] {
            if !files().any(|file| file == name) && place.starts_with(folder.path().join("missing")) {
                continue; // Folders of pictures are made.
            }
            let (error, text) = refusal(RecorderCfg::new(&place));
            assert!(matches!(error, RecordError::File { .. }) && text.contains(&name), "{text}");
        }
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing was left");
}

#[test]
fn wrong_names_and_numbers_are_said_with_what_would_be_right() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let with = |topic| RecorderCfg::new(&path).with_topics([topic]);
    for (cfg, words) in [
        (with(Topic::JointStates("amr".into())), vec!["amr", "arm"]),
        (with(Topic::Sensor("camra".into())), vec!["camra", "camera"]),
        (with(Topic::ObjectPose("cub".into())), vec!["cub", "cube"]),
        (with(Topic::channel("camera", "dept")), vec!["camera/dept", "camera/depth"]),
        (with(Topic::channel("camera", "normal")), vec!["camera/normal", "camera/depth"]),
        (with(Topic::channel("imu", "depth")), vec!["imu/depth"]),
        (RecorderCfg { every: 0, ..RecorderCfg::new(&path) }, vec!["every", "at least 1"]),
        (RecorderCfg { packets: 1, ..RecorderCfg::new(&path) }, vec!["packets", "at least 2"]),
        (
            RecorderCfg { every: 3, ..RecorderCfg::new(folder.path().join("run.lerobot")) },
            vec!["run.lerobot", "33.333", "2, 4, 1 would do"],
        ),
        (
            RecorderCfg::new(folder.path().join("run.lerobot")).with_topics([Topic::Sensor("imu".into())]),
            vec!["no place", "sensors alone"],
        ),
        (RecorderCfg { envs: Some(vec![EnvId(3)]), ..RecorderCfg::new(&path) }, vec!["environment 3"]),
        (RecorderCfg { envs: Some(vec![EnvId(0); 2]), ..RecorderCfg::new(&path) }, vec!["twice"]),
        (RecorderCfg { topics: vec![], ..RecorderCfg::new(&path) }, vec!["nothing to record"]),
        (RecorderCfg { envs: Some(vec![]), ..RecorderCfg::new(&path) }, vec!["number of envs is 0", "at least 1"]),
        (
            RecorderCfg::new(folder.path().join("run.avi")),
            vec![".avi", ".mcap", ".npz", ".apng", ".gif", ".webp", ".mp4", ".lerobot"],
        ),
        (
            RecorderCfg::new(folder.path().join("run.apng")).with_topics([Topic::JointStates("arm".into())]),
            vec!["no place", "JointStates"],
        ),
    ] {
        let (_, text) = refusal(cfg);
        assert!(words.iter().all(|word| text.contains(word)), "{text}: {words:?}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing was left");
}

/// Root cause: whether a folder may be replaced by a file was asked when the recording ended.
#[test]
fn no_file_replaces_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    for name in files() {
        let path = folder.path().join(&name);
        fs::create_dir(&path).unwrap();
        let (error, text) = refusal(RecorderCfg { overwrite: true, ..RecorderCfg::new(&path) });
        assert!(matches!(error, RecordError::File { .. }) && text.contains("this is a folder"), "{text}");
        assert!(path.is_dir());
        fs::remove_dir(&path).unwrap();
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing was left");
}

/// Root cause: a topic was looked for by its name alone, so that an IMU called `tf` was written as transforms.
#[test]
fn two_kinds_of_messages_do_not_share_a_topic() {
    let folder = tempfile::tempdir().unwrap();
    let mut world = World::new(1, 1);
    world.sim.add_sensor("tf", ImuCfg::on("cube")).unwrap();
    let error = world.sim.record(RecorderCfg::new(folder.path().join("run.mcap"))).unwrap_err();
    assert!(matches!(&error, RecordError::SameName { name, .. } if name == "tf"), "{error}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing was left");
    // The control: arrays of archives have names of their own.
    let recorder = world.sim.record(RecorderCfg::new(folder.path().join("run.npz"))).unwrap();
    world.sim.finish_recording(recorder).unwrap();
}

#[test]
fn sensors_have_names_that_stay_in_the_folder() {
    for uid in ["/tmp/x", "../x", "..", "a\\b", ""] {
        let error = World::new(1, 1).sim.add_sensor(uid, JointStateCfg::default()).unwrap_err();
        assert!(error.to_string().contains("not usable"), "{error}");
    }
}

#[test]
fn archives_that_were_killed_are_in_nobodys_way() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    // Before its end, there is nothing in it.
    fs::write(folder.path().join("run.npz.part"), "").unwrap();
    let mut world = World::new(1, 1);
    let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
    // Two recorders, one file.
    let error = world.sim.record(RecorderCfg { overwrite: true, ..RecorderCfg::new(&path) }).unwrap_err();
    assert!(matches!(error, RecordError::Busy { .. }), "{error}");
    world.step(0);
    world.sim.finish_recording(recorder).unwrap();
    assert!(path.exists());
}

#[test]
fn what_is_recorded_must_stay_what_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    let mut world = World::new(1, 1);
    let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
    world.step(0);
    let ball = RigidObjectCfg { uid: "ball".into(), shape: ObjectShape::Sphere { radius: 0.1 }, ..Default::default() };
    // Another object changes nothing of what is recorded.
    world.sim.add_rigid_object(ball).unwrap();
    world.step(1);
    assert!(!world.sim.observer(recorder).unwrap().has_failed());
    // A second robot has joints, which the sensor of all joints now measures.
    world.sim.add_robot(testkit::worlds::sr5("other")).unwrap();
    world.step(2);
    let error = world.sim.finish_recording(recorder).unwrap_err();
    let RecordError::BrokenOff { error, kept: None, .. } = error else { panic!("{error}") };
    assert!(matches!(&*error, RecordError::Changed { stream, .. } if stream == "joints"), "{error}");
}

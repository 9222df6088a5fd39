//! The record button of viewers writes the same files as the recorder.

use kinetoscope::FileRecording;
use kinetoscope::record::{FieldSelector, RecordError, Recorder, RecorderCfg, Recording, RecordingSummary};
use kinetoscope::viewer::{Command, RecordButton, RecordControl as _, SnapshotRequest, Viewer, ViewerExt};
use kinetoscope_testkit::worlds::{RecordedWorld, sr5};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard};

/// A world with a record button, and a viewer that presses the button.
struct WorldWithViewer {
    world: RecordedWorld,
    files: Arc<Mutex<FileRecording>>,
    viewer: Viewer,
    step: u32,
    /// Joint positions by time \[ns\].
    positions: BTreeMap<u64, Vec<f64>>,
}

fn nanos(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

impl WorldWithViewer {
    fn new(path: &Path) -> Self {
        let mut world = RecordedWorld::new(1, 1);
        let files = Arc::new(Mutex::new(FileRecording::new(RecorderCfg::new(path))));
        world.sim.set_record_button(RecordButton::shared(Arc::clone(&files)));
        let viewer = world.sim.viewer(SnapshotRequest { rate: 1000.0, ..SnapshotRequest::default() });
        Self { world, files, viewer, step: 0, positions: BTreeMap::new() }
    }

    fn files(&self) -> MutexGuard<'_, FileRecording> {
        self.files.lock().unwrap()
    }

    fn step(&mut self) {
        self.world.step(self.step);
        self.step += 1;
        let positions = self.world.sim.robot(self.world.arm).qpos().into_iter().collect();
        self.positions.insert(nanos(self.world.sim.time()[0]), positions);
    }

    /// Returns the state of the recording in viewers: true while it runs, and its text.
    fn recording_state(&self) -> (bool, String) {
        let state = self.viewer.newest().unwrap().run.recording.clone().unwrap();
        (state.on, state.text)
    }

    /// Returns the error message of the rejected command.
    fn refused(&self) -> Option<String> {
        self.viewer.newest().unwrap().run.last_refusal.clone()
    }

    /// Steps until the condition is true.
    fn step_until(&mut self, what: &str, is: impl Fn(&Self) -> bool) {
        for _ in 0..20_000 {
            if is(self) {
                return;
            }
            self.step();
        }
        panic!("never: {what}; {:?}, {:?}", self.recording_state(), self.refused());
    }

    fn press(&mut self, on: bool) {
        self.viewer.send(Command::Record(on));
        self.step_until("the button is obeyed", |own| own.recording_state().0 == on);
    }

    /// Ends the recording from the program.
    fn end(&mut self) -> Vec<RecordingSummary> {
        let mut files = self.files.lock().unwrap();
        let recorded = files.finish(&mut self.world.sim).unwrap();
        assert!(files.finish(&mut self.world.sim).unwrap().is_empty(), "a recording is returned once");
        recorded
    }

    /// Checks that every row of a file is the state of the simulation at its time, and that no row is missing.
    fn check(&self, path: &Path, recorded: &RecordingSummary) {
        let recording = Recording::open(path).unwrap();
        let topic = recording.topic("/env_0/arm/joint_states", None).unwrap();
        assert_eq!((recorded.path.as_path(), topic.count), (path, recorded.packets));
        assert!(topic.count > 5, "{topic:?}");
        let robot = self.world.sim.robot(self.world.arm);
        let wanted =
            robot.joint_names().iter().map(|joint| FieldSelector::new(&topic.name, format!("position[{joint}]")));
        for (joint, samples) in recording.time_series(&wanted.collect::<Vec<_>>()).unwrap().iter().enumerate() {
            let times: Vec<u64> = samples.times.iter().map(|time| nanos(*time)).collect();
            // Steps of 10 ms.
            assert!(times.windows(2).all(|pair| pair[1] - pair[0] == 10_000_000), "{times:?}");
            let expected: Vec<f64> = times.iter().map(|time| self.positions[time][joint]).collect();
            assert_eq!(samples.values, expected, "joint {joint}");
            // Control: positions differ between times.
            assert_ne!(expected[0], expected[5], "joint {joint}");
        }
    }
}

#[test]
fn button() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut watched = WorldWithViewer::new(&path);
    watched.step();
    assert_eq!(watched.recording_state(), (false, String::new()));
    for name in ["run.mcap", "run-2.mcap"] {
        watched.press(true);
        assert!(!folder.path().join(name).exists(), "a file has its name when it is whole");
        watched.step_until("rows are counted", |own| {
            let text = own.recording_state().1;
            text.strip_prefix(&format!("{name}: ")).and_then(|t| t.strip_suffix(" rows")).is_some_and(|n| n.len() > 1)
        });
        watched.press(false);
        assert!(
            watched.recording_state().1.starts_with(&format!("{name}: "))
                && watched.recording_state().1.ends_with(" MB")
        );
    }
    let recorded = watched.end();
    assert_eq!(recorded.len(), 2);
    for (recorded, name) in recorded.iter().zip(["run.mcap", "run-2.mcap"]) {
        watched.check(&folder.path().join(name), recorded);
    }
}

#[test]
fn disconnecting_viewer() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut watched = WorldWithViewer::new(&path);
    watched.press(true);
    (0..20).for_each(|_| watched.step());
    // Another viewer stays and receives the end of the recording.
    let gone = std::mem::replace(&mut watched.viewer, watched.world.sim.viewer(SnapshotRequest::default()));
    drop(gone);
    watched.step_until("it ends", |own| !own.recording_state().0);
    let recorded = watched.end();
    watched.check(&path, &recorded[0]);
}

/// The button takes the next free name; a call from the program returns an error.
#[test]
fn taken_names() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    std::fs::write(&path, "precious").unwrap();
    std::fs::write(folder.path().join("run-2.mcap.part"), "left by a killed process").unwrap();
    let mut watched = WorldWithViewer::new(&path);
    let error = watched.files().start(&mut RecordedWorld::new(1, 1).sim).unwrap_err();
    assert!(matches!(error, RecordError::Exists { .. }), "{error}");
    watched.press(true);
    assert!(watched.recording_state().1.starts_with("run-3.mcap: "), "{:?}", watched.recording_state());
    watched.press(false);
    assert!(folder.path().join("run-3.mcap").is_file());
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "precious");
    // A missing folder is reported to the viewer.
    let mut watched = WorldWithViewer::new(&folder.path().join("missing/run.mcap"));
    watched.viewer.send(Command::Record(true));
    watched.step_until("it is refused", |own| own.refused().is_some());
    assert!(watched.refused().unwrap().contains("missing") && !watched.recording_state().0);
}

/// Root cause: a start by the program replaced the handle of the running recording, which was then never finished.
#[test]
fn start_while_recording() {
    let folder = tempfile::tempdir().unwrap();
    let mut world = RecordedWorld::new(1, 1);
    let cfg = RecorderCfg { overwrite: true, ..RecorderCfg::new(folder.path().join("run.mcap")) };
    let mut files = FileRecording::new(cfg);
    files.start(&mut world.sim).unwrap();
    world.step(0);
    files.set(&mut world.sim, false).unwrap();
    // The button records to the next file, and a start would record to the first one again.
    files.set(&mut world.sim, true).unwrap();
    world.step(1);
    files.start(&mut world.sim).unwrap();
    assert_eq!(world.sim.observers().ids::<Recorder>().len(), 1);
    assert!(files.state(&world.sim).text.starts_with("run-2.mcap: "), "{:?}", files.state(&world.sim));
    world.step(2);
    let recorded = files.finish(&mut world.sim).unwrap();
    let paths: Vec<_> = recorded.iter().map(|recorded| recorded.path.file_name().unwrap()).collect();
    assert_eq!(paths, ["run.mcap", "run-2.mcap"]);
    assert!(recorded.iter().all(|recorded| recorded.path.is_file()), "{recorded:?}");
    // Control: without a running recording, the first file is written again.
    files.start(&mut world.sim).unwrap();
    assert!(files.state(&world.sim).text.starts_with("run.mcap: "), "{:?}", files.state(&world.sim));
    world.step(3);
    assert_eq!(files.finish(&mut world.sim).unwrap().len(), 1);
}

/// Regression: the error of a recording that was ended by the button was reported to the viewer only. The program's
/// `finish` did not return the error.
#[test]
fn broken_recording() {
    let folder = tempfile::tempdir().unwrap();
    let mut world = RecordedWorld::new(1, 1);
    let mut files = FileRecording::new(RecorderCfg::new(folder.path().join("run.npz")));
    files.set(&mut world.sim, true).unwrap();
    world.step(0);
    // A second robot adds joints, which the sensor of all joints now measures: the columns of the recording no longer
    // fit.
    world.sim.add_robot(sr5("other")).unwrap();
    world.step(1);
    let reported = files.set(&mut world.sim, false).unwrap_err();
    // A second recording, which succeeds.
    files.set(&mut world.sim, true).unwrap();
    world.step(2);
    let error = files.finish(&mut world.sim).unwrap_err();
    assert!(matches!(error, RecordError::Aborted { .. }) && error.to_string() == reported, "{error}");
    let whole = files.finish(&mut world.sim).unwrap();
    assert_eq!(whole.len(), 1, "{whole:?}");
    assert!(whole[0].path.is_file());
}

/// Every press of the button writes a file of its own, with a number from the second on.
#[test]
fn numbered_files() {
    let folder = tempfile::tempdir().unwrap();
    let mut world = RecordedWorld::new(1, 1);
    for (name, expected) in
        [("run.mcap", ["run.mcap", "run-2.mcap", "run-3.mcap"]), ("a.b.npz", ["a.b.npz", "a.b-2.npz", "a.b-3.npz"])]
    {
        let mut files = FileRecording::new(RecorderCfg::new(folder.path().join(name)));
        for step in 0..3 {
            files.set(&mut world.sim, true).unwrap();
            world.step(step);
            files.set(&mut world.sim, false).unwrap();
        }
        let recorded = files.finish(&mut world.sim).unwrap();
        let names: Vec<_> = recorded.iter().map(|recorded| recorded.path.file_name().unwrap()).collect();
        assert_eq!(names, expected);
    }
}

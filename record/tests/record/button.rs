//! The record button of views writes files, as the recorder does.

use super::support::{World, bytes, contains, messages, of};
use kinetoscope::prelude::*;
use kinetoscope::view::{Command, Viewer, Wants};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard};

/// A world with a button, and somebody who presses it.
struct Watched {
    world: World,
    files: Arc<Mutex<FileRecording>>,
    viewer: Viewer,
    step: u32,
    /// Joint positions at each time \[ns\].
    positions: BTreeMap<u64, Vec<f64>>,
}

impl Watched {
    fn new(path: &Path) -> Self {
        let mut world = World::new(1, 1);
        let files = Arc::new(Mutex::new(FileRecording::new(RecorderCfg::new(path))));
        world.sim.record_button(RecordButton::shared(Arc::clone(&files)));
        let viewer = world.sim.viewer(Wants { rate: 1000.0, ..Wants::default() });
        Self { world, files, viewer, step: 0, positions: BTreeMap::new() }
    }

    fn files(&self) -> MutexGuard<'_, FileRecording> {
        self.files.lock().unwrap()
    }

    fn step(&mut self) {
        self.world.step(self.step);
        self.step += 1;
        let time = (self.world.sim.time()[0] * 1e9).round() as u64;
        self.positions.insert(time, self.world.sim.robot(self.world.arm).get_qpos().into_iter().collect());
    }

    /// How the recording stands, as viewers see it.
    fn seen(&self) -> (bool, String) {
        let state = self.viewer.newest().unwrap().run.recording.clone().unwrap();
        (state.on, state.text)
    }

    /// Steps until viewers see the recording so.
    fn step_until(&mut self, what: &str, is: impl Fn(bool, &str) -> bool) {
        for _ in 0..20_000 {
            let (on, text) = self.seen();
            if is(on, &text) {
                return;
            }
            self.step();
        }
        panic!("never: {what}; {:?}, {:?}", self.seen(), self.viewer.newest().unwrap().run.refused);
    }

    fn press(&mut self, on: bool) {
        self.viewer.send(Command::Record(on));
        self.step_until("the button is obeyed", |is, _| is == on);
    }

    /// Every row of a file is what the simulation was at its time, and none is left out.
    fn check(&self, path: &Path, recorded: &Recorded) {
        let all = messages(path);
        let rows = of(&all, "/env_0/arm/joint_states");
        assert_eq!((recorded.path.as_path(), rows.len() as u64), (path, recorded.packets));
        assert!(rows.len() > 5, "{}", rows.len());
        for pair in rows.windows(2) {
            // Steps of 10 ms.
            assert_eq!(pair[1].time - pair[0].time, 10_000_000);
        }
        for row in &rows {
            let positions = bytes(&self.positions[&row.time]);
            assert!(contains(&row.data, &positions));
        }
        // The control: the positions of another time are not in it.
        assert!(!contains(&rows[0].data, &bytes(&self.positions[&rows[5].time])));
    }
}

#[test]
fn a_button_that_is_pressed_writes_a_file_and_pressed_again_another() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut watched = Watched::new(&path);
    watched.step();
    assert_eq!(watched.seen(), (false, String::new()));
    for name in ["run.mcap", "run-2.mcap"] {
        watched.press(true);
        assert!(!folder.path().join(name).exists(), "it has its name when it is whole");
        watched.step_until("rows are counted", |_, text| {
            text.strip_prefix(&format!("{name}: ")).and_then(|t| t.strip_suffix(" rows")).is_some_and(|n| n.len() > 1)
        });
        watched.press(false);
        assert!(watched.seen().1.starts_with(&format!("{name}: ")) && watched.seen().1.ends_with(" MB"));
    }
    let mut sim = std::mem::replace(&mut watched.world, World::new(1, 1)).sim;
    let recorded = watched.files().end(&mut sim).unwrap();
    assert_eq!(recorded.len(), 2);
    for (recorded, name) in recorded.iter().zip(["run.mcap", "run-2.mcap"]) {
        watched.check(&folder.path().join(name), recorded);
    }
    assert!(watched.files().end(&mut sim).unwrap().is_empty(), "told once");
}

#[test]
fn a_recording_is_whole_when_the_viewer_that_began_it_is_gone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut watched = Watched::new(&path);
    watched.press(true);
    (0..20).for_each(|_| watched.step());
    // Somebody else stays, and sees it end.
    let gone = std::mem::replace(&mut watched.viewer, watched.world.sim.viewer(Wants::default()));
    drop(gone);
    watched.step_until("it ends", |on, _| !on);
    let mut sim = std::mem::replace(&mut watched.world, World::new(1, 1)).sim;
    let recorded = watched.files().end(&mut sim).unwrap();
    watched.check(&path, &recorded[0]);
}

#[test]
fn what_is_there_is_passed_over_by_the_button_and_refused_to_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    std::fs::write(&path, "precious").unwrap();
    std::fs::write(folder.path().join("run-2.mcap.part"), "left by one that was killed").unwrap();
    let mut watched = Watched::new(&path);
    let error = watched.files().begin(&mut World::new(1, 1).sim).unwrap_err();
    assert!(matches!(error, RecordError::Exists { .. }), "{error}");
    watched.press(true);
    assert!(watched.seen().1.starts_with("run-3.mcap: "), "{:?}", watched.seen());
    watched.press(false);
    assert!(folder.path().join("run-3.mcap").is_file());
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "precious");
}

#[test]
fn what_cannot_be_recorded_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let mut watched = Watched::new(&folder.path().join("missing").join("run.mcap"));
    watched.viewer.send(Command::Record(true));
    for _ in 0..20_000 {
        watched.step();
        if watched.viewer.newest().unwrap().run.refused.is_some() {
            break;
        }
    }
    let run = watched.viewer.newest().unwrap().run.clone();
    assert!(run.refused.is_some_and(|reason| reason.contains("missing")) && !run.recording.unwrap().on);
}

/// Root cause: an error of a recording that the button had ended was told to the viewer only, and a program that asked at its end
/// heard that all was well.
#[test]
fn a_recording_that_the_button_ended_badly_is_an_error_at_the_end() {
    use kinetoscope::view::Recording as _;
    let folder = tempfile::tempdir().unwrap();
    let mut world = World::new(1, 1);
    let mut files = FileRecording::new(RecorderCfg::new(folder.path().join("run.npz")));
    files.set(&mut world.sim, true).unwrap();
    world.step(0);
    // A second robot has joints, which the sensor of all joints now measures.
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    world.sim.add_robot(RobotCfg { uid: "other".into(), urdf, ..Default::default() }).unwrap();
    world.step(1);
    let said = files.set(&mut world.sim, false).unwrap_err();
    // Another one, which is well.
    files.set(&mut world.sim, true).unwrap();
    world.step(2);
    let error = files.end(&mut world.sim).unwrap_err();
    assert!(matches!(error, RecordError::BrokenOff { .. }) && error.to_string() == said, "{error}");
    let whole = files.end(&mut world.sim).unwrap();
    assert_eq!(whole.len(), 1, "{whole:?}");
    assert!(whole[0].path.is_file());
}

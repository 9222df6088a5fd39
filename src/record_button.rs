//! The record button of windows and browser views, joined to recordings.

use kinetoscope_record::{Record, RecordError, Recorded, Recorder, RecorderCfg, RecorderId};
use kinetoscope_sim::SimulationManager;
use kinetoscope_viewer::{Recording, RecordingState};
use std::path::{Path, PathBuf};

/// What a record button does in most programs: it records to a file, and to a new one each time it is pressed again.
///
/// One is for one simulation. What is being recorded when the simulation is dropped is broken off: [`end`](Self::end) it
/// before.
///
/// ```no_run
/// use kinetoscope::FileRecording;
/// use kinetoscope::prelude::*;
/// use kinetoscope::record::RecorderCfg;
/// use kinetoscope::viewer::{RecordButton, WindowCfg};
/// use std::sync::{Arc, Mutex, PoisonError};
///
/// let mut sim = SimulationManager::new(SimulationManagerCfg::default())?;
/// let files = Arc::new(Mutex::new(FileRecording::new(RecorderCfg::new("run.mcap"))));
/// let recording = Some(RecordButton::shared(Arc::clone(&files)));
/// let window = sim.open_window_with(WindowCfg { recording, ..WindowCfg::default() })?;
/// while window.is_open() {
///     sim.update(1);
/// }
/// for recorded in files.lock().unwrap_or_else(PoisonError::into_inner).end(&mut sim)? {
///     println!("{recorded}");
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct FileRecording {
    cfg: RecorderCfg,
    /// What records now, and to which file.
    now: Option<(RecorderId, PathBuf)>,
    /// How many files were begun.
    begun: usize,
    done: Vec<Recorded>,
    /// Why the first one was broken off that the button has ended, until [`end`](Self::end) says so.
    failed: Option<RecordError>,
    /// What is said of the last one that ended.
    said: String,
}

impl FileRecording {
    /// Records as `cfg` says. The button never writes over what is there, unless `cfg` lets it: the file of `cfg`, `run.mcap`
    /// say, is followed by `run-2.mcap`, and one that exists is passed over.
    pub fn new(cfg: RecorderCfg) -> Self {
        Self { cfg, now: None, begun: 0, done: Vec::new(), failed: None, said: String::new() }
    }

    /// Begins to record to the very file of the configuration, as a program does that was told to record.
    ///
    /// # Errors
    /// As [`Record::record`].
    pub fn begin(&mut self, sim: &mut SimulationManager) -> kinetoscope_record::Result<()> {
        self.begin_at(sim, self.cfg.path.clone())
    }

    /// Ends what is being recorded, and gives all recordings that ended since this was asked last.
    ///
    /// # Errors
    /// As [`Record::finish_recording`], also of one that the button has ended. Asked again, this gives those that are whole.
    pub fn end(&mut self, sim: &mut SimulationManager) -> kinetoscope_record::Result<Vec<Recorded>> {
        self.finish(sim)?;
        self.failed.take().map_or_else(|| Ok(std::mem::take(&mut self.done)), Err)
    }

    /// Why what is being recorded has stopped, as soon as it is known: a full disk, say. `None` while it goes on, and where nothing
    /// is recorded. [`end`](Self::end) says it too.
    pub fn failure(&self, sim: &SimulationManager) -> Option<String> {
        self.recorder(sim).and_then(|(recorder, _)| recorder.failure())
    }

    fn begin_at(&mut self, sim: &mut SimulationManager, path: PathBuf) -> kinetoscope_record::Result<()> {
        let recorder = sim.record(RecorderCfg { path: path.clone(), ..self.cfg.clone() })?;
        self.begun += 1;
        self.now = Some((recorder, path));
        Ok(())
    }

    fn finish(&mut self, sim: &mut SimulationManager) -> kinetoscope_record::Result<()> {
        let Some((recorder, path)) = self.now.take() else { return Ok(()) };
        if !sim.observers().contains(recorder) {
            // Somebody else has ended it.
            return Ok(());
        }
        let name = name(&path);
        match sim.finish_recording(recorder) {
            Ok(recorded) => {
                self.said = format!("{name}: {:.1} MB", recorded.bytes as f64 / 1e6);
                self.done.push(recorded);
                Ok(())
            }
            Err(error) => {
                self.said = format!("{name}: broken off");
                Err(error)
            }
        }
    }

    /// The recorder that is at work, and its file.
    fn recorder<'a>(&'a self, sim: &'a SimulationManager) -> Option<(&'a Recorder, &'a Path)> {
        let (id, path) = self.now.as_ref()?;
        let recorder = sim.observers().contains(*id).then(|| sim.observers().get(*id).ok()).flatten()?;
        Some((recorder, path.as_path()))
    }

    /// The file of the next recording.
    fn next_path(&self) -> PathBuf {
        let is_there = |path: &Path| path.symlink_metadata().is_ok();
        let free = |path: &PathBuf| self.cfg.overwrite || !(is_there(path) || is_there(&with_end(path, ".part")));
        let mut names = (self.begun + 1..=self.begun + MOST).map(|k| numbered(&self.cfg.path, k));
        // Where all are taken, the recorder says so of the first.
        names.find(free).unwrap_or_else(|| self.cfg.path.clone())
    }
}

/// Names that are tried.
const MOST: usize = 10_000;

impl Recording for FileRecording {
    fn set(&mut self, sim: &mut SimulationManager, on: bool) -> Result<(), String> {
        let said = |error: RecordError| error.to_string();
        match (on, self.recorder(sim).is_some()) {
            (true, false) => {
                let path = self.next_path();
                self.begin_at(sim, path).map_err(said)
            }
            (false, true) => self.finish(sim).map_err(|error| {
                self.failed.get_or_insert_with(|| error.clone());
                said(error)
            }),
            _ => Ok(()),
        }
    }

    fn state(&self, sim: &SimulationManager) -> RecordingState {
        let Some((recorder, path)) = self.recorder(sim) else {
            return RecordingState { on: false, text: self.said.clone() };
        };
        let rows = recorder.so_far().packets;
        let how = recorder.failure().map_or_else(|| format!("{rows} rows"), |why| format!("broken off: {why}"));
        RecordingState { on: true, text: format!("{}: {how}", name(path)) }
    }
}

/// The name of a file without its folder.
fn name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

fn with_end(path: &Path, end: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(end);
    name.into()
}

/// `run.mcap`, `run-2.mcap`, `run-3.mcap`.
fn numbered(path: &Path, number: usize) -> PathBuf {
    let Some(stem) = path.file_stem().filter(|_| number > 1) else { return path.to_path_buf() };
    let mut name = stem.to_owned();
    name.push(format!("-{number}"));
    if let Some(end) = path.extension() {
        name.push(".");
        name.push(end);
    }
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn later_files_have_numbers() {
        let of = |path: &str, k| numbered(Path::new(path), k).display().to_string();
        assert_eq!([1, 2, 13].map(|k| of("a/run.mcap", k)), ["a/run.mcap", "a/run-2.mcap", "a/run-13.mcap"]);
        assert_eq!(of("pictures", 2), "pictures-2");
        assert_eq!(of("..", 2), "..", "what has no name gets none");
    }
}

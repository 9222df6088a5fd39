//! Recordings to files, for the record button of windows and browser views.

use kinetoscope_record::{Record, RecordError, Recorder, RecorderCfg, RecorderId, RecordingSummary};
use kinetoscope_sim::SimulationManager;
use kinetoscope_viewer::{RecordControl, RecordingState};
use std::path::{Path, PathBuf};

/// Recording to files for a record button: each recording that the button starts gets a new file.
///
/// Use one `FileRecording` per simulation. Dropping the simulation aborts the current recording, so call
/// [`finish`](Self::finish) before.
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
/// let record_button = Some(RecordButton::shared(Arc::clone(&files)));
/// let window = sim.open_window_with(WindowCfg { record_button, ..WindowCfg::default() })?;
/// while window.is_open() {
///     sim.update(1);
/// }
/// for recorded in files.lock().unwrap_or_else(PoisonError::into_inner).finish(&mut sim)? {
///     println!("{recorded}");
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct FileRecording {
    cfg: RecorderCfg,
    /// Recorder and file of the current recording.
    current: Option<(RecorderId, PathBuf)>,
    /// Number of files that were started.
    started: usize,
    finished: Vec<RecordingSummary>,
    /// First error of a recording that the button ended, until [`finish`](Self::finish) returns it.
    failed: Option<RecordError>,
    /// Status text of the last recording that ended.
    status: String,
}

impl FileRecording {
    /// Creates a recording with the settings of `cfg`.
    ///
    /// The button never overwrites an existing file unless `cfg` allows it. After the file of `cfg`, for example
    /// `run.mcap`, it writes `run-2.mcap` and so on, and skips existing files.
    pub fn new(cfg: RecorderCfg) -> Self {
        Self { cfg, current: None, started: 0, finished: Vec::new(), failed: None, status: String::new() }
    }

    /// Starts a recording to exactly the file of the configuration, for programs that record without a button; an
    /// existing file is an error unless the configuration allows overwriting. Does nothing while a recording is
    /// running, like the button.
    ///
    /// # Errors
    /// As [`Record::record`].
    pub fn start(&mut self, sim: &mut SimulationManager) -> kinetoscope_record::Result<()> {
        if self.recorder(sim).is_some() {
            return Ok(());
        }
        self.start_at(sim, self.cfg.path.clone())
    }

    /// Ends the current recording, and returns all recordings that this value or its button has ended since the last
    /// call.
    ///
    /// # Errors
    /// As [`Record::finish_recording`], also for a recording that the button ended. A later call returns the complete
    /// recordings.
    pub fn finish(&mut self, sim: &mut SimulationManager) -> kinetoscope_record::Result<Vec<RecordingSummary>> {
        self.finish_current(sim)?;
        self.failed.take().map_or_else(|| Ok(std::mem::take(&mut self.finished)), Err)
    }

    /// Reason why the current recording has stopped, for example a full disk, as soon as it is known.
    ///
    /// Returns `None` while the recording continues, and without a recording. [`finish`](Self::finish) returns the error too.
    pub fn failure(&self, sim: &SimulationManager) -> Option<String> {
        self.recorder(sim).and_then(|(recorder, _)| recorder.failure())
    }

    fn start_at(&mut self, sim: &mut SimulationManager, path: PathBuf) -> kinetoscope_record::Result<()> {
        let recorder = sim.record(RecorderCfg { path: path.clone(), ..self.cfg.clone() })?;
        self.started += 1;
        self.current = Some((recorder, path));
        Ok(())
    }

    fn finish_current(&mut self, sim: &mut SimulationManager) -> kinetoscope_record::Result<()> {
        let Some((recorder, path)) = self.current.take() else { return Ok(()) };
        if !sim.observers().contains(recorder) {
            // The recorder was ended elsewhere.
            return Ok(());
        }
        let name = name(&path);
        match sim.finish_recording(recorder) {
            Ok(recorded) => {
                self.status = format!("{name}: {:.1} MB", recorded.bytes as f64 / 1e6);
                self.finished.push(recorded);
                Ok(())
            }
            Err(error) => {
                self.status = format!("{name}: aborted");
                Err(error)
            }
        }
    }

    /// Recorder of the current recording, and its file.
    fn recorder<'a>(&'a self, sim: &'a SimulationManager) -> Option<(&'a Recorder, &'a Path)> {
        let (id, path) = self.current.as_ref()?;
        let recorder = sim.observers().contains(*id).then(|| sim.observers().get(*id).ok()).flatten()?;
        Some((recorder, path.as_path()))
    }

    /// File of the next recording.
    fn next_path(&self) -> PathBuf {
        let is_there = |path: &Path| path.symlink_metadata().is_ok();
        let free = |path: &PathBuf| self.cfg.overwrite || !(is_there(path) || is_there(&with_suffix(path, ".part")));
        let mut names = (self.started + 1..=self.started + MAX_NAMES).map(|k| numbered(&self.cfg.path, k));
        // If all names are taken, the recorder reports an error for the first one.
        names.find(free).unwrap_or_else(|| self.cfg.path.clone())
    }
}

/// Largest number of names that are tried.
const MAX_NAMES: usize = 10_000;

impl RecordControl for FileRecording {
    fn set(&mut self, sim: &mut SimulationManager, on: bool) -> Result<(), String> {
        let message = |error: RecordError| error.to_string();
        match (on, self.recorder(sim).is_some()) {
            (true, false) => {
                let path = self.next_path();
                self.start_at(sim, path).map_err(message)
            }
            (false, true) => self.finish_current(sim).map_err(|error| {
                self.failed.get_or_insert_with(|| error.clone());
                message(error)
            }),
            _ => Ok(()),
        }
    }

    fn state(&self, sim: &SimulationManager) -> RecordingState {
        let Some((recorder, path)) = self.recorder(sim) else {
            return RecordingState { on: false, text: self.status.clone() };
        };
        let rows = recorder.summary().packets;
        let how = recorder.failure().map_or_else(|| format!("{rows} rows"), |why| format!("aborted: {why}"));
        RecordingState { on: true, text: format!("{}: {how}", name(path)) }
    }
}

/// File name without its folder.
fn name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

fn with_suffix(path: &Path, end: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(end);
    name.into()
}

/// Numbers a path: `run.mcap`, `run-2.mcap`, `run-3.mcap`.
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

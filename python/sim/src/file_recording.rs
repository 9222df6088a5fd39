//! The record button of windows and browser views.

use crate::errors::{Class, Failure};
use crate::recording::{RecordingSummary, recorder_cfg};
use crate::shared::Shared;
use crate::simulation::Simulation;
use kinetoscope::viewer::{RecordButton, RecordControl as _, ViewerExt as _};
use pyo3::prelude::*;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Recording to files for the record button of windows and browser views, made by ``SimulationManager.file_recording``. Each
/// recording that the button starts gets a new file. ``destroy`` aborts the current recording, so call ``finish`` before.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct FileRecording {
    shared: Arc<Shared>,
    /// Locked only by threads that hold the lock of the simulation, so the button is never busy.
    inner: Arc<Mutex<kinetoscope::FileRecording>>,
}

#[pymethods]
impl Simulation {
    /// Recording to files for a record button: for ``open_window``, ``serve`` and ``set_record_button``. ``path`` is a path such as
    /// ``"run.mcap"``, after which the button writes ``run-2.mcap`` and so on, or a ``RecorderCfg``. Existing files are not
    /// overwritten unless the configuration allows it.
    fn file_recording(&self, py: Python<'_>, path: &Bound<'_, PyAny>) -> PyResult<FileRecording> {
        let cfg = recorder_cfg(path)?;
        // Nothing of the simulation is needed, but a destroyed one is refused now.
        self.shared.read(py, |_| Ok(()))?;
        let inner = Arc::new(Mutex::new(kinetoscope::FileRecording::new(cfg)));
        Ok(FileRecording { shared: Arc::clone(&self.shared), inner })
    }

    /// Sets the record button of all windows and browser views, which ``Viewer.record`` presses too. The recording of the button
    /// before is stopped.
    fn set_record_button(&self, py: Python<'_>, record_button: &Bound<'_, FileRecording>) -> PyResult<()> {
        let button = record_button.get().button(&self.shared, "set_record_button")?;
        self.shared.write_with_threads(py, |sim| {
            sim.set_record_button(button);
            Ok(())
        })
    }
}

#[pymethods]
impl FileRecording {
    /// Starts a recording without the button, to exactly the file of the configuration. Does nothing while a recording runs.
    fn start(&self, py: Python<'_>) -> PyResult<()> {
        self.shared.write_with_threads(py, |sim| Ok(self.lock().start(sim)?))
    }

    /// Ends the current recording, and returns the summaries of all recordings that ended since the last call. Raises the
    /// ``RecordingError`` of a recording that failed; a later call returns the complete ones.
    fn finish(&self, py: Python<'_>) -> PyResult<Vec<RecordingSummary>> {
        let finished = self.shared.write(py, |sim| Ok(self.lock().finish(sim)?))?;
        Ok(finished.into_iter().map(RecordingSummary::from).collect())
    }

    /// True while a recording runs.
    #[getter]
    fn is_recording(&self, py: Python<'_>) -> PyResult<bool> {
        self.shared.read(py, |sim| Ok(self.lock().state(sim).on))
    }

    /// Error that stopped the current recording, or None. ``finish`` raises it too.
    #[getter]
    fn failure(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.shared.read(py, |sim| Ok(self.lock().failure(sim)))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.describe(py, "FileRecording", |sim| {
            let state = self.lock().state(sim);
            let text = if state.text.is_empty() { "no recording yet" } else { &state.text };
            Ok(format!("<FileRecording{}: {text}>", if state.on { ", recording" } else { "" }))
        })
    }
}

impl FileRecording {
    /// The button, for views of `shared`.
    pub(crate) fn button(&self, shared: &Arc<Shared>, method: &str) -> Result<RecordButton, Failure> {
        if Arc::ptr_eq(&self.shared, shared) {
            return Ok(RecordButton::shared(Arc::clone(&self.inner)));
        }
        let message = format!("{method}: the record button belongs to another simulation");
        Err(Failure::new(Class::ForeignHandle, message))
    }

    fn lock(&self) -> MutexGuard<'_, kinetoscope::FileRecording> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

//! The record button: viewers display it, and the program implements it.

use kinetoscope_sim::SimulationManager;
use std::fmt;
use std::sync::{Arc, Mutex};

/// Implementation of a record button.
///
/// The methods run on the simulation's thread, between two steps. They may read the whole simulation and add observers
/// such as a recorder. They must not call `update`.
pub trait RecordControl: Send {
    /// Starts (`on`) or stops the recording. Does nothing if the recording is already in that state.
    ///
    /// # Errors
    /// Returns the reason of a failure, as a text that viewers display.
    fn set(&mut self, sim: &mut SimulationManager, on: bool) -> Result<(), String>;

    /// Returns the current state. Called whenever a snapshot is published and before each press of the button.
    fn state(&self, sim: &SimulationManager) -> RecordingState;
}

/// State of a recording for the record button: on or off, and a text.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordingState {
    /// True while recording.
    pub on: bool,
    /// Text that viewers display beside the button, such as the file name; may be empty.
    pub text: String,
}

/// A record button for [`WindowCfg`](crate::WindowCfg), [`ServeCfg`](crate::ServeCfg) or
/// [`ViewerExt::set_record_button`](super::ViewerExt::set_record_button). Clones refer to the same button.
///
/// A simulation has one button, which all its windows and browser views show. A button that is set later replaces it. A
/// recording started by a viewer stops when that viewer is dropped; viewers cannot stop a recording started by the
/// program.
#[derive(Clone)]
pub struct RecordButton(Arc<Mutex<dyn RecordControl>>);

impl RecordButton {
    /// Creates a button from its implementation.
    pub fn new(recording: impl RecordControl + 'static) -> Self {
        Self::shared(Arc::new(Mutex::new(recording)))
    }

    /// Creates a button whose implementation is shared with other code. If that code holds the lock when the button is
    /// pressed, the press is refused instead of blocking the simulation; hold the lock only briefly.
    pub fn shared<R: RecordControl + 'static>(recording: Arc<Mutex<R>>) -> Self {
        Self(recording)
    }

    /// Starts or stops the recording. Refused with a reason while the lock is held elsewhere.
    pub(super) fn set_recording(&self, sim: &mut SimulationManager, on: bool) -> Result<(), String> {
        match self.0.try_lock() {
            Ok(mut recording) => recording.set(sim, on),
            Err(_) => Err("the recording is busy; press again".into()),
        }
    }

    /// Returns the state of the recording, or `None` while the lock is held elsewhere.
    pub(super) fn state(&self, sim: &SimulationManager) -> Option<RecordingState> {
        self.0.try_lock().ok().map(|recording| recording.state(sim))
    }
}

impl fmt::Debug for RecordButton {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("RecordButton(..)")
    }
}

/// Two buttons are equal if they share the same implementation.
impl PartialEq for RecordButton {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

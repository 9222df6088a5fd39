//! The record button: views show it, and what it does is the program's.

use kinetoscope_sim::SimulationManager;
use std::fmt;
use std::sync::{Arc, Mutex};

/// What happens when somebody presses the record button.
///
/// It is called on the thread that steps, between two steps, so it may read everything and add observers, such as a recorder.
/// It must not call `update`.
pub trait Recording: Send {
    /// Begins to record, or ends it; where that is so already, nothing is to be done.
    ///
    /// # Errors
    /// Why not, in words that viewers are shown.
    fn set(&mut self, sim: &mut SimulationManager, on: bool) -> Result<(), String>;

    /// How it stands; asked whenever viewers are shown something new.
    fn state(&self, sim: &SimulationManager) -> RecordingState;
}

/// How a recording stands.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordingState {
    /// Whether it records.
    pub on: bool,
    /// What viewers are told beside the button, such as the name of the file; may be empty.
    pub text: String,
}

/// A record button for [`WindowCfg`](crate::WindowCfg), [`ServeCfg`](crate::ServeCfg) or
/// [`Viewing::record_button`](super::Viewing::record_button). Its clones are the same button.
///
/// A simulation has one, which all its windows and browsers show; another one that is given later takes its place. What a
/// viewer has begun to record ends with that viewer; what the program has begun does not.
#[derive(Clone)]
pub struct RecordButton(Arc<Mutex<dyn Recording>>);

impl RecordButton {
    /// A button that does this.
    pub fn new(recording: impl Recording + 'static) -> Self {
        Self::shared(Arc::new(Mutex::new(recording)))
    }

    /// A button that does what somebody else has a hand on, too. Who holds the lock when it is pressed holds nobody up: the
    /// button is refused then, so it is to be held for moments.
    pub fn shared<R: Recording + 'static>(recording: Arc<Mutex<R>>) -> Self {
        Self(recording)
    }

    /// Presses it.
    pub(super) fn set(&self, sim: &mut SimulationManager, on: bool) -> Result<(), String> {
        match self.0.try_lock() {
            Ok(mut recording) => recording.set(sim, on),
            Err(_) => Err("the recording is busy just now: press again".into()),
        }
    }

    /// How it stands; `None` while somebody holds its lock.
    pub(super) fn state(&self, sim: &SimulationManager) -> Option<RecordingState> {
        self.0.try_lock().ok().map(|recording| recording.state(sim))
    }
}

impl fmt::Debug for RecordButton {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("RecordButton(..)")
    }
}

/// Whether they are the same button.
impl PartialEq for RecordButton {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

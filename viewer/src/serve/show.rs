//! Interface between the server (transport) and the view (simulation and rendering).

use super::command::Command;
use serde_json::Value;

/// A view that serves several clients.
pub(super) trait Show: Send + Sync {
    /// Creates the session of a new client.
    fn eyes(&self) -> Box<dyn Eyes>;

    /// Called after all clients have been gone for a while.
    fn deserted(&self);
}

/// Session of one client. Its methods never wait for the simulation.
pub(super) trait Eyes: Send {
    /// Returns the scene contents: robots and their joints, cameras, environments. `None` if unchanged since the last
    /// call.
    fn contents(&mut self) -> Option<Value>;

    /// Returns the state. `None` if unchanged since the last call.
    fn state(&mut self) -> Option<Value>;

    /// Runs a command, or returns the reason of its refusal.
    fn obey(&mut self, command: Command) -> Result<(), String>;

    /// Renders the images that are due; empty if nothing has changed.
    fn pictures(&mut self) -> Vec<Picture>;
}

/// An encoded image with its description.
pub(super) struct Picture {
    /// Description of the image for the page.
    pub(super) about: Value,
    /// Image file, JPEG or PNG.
    pub(super) file: Vec<u8>,
}

impl Picture {
    /// Encodes the message: length of `about` as four bytes (little endian), `about` as JSON, image file.
    pub(super) fn message(&self) -> Vec<u8> {
        let about = self.about.to_string().into_bytes();
        let length = u32::try_from(about.len()).unwrap_or(u32::MAX).to_le_bytes();
        [&length[..], &about, &self.file].concat()
    }
}

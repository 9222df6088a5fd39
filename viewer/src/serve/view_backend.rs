//! Interface between the server (transport) and the view (simulation and rendering).

use super::command::Command;
use serde_json::Value;

/// A view that serves several clients.
pub(super) trait ViewBackend: Send + Sync {
    /// Creates the session of a new client.
    fn open_session(&self) -> Box<dyn ViewSession>;

    /// Called once after all clients have been gone for some seconds.
    fn on_idle(&self);
}

/// Session of one client. Its methods never wait for the simulation.
pub(super) trait ViewSession: Send {
    /// Returns the scene contents: robots and their joints, cameras, environments. `None` if unchanged since the last
    /// call.
    fn contents(&mut self) -> Option<Value>;

    /// Returns the state. `None` if unchanged since the last call.
    fn state(&mut self) -> Option<Value>;

    /// Runs a command, or returns the reason of its refusal.
    fn handle(&mut self, command: Command) -> Result<(), String>;

    /// Renders the images that are due; empty if nothing has changed.
    fn due_images(&mut self) -> Vec<EncodedImage>;
}

/// An encoded image with its description.
pub(super) struct EncodedImage {
    /// Description of the image for the page.
    pub(super) description: Value,
    /// Image file, of the type in `description`.
    pub(super) file: Vec<u8>,
}

impl EncodedImage {
    /// Encodes the message: length of `description` as four bytes (little endian), `description` as JSON, image file.
    pub(super) fn to_message(&self) -> Vec<u8> {
        let about = self.description.to_string().into_bytes();
        let length = u32::try_from(about.len()).unwrap_or(u32::MAX).to_le_bytes();
        [&length[..], &about, &self.file].concat()
    }
}

//! What a server shows, without saying how it is drawn: transport and simulation meet here.

use super::command::Command;
use serde_json::Value;

/// Something that can be looked at by many.
pub(super) trait Show: Send + Sync {
    /// The eyes of one more viewer.
    fn eyes(&self) -> Box<dyn Eyes>;

    /// All viewers have been gone for a while.
    fn deserted(&self);
}

/// What one viewer sees and does. Nothing in here waits for the simulation.
pub(super) trait Eyes: Send {
    /// What there is: robots and their joints, cameras, environments. `None` where that is as it was told last.
    fn contents(&mut self) -> Option<Value>;

    /// How everything stands now. `None` where that is as it was told last.
    fn state(&mut self) -> Option<Value>;

    /// Does what the viewer asks, or says why not.
    fn obey(&mut self, command: Command) -> Result<(), String>;

    /// The pictures that are due: none where nothing has changed.
    fn pictures(&mut self) -> Vec<Picture>;
}

/// A picture on its way.
pub(super) struct Picture {
    /// What it shows, for the page.
    pub(super) about: Value,
    /// A file of pictures: JPEG or PNG.
    pub(super) file: Vec<u8>,
}

impl Picture {
    /// As it travels: the length of `about` as four bytes, the lowest first, `about` as JSON, the file.
    pub(super) fn message(&self) -> Vec<u8> {
        let about = self.about.to_string().into_bytes();
        let length = u32::try_from(about.len()).unwrap_or(u32::MAX).to_le_bytes();
        [&length[..], &about, &self.file].concat()
    }
}

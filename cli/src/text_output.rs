//! Output of whole texts.

use crate::command_status::{CommandStatus, Result};
use std::io::{ErrorKind, Write as _};
use std::path::Path;

/// Writes a text to a file, or to the standard output for `None`.
pub(crate) fn write_text(text: &str, file: Option<&Path>) -> Result<CommandStatus> {
    match file {
        Some(file) => std::fs::write(file, text).map_err(|error| format!("{}: {error}", file.display()))?,
        None => match std::io::stdout().lock().write_all(text.as_bytes()) {
            // A closed pipe, as with `| head`, is not an error.
            Err(error) if error.kind() != ErrorKind::BrokenPipe => return Err(error.into()),
            _ => {}
        },
    }
    Ok(CommandStatus::Done)
}

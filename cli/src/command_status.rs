//! Results of commands.

/// Outcome of a command that completed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CommandStatus {
    Done,
    /// A part of the input was repaired, ignored or missing.
    Warned,
}

/// Result of a command. Errors are sentences for the user; an error about a file begins with its path and line.
pub(crate) type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

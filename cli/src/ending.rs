//! The results of commands.

/// How a command ended that did its work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    Done,
    /// Something of the input was repaired, ignored or missing.
    Warned,
}

/// Errors are sentences for the user; those about a file begin with its name and line.
pub(crate) type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

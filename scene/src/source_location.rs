//! Source positions: file and line, carried from the URDF to MuJoCo's compile errors.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A position in a user's file.
#[derive(Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SourceLocation {
    /// Path of the file as the user gave it.
    pub file: Arc<PathBuf>,
    /// Line, counted from 1.
    pub line: u32,
}

impl SourceLocation {
    /// Creates a position in `file`.
    pub fn new(file: impl AsRef<Path>, line: u32) -> Self {
        Self { file: Arc::new(file.as_ref().to_path_buf()), line }
    }
}

impl fmt::Display for SourceLocation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.file.display(), self.line)
    }
}

impl fmt::Debug for SourceLocation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

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

/// Starts of the lines of a text, to find the line of a position. The XML library scans the text up to the position each
/// time.
#[derive(Clone, Debug)]
pub struct LineStarts(Vec<usize>);

impl LineStarts {
    /// Finds the lines of `text`, which end with `\n`.
    pub fn new(text: &str) -> Self {
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(at, _)| at + 1);
        Self(std::iter::once(0).chain(ends).collect())
    }

    /// Line of a position \[bytes from the start of the text\], counted from 1.
    pub fn line(&self, position: usize) -> u32 {
        u32::try_from(self.0.partition_point(|start| *start <= position)).unwrap_or(u32::MAX)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines() {
        let lines = LineStarts::new("ab\n\ncd");
        let found: Vec<u32> = (0..8).map(|position| lines.line(position)).collect();
        assert_eq!(found, [1, 1, 1, 2, 3, 3, 3, 3]);
        assert_eq!(LineStarts::new("").line(0), 1);
    }
}

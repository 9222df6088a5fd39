//! Errors of mesh files.

use std::error::Error;
use std::path::{Path, PathBuf};

use super::{HullError, MeshOptions};

/// Error of a mesh file, with the position in the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// The file, or a buffer it refers to, cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file that was opened.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Neither the extension nor the first bytes identify the format.
    #[error("{}: unknown mesh format; expected {expected}", path.display())]
    UnknownFormat {
        /// The mesh file.
        path: PathBuf,
        /// Extensions of the supported formats.
        expected: String,
    },
    /// The file ends before the data it announces.
    #[error("{}: {at} ends early: expected {expected} bytes, found {found}", path.display())]
    Truncated {
        /// The mesh file.
        path: PathBuf,
        /// Part of the file.
        at: String,
        /// Expected number of bytes.
        expected: u64,
        /// Number of bytes found.
        found: u64,
    },
    /// A line or element violates the format.
    #[error("{}: {at}: {what}", path.display())]
    Invalid {
        /// The file (a mesh, or the MTL of an OBJ).
        path: PathBuf,
        /// The line or element.
        at: String,
        /// The problem, and the expected content.
        what: String,
        /// The parser's own error, if one was involved.
        source: Option<Box<dyn Error + Send + Sync>>,
    },
    /// An index is out of range.
    #[error("{}: {at}: index {index} is out of range; the number of elements is {count}", path.display())]
    IndexOutOfRange {
        /// The mesh file.
        path: PathBuf,
        /// The line or element that holds the index.
        at: String,
        /// The index as written.
        index: i64,
        /// Number of elements that the index may refer to.
        count: usize,
    },
    /// A position is infinite or not a number.
    #[error("{}: {at}: vertex position {value:?} is not finite", path.display())]
    NonFinite {
        /// The mesh file.
        path: PathBuf,
        /// The line or element.
        at: String,
        /// The position after all transforms.
        value: [f32; 3],
    },
    /// The file needs a feature that the readers do not support.
    #[error("{}: {feature} is not supported", path.display())]
    Unsupported {
        /// The mesh file.
        path: PathBuf,
        /// Name of the extension, element or mode.
        feature: String,
    },
    /// The file is well formed but holds no triangle.
    #[error("{}: no triangles; a mesh needs at least one", path.display())]
    Empty {
        /// The mesh file.
        path: PathBuf,
    },
    /// The file expands to more triangles or nodes than allowed.
    #[error("{}: more than {limit} {what}", path.display())]
    TooLarge {
        /// The mesh file.
        path: PathBuf,
        /// Kind of the elements: `triangles` or `nodes`.
        what: &'static str,
        /// Largest accepted number.
        limit: usize,
    },
    /// No convex hull or convex pieces can be computed, or their configuration is invalid.
    #[error("{}: no convex hull: {source}", path.display())]
    Hull {
        /// The mesh file.
        path: PathBuf,
        /// Reason.
        source: HullError,
    },
}

/// The file and the options of its reader, from which readers make errors.
pub(super) struct ReadContext<'a> {
    pub(super) path: &'a Path,
    pub(super) options: &'a MeshOptions,
}

impl ReadContext<'_> {
    pub(super) fn invalid(&self, at: impl Into<String>, what: impl Into<String>) -> MeshError {
        MeshError::Invalid { path: self.path.to_owned(), at: at.into(), what: what.into(), source: None }
    }

    pub(super) fn invalid_with_source(
        &self,
        at: impl Into<String>,
        what: impl Into<String>,
        source: impl Error + Send + Sync + 'static,
    ) -> MeshError {
        let source: Option<Box<dyn Error + Send + Sync>> = Some(Box::new(source));
        MeshError::Invalid { path: self.path.to_owned(), at: at.into(), what: what.into(), source }
    }

    pub(super) fn index(&self, at: impl Into<String>, index: i64, count: usize) -> MeshError {
        MeshError::IndexOutOfRange { path: self.path.to_owned(), at: at.into(), index, count }
    }

    pub(super) fn unsupported(&self, feature: impl Into<String>) -> MeshError {
        MeshError::Unsupported { path: self.path.to_owned(), feature: feature.into() }
    }

    pub(super) fn truncated(&self, at: impl Into<String>, expected: u64, found: u64) -> MeshError {
        MeshError::Truncated { path: self.path.to_owned(), at: at.into(), expected, found }
    }

    pub(super) fn too_large(&self, what: &'static str, limit: usize) -> MeshError {
        MeshError::TooLarge { path: self.path.to_owned(), what, limit }
    }

    /// Resolves a path that is written in this file, relative to the folder of this file.
    pub(super) fn beside(&self, written: &str) -> PathBuf {
        beside(self.path, written)
    }
}

/// Resolves a path as mesh files write it (`file://`, backslashes), relative to the folder of `file`.
pub(super) fn beside(file: &Path, written: &str) -> PathBuf {
    let plain = written.trim();
    let plain = plain.strip_prefix("file://").unwrap_or(plain).replace('\\', "/");
    file.parent().unwrap_or(Path::new("")).join(plain)
}

/// Decodes URI escapes such as `%20`. Invalid escapes stay as written; bytes that are not UTF-8 become U+FFFD.
pub(super) fn percent_decoded(uri: &str) -> String {
    percent_encoding::percent_decode_str(uri).decode_utf8_lossy().into_owned()
}

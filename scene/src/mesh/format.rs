//! [`Format`]: a mesh file format.

use super::error::ReadContext;
use super::{MeshError, TriMesh};

/// A mesh file format.
pub(super) struct Format {
    /// Number in the keys of the hull cache: the same bytes in two formats are two meshes.
    pub(super) code: u8,
    /// Extensions of file names.
    pub(super) extensions: &'static [&'static str],
    /// True if the file alone holds the geometry, so that caches may identify it by its bytes.
    pub(super) is_one_file: bool,
    /// Returns true for content that only this format can have.
    pub(super) is_certain: fn(&[u8]) -> bool,
    /// Likelihood that a file without a known extension has this format, by its content; 0 excludes the format.
    pub(super) likelihood: fn(&[u8]) -> u8,
    /// Reads a file.
    pub(super) read: fn(&ReadContext<'_>, &[u8]) -> Result<TriMesh, MeshError>,
}

/// True if the first 4096 bytes contain a word.
pub(super) fn begins_with_word(bytes: &[u8], word: &[u8]) -> bool {
    bytes[..bytes.len().min(4096)].windows(word.len()).any(|w| w == word)
}

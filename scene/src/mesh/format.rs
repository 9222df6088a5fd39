//! [`Format`]: a format of mesh files.

use super::error::Ctx;
use super::{MeshError, TriMesh};

/// A format of mesh files.
pub(super) struct Format {
    /// Number in the keys of the hull cache: the same bytes in two formats are two meshes.
    pub(super) code: u8,
    /// Extensions of file names.
    pub(super) extensions: &'static [&'static str],
    /// True if the geometry is in the file alone, so that caches may go by its bytes.
    pub(super) is_one_file: bool,
    /// True for content that no other format has.
    pub(super) is_certain: fn(&[u8]) -> bool,
    /// How much the content of a file without a known extension looks like this format; 0 for not at all.
    pub(super) likelihood: fn(&[u8]) -> u8,
    /// Reads a file.
    pub(super) read: fn(&Ctx<'_>, &[u8]) -> Result<TriMesh, MeshError>,
}

/// True if the first 4096 bytes have a word.
pub(super) fn begins_with_word(bytes: &[u8], word: &[u8]) -> bool {
    bytes[..bytes.len().min(4096)].windows(word.len()).any(|w| w == word)
}

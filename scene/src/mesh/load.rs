//! Loading of mesh files: list of formats, detection of the format, reading.

use std::path::Path;

use super::error::ReadContext;
use super::format::Format;
use super::{MeshError, MeshOptions, TriMesh, dae, glb, obj, stl};
use crate::input_file::{self, MAX_BINARY};

/// All formats.
const FORMATS: [&Format; 5] = [&stl::FORMAT, &obj::FORMAT, &dae::FORMAT, &glb::GLB, &glb::GLTF];

/// Format of a file: by content that proves it, then by extension, then by content that suggests it; `None` for an
/// unknown format.
pub(super) fn format_of(path: &Path, bytes: &[u8]) -> Option<&'static Format> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let certain = FORMATS.into_iter().find(|format| (format.is_certain)(bytes));
    let named = || FORMATS.into_iter().find(|format| format.extensions.contains(&extension.as_str()));
    let likely = || {
        let all = FORMATS.into_iter().map(|format| ((format.likelihood)(bytes), format));
        all.filter(|(likelihood, _)| *likelihood > 0).max_by_key(|(likelihood, _)| *likelihood)
    };
    certain.or_else(named).or_else(|| likely().map(|(_, format)| format))
}

/// Extensions of all formats, for an error message.
fn extensions() -> String {
    let all = FORMATS.map(|format| format!(".{}", format.extensions[0]));
    let (last, others) = all.split_last().map_or(("", &all[..]), |(last, others)| (last, others));
    format!("{} or {last}", others.join(", "))
}

/// Reads a mesh file: STL (binary or ASCII), OBJ with MTL, COLLADA, GLB or glTF.
///
/// The content determines the format if it is unambiguous, else the extension, else the likely content. Vertices of
/// equal position, normal and texture coordinates are merged. Degenerate triangles are removed, unless all are
/// degenerate. Triangles are grouped by material, in an order that depends on the file alone.
///
/// Positions are in meters as stored, except that COLLADA's `<unit>` is applied. Axes are not exchanged: URDF defines
/// no up axis for meshes, so the y-up coordinates of glTF stay as stored (see [`MeshOptions`] for COLLADA).
///
/// # Errors
/// The file cannot be read, or its content is invalid, unsupported or without triangles.
pub fn load(path: impl AsRef<Path>) -> Result<TriMesh, MeshError> {
    load_with(path, &MeshOptions::default())
}

/// Same as [`load`], with `options`.
///
/// # Errors
/// As [`load`].
pub fn load_with(path: impl AsRef<Path>, options: &MeshOptions) -> Result<TriMesh, MeshError> {
    let path = path.as_ref();
    let bytes = input_file::read_named(path, MAX_BINARY);
    load_bytes(path, &bytes.map_err(|source| MeshError::Io { path: path.to_owned(), source })?, options)
}

/// Reads a mesh from the content of a file. `path` need not exist: its extension helps to detect the format, its name
/// appears in errors, and its folder is searched for referenced files (MTL, textures, glTF buffers).
///
/// # Errors
/// As [`load`].
pub fn load_bytes(path: impl AsRef<Path>, bytes: &[u8], options: &MeshOptions) -> Result<TriMesh, MeshError> {
    let path = path.as_ref();
    let ctx = ReadContext { path, options };
    let format = format_of(path, bytes)
        .ok_or_else(|| MeshError::UnknownFormat { path: path.to_owned(), expected: extensions() })?;
    (format.read)(&ctx, bytes)
}

/// Reads a file that another file refers to.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, MeshError> {
    input_file::read_referenced(path, MAX_BINARY).map_err(|source| MeshError::Io { path: path.to_owned(), source })
}

//! The list of mesh formats, and which of them a file has.

use std::path::Path;

use super::error::Ctx;
use super::format::Format;
use super::{MeshError, MeshOptions, TriMesh, dae, glb, obj, stl};

/// All formats.
const FORMATS: [&Format; 5] = [&stl::FORMAT, &obj::FORMAT, &dae::FORMAT, &glb::GLB, &glb::GLTF];

/// The format of a file: by what the first bytes prove, then by extension, then by what the first bytes suggest.
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

/// The extensions of all formats, for a message.
fn extensions() -> String {
    let all = FORMATS.map(|format| format!(".{}", format.extensions[0]));
    let (last, others) = all.split_last().map_or(("", &all[..]), |(last, others)| (last, others));
    format!("{} or {last}", others.join(", "))
}

/// Reads a mesh file: STL (binary or ASCII), OBJ with MTL, COLLADA, GLB or glTF.
///
/// The format comes from the content where that is certain, else from the extension in any case. The result is welded
/// (vertices equal in position, normal and texture coordinate are one), free of degenerate triangles unless there is
/// nothing else, and its triangles are grouped by material; the order depends on the file alone. Positions are metres
/// as stored, except that COLLADA's `<unit>` is applied. No axis is exchanged (see [`MeshOptions`] for COLLADA; glTF
/// says y is up, URDF says nothing about it, and so the coordinates stay as stored).
pub fn load(path: &Path) -> Result<TriMesh, MeshError> {
    load_with(path, &MeshOptions::default())
}

/// [`load`] with options.
pub fn load_with(path: &Path, options: &MeshOptions) -> Result<TriMesh, MeshError> {
    load_bytes(path, &read(path)?, options)
}

/// Reads a mesh from the content of a file; `path` serves the extension, error messages and files beside it.
pub fn load_bytes(path: &Path, bytes: &[u8], options: &MeshOptions) -> Result<TriMesh, MeshError> {
    let ctx = Ctx { path, options };
    let format = format_of(path, bytes)
        .ok_or_else(|| MeshError::UnknownFormat { path: path.to_owned(), expected: extensions() })?;
    (format.read)(&ctx, bytes)
}

pub(super) fn read(path: &Path) -> Result<Vec<u8>, MeshError> {
    std::fs::read(path).map_err(|source| MeshError::Io { path: path.to_owned(), source })
}

//! Which reader a file gets.

use std::path::Path;

use super::error::Ctx;
use super::{MeshError, MeshOptions, TriMesh, dae, glb, obj, stl};

/// The formats; the hull cache keys by it, because the same bytes under two formats are two meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Stl,
    Obj,
    Dae,
    Glb,
    Gltf,
}

impl Format {
    /// By what the first bytes prove, then by extension, then by what the first bytes suggest.
    pub(super) fn of(path: &Path, bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"glTF") {
            return Some(Self::Glb);
        }
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        match extension.as_str() {
            "stl" | "stlb" => return Some(Self::Stl),
            "obj" => return Some(Self::Obj),
            "dae" => return Some(Self::Dae),
            "glb" => return Some(Self::Glb),
            "gltf" => return Some(Self::Gltf),
            _ => {}
        }
        let head = &bytes[..bytes.len().min(4096)];
        let has = |needle: &[u8]| head.windows(needle.len()).any(|w| w == needle);
        if stl::binary_length(bytes) == Some(bytes.len() as u64) {
            Some(Self::Stl)
        } else if has(b"<COLLADA") {
            Some(Self::Dae)
        } else if has(b"\"asset\"") {
            Some(Self::Gltf)
        } else if head.starts_with(b"solid") && has(b"facet") {
            Some(Self::Stl)
        } else if head.starts_with(b"v ") || has(b"\nv ") {
            Some(Self::Obj)
        } else {
            None
        }
    }
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
    match Format::of(path, bytes) {
        Some(Format::Stl) => stl::read(&ctx, bytes),
        Some(Format::Obj) => obj::read(&ctx, bytes),
        Some(Format::Dae) => dae::read(&ctx, bytes),
        Some(Format::Glb) => glb::read_glb(&ctx, bytes),
        Some(Format::Gltf) => glb::read_gltf(&ctx, bytes),
        None => Err(MeshError::UnknownFormat { path: path.to_owned() }),
    }
}

pub(super) fn read(path: &Path) -> Result<Vec<u8>, MeshError> {
    std::fs::read(path).map_err(|source| MeshError::Io { path: path.to_owned(), source })
}

//! Triangle meshes and their files: STL, OBJ + MTL, DAE, GLB in; convex hulls; STL and OBJ out.

mod affine;
mod builder;
mod cell;
mod dae;
mod dae_material;
mod error;
mod format;
mod glb;
mod glb_buffers;
mod hull;
mod hull_cache;
mod hull_error;
mod load;
mod mtl;
mod obj;
mod options;
mod pieces;
mod pieces_cache;
mod polygon;
mod prisms;
mod solid;
mod stl;
#[cfg(test)]
mod tests_corrupt;
#[cfg(test)]
mod tests_robots;
mod trimesh;
mod write;

use std::ops::Range;
use std::path::PathBuf;

pub use error::MeshError;
pub use hull::{HullCfg, convex_hull};
pub use hull_cache::HullCache;
pub use hull_error::HullError;
pub use load::{load, load_bytes, load_with};
pub use options::{DaeUpAxis, MeshOptions};
pub use pieces::{Pieces, PiecesCfg, convex_pieces};
pub use prisms::prisms;
pub use solid::Solid;
pub use trimesh::MeshFault;
pub use write::{write_binary_stl, write_obj};

/// Triangles with optional normals and texture coordinates, in one vertex array.
///
/// Every index is smaller than `positions.len()`; every position is finite; `normals` and `uvs` are either absent or as
/// long as `positions`. [`load`] guarantees it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Vertex positions \[m\].
    pub positions: Vec<[f32; 3]>,
    /// Unit vertex normals.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Texture coordinates, origin at the lower left of the image (OpenGL, OBJ, COLLADA). They may leave 0..=1: the
    /// image repeats.
    pub uvs: Option<Vec<[f32; 2]>>,
    /// Vertex indices of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Consecutive runs of `triangles` with one material each; they cover all triangles.
    pub parts: Vec<MeshPart>,
    /// Materials that `parts` refer to.
    pub materials: Vec<MeshMaterial>,
}

/// A run of triangles that share a material.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshPart {
    /// Range in [`TriMesh::triangles`].
    pub triangles: Range<usize>,
    /// Index in [`TriMesh::materials`]; `None` where the file gives none.
    pub material: Option<usize>,
}

/// The look of a part as the mesh file gives it.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshMaterial {
    /// Name in the file.
    pub name: String,
    /// Base colour rgba in 0..=1 (multiplies the texture), meant for the screen as it is (sRGB, not linear).
    pub rgba: [f32; 4],
    /// Base colour image.
    pub texture: Option<TextureSource>,
}

/// Where the pixels of a texture are.
#[derive(Clone, Debug, PartialEq)]
pub enum TextureSource {
    /// An image file next to the mesh (it may not exist).
    File(PathBuf),
    /// An image inside the mesh file (GLB): its bytes, PNG or JPEG.
    Embedded(Vec<u8>),
}

//! Triangle meshes and their files.
//!
//! Readers: STL, OBJ with MTL, COLLADA, GLB and glTF. Writers: STL and OBJ. Also convex hulls and convex pieces.

mod affine;
mod builder;
mod cell;
mod convex_decomposition;
mod convex_decomposition_cache;
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
mod polygon;
mod prisms;
mod stl;
#[cfg(test)]
mod tests_corrupt;
#[cfg(test)]
mod tests_robots;
mod texture_source;
mod trimesh;
mod volume_integrals;
mod write;

use std::ops::Range;

pub use convex_decomposition::{ConvexDecomposition, ConvexDecompositionCfg, convex_decomposition};
pub use error::MeshError;
pub use hull::{HullCfg, convex_hull};
pub use hull_cache::HullCache;
pub use hull_error::HullError;
pub use load::{load, load_bytes, load_with};
pub use options::{DaeUpAxis, MeshOptions};
pub use prisms::prisms;
pub use texture_source::TextureSource;
pub use trimesh::InvalidMesh;
pub use volume_integrals::VolumeIntegrals;
pub use write::{write_binary_stl, write_obj};

/// A triangle mesh with optional vertex normals and texture coordinates. One index selects position, normal and texture
/// coordinates of a vertex.
///
/// Every vertex index is smaller than `positions.len()`, and every number is finite. `normals` and `uvs` are either
/// absent or as long as `positions`. The submeshes cover all triangles consecutively, and their materials exist.
/// [`load`] guarantees these invariants, and [`validate`](Self::validate) checks them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Vertex positions \[m\].
    pub positions: Vec<[f32; 3]>,
    /// Vertex normals, of unit length in meshes from [`load`]; `None` without normals.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Texture coordinates, origin at the lower left of the image (OpenGL, OBJ, COLLADA); `None` without them.
    /// Coordinates outside of 0..=1 repeat the image.
    pub uvs: Option<Vec<[f32; 2]>>,
    /// Vertex indices of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Consecutive runs of `triangles` with one material each; they cover all triangles.
    pub submeshes: Vec<Submesh>,
    /// Materials that `submeshes` refer to.
    pub materials: Vec<MeshMaterial>,
}

/// A run of triangles that share a material.
#[derive(Clone, Debug, PartialEq)]
pub struct Submesh {
    /// Range in [`TriMesh::triangles`].
    pub triangles: Range<usize>,
    /// Index in [`TriMesh::materials`]; `None` for triangles without a material in the file.
    pub material: Option<usize>,
}

/// Material of a submesh, as given in the mesh file.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshMaterial {
    /// Name in the file; without one, the id (COLLADA), or `material` and the index (glTF).
    pub name: String,
    /// Base color rgba in 0..=1, a display color (sRGB, not linear). It multiplies the texture.
    pub rgba: [f32; 4],
    /// Base color texture; `None` for a uniform color.
    pub texture: Option<TextureSource>,
}

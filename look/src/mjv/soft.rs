//! Skins and flexes: meshes whose vertices MuJoCo's visualizer computes.

use super::decor::LineView;
use super::frame::DrawFlags;
use super::layout::SoftTypes;
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::shape::RenderMesh;

/// Faces of a skin, which do not change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SkinFaces {
    /// Index of the first vertex among the vertices of all skins.
    pub first_vertex: usize,
    /// Number of vertices.
    pub vertices: usize,
    /// Vertices of each triangle, as indices within the skin.
    pub faces: Vec<[i32; 3]>,
    /// Texture coordinates of the vertices, with v downward; empty for a skin without them.
    pub texcoords: Vec<[f32; 2]>,
}

/// Memory of a scene: its geoms and lights as bytes, its flags, and the vertices of skins and flexes in the world \[m\].
#[derive(Clone, Copy, Debug, Default)]
pub struct MjvMemory<'a> {
    /// Structures `mjvGeom`.
    pub geoms: &'a [u8],
    /// Structures `mjvLight`.
    pub lights: &'a [u8],
    /// Viewing direction of the camera, which is the direction of the headlight.
    pub forward: [f32; 3],
    /// Flags of the scene.
    pub flags: DrawFlags,
    /// View in which lines have their width; `None` hides lines.
    pub lines: Option<LineView>,
    /// Positions of the vertices of all skins (`skinvert`).
    pub skin_positions: &'a [[f32; 3]],
    /// Normals of the vertices of all skins (`skinnormal`).
    pub skin_normals: &'a [[f32; 3]],
    /// Corners of the triangles of all flexes (`flexface`).
    pub flex_positions: &'a [[f32; 3]],
    /// Normals of these corners (`flexnormal`).
    pub flex_normals: &'a [[f32; 3]],
    /// Texture coordinates of these corners (`flextexcoord`).
    pub flex_texcoords: &'a [[f32; 2]],
    /// Index of the first triangle of each flex (`flexfaceadr`).
    pub flex_first_faces: &'a [i32],
    /// Number of triangles of each flex that are in use (`flexfaceused`).
    pub flex_faces: &'a [i32],
}

/// A skin or flex of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SoftBody {
    Skin(usize),
    Flex(usize),
}

impl SoftBody {
    /// The skin or flex of a geom of type `kind` with this object id; `None` for other types.
    pub(super) fn of(kind: i32, object: i32, types: &SoftTypes) -> Option<Self> {
        let index = usize::try_from(object).ok()?;
        match Some(kind) {
            kind if kind == types.skin => Some(Self::Skin(index)),
            kind if kind == types.flex => Some(Self::Flex(index)),
            _ => None,
        }
    }

    /// Number of triangles, which decides if a mesh can be reused.
    pub(super) fn faces(self, skins: &[SkinFaces], memory: &MjvMemory<'_>) -> usize {
        match self {
            Self::Skin(index) => skins.get(index).map_or(0, |skin| skin.faces.len()),
            Self::Flex(index) => {
                memory.flex_faces.get(index).and_then(|&count| usize::try_from(count).ok()).unwrap_or(0)
            }
        }
    }

    /// Positions and normals of the vertices; empty if the memory does not have them.
    pub(super) fn vertices<'a>(self, skins: &[SkinFaces], memory: &MjvMemory<'a>) -> [&'a [[f32; 3]]; 2] {
        let (first, count, positions, normals) = match self {
            Self::Skin(index) => {
                let Some(skin) = skins.get(index) else { return [&[]; 2] };
                (skin.first_vertex, skin.vertices, memory.skin_positions, memory.skin_normals)
            }
            Self::Flex(index) => {
                let first = memory.flex_first_faces.get(index).and_then(|&first| usize::try_from(first).ok());
                let Some(first) = first else { return [&[]; 2] };
                (3 * first, 3 * self.faces(skins, memory), memory.flex_positions, memory.flex_normals)
            }
        };
        [positions, normals].map(|all| all.get(first..first + count).unwrap_or(&[]))
    }

    /// A deformable mesh with the present vertices; `None` without valid triangles.
    pub(super) fn mesh(self, skins: &[SkinFaces], memory: &MjvMemory<'_>) -> Option<RenderMesh> {
        let [positions, _] = self.vertices(skins, memory);
        let count = positions.len();
        let (triangles, texcoords): (Vec<[u32; 3]>, &[[f32; 2]]) = match self {
            Self::Skin(index) => {
                let skin = skins.get(index)?;
                let exists = |face: &[u32; 3]| face.iter().all(|&vertex| (vertex as usize) < count);
                let faces = skin.faces.iter().map(|face| face.map(|vertex| u32::try_from(vertex).unwrap_or(u32::MAX)));
                (faces.filter(exists).collect(), &skin.texcoords)
            }
            Self::Flex(index) => {
                let first = 3 * usize::try_from(*memory.flex_first_faces.get(index)?).ok()?;
                let corners = (0..count as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
                (corners, memory.flex_texcoords.get(first..first + count).unwrap_or(&[]))
            }
        };
        if triangles.is_empty() {
            return None;
        }
        let mut mesh = TriMesh::from_triangles(positions.to_vec(), triangles);
        // MuJoCo's v axis points down the image.
        let uvs = || texcoords.iter().map(|&[u, v]| [u, 1.0 - v]).collect();
        mesh.uvs = (texcoords.len() == count).then(uvs);
        Some(RenderMesh::deformable(&mesh))
    }
}

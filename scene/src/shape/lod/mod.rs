//! Levels of detail: coarser versions of a mesh, with proven bounds on their distance from it.
//!
//! Edge collapses make a coarser version: a vertex moves onto a neighbor, and two triangles vanish. Seen along the mean
//! normal, the triangles around the vertex and those that replace them fill the same polygon. This is checked, so every
//! point has a partner straight above or below. The difference in height is linear over the pieces into which the edges
//! of both cut each other. It is largest at a corner of a piece, and all corners are evaluated. A triangle keeps the
//! sum of these largest differences over the chain of collapses that led to it.
//!
//! The mesh and its coarser version are thus joined by a continuous one-to-one map that moves no point by more than
//! [`LodLevel::error`]. Every point of each surface has a point of the other within that distance, open surfaces stay
//! open, and closed surfaces stay closed. Source of the idea: Cohen, Manocha and Olano, Simplifying polygonal models
//! using successive mappings, Visualization 1997.
//!
//! Vertices do not move: a coarser version has some of the mesh's vertices, with their normals. A new triangle's own
//! normal is within about 40° of the normals of its corners, so that creases stay in place. Borders of open meshes and
//! edges with more than two triangles are kept. This keeps parts of one mesh that are drawn with different materials
//! together.

mod simplify;
mod star;
#[cfg(test)]
mod tests;

use super::RenderMesh;
use crate::mesh::TriMesh;
use simplify::Surface;

/// A level of detail: a coarser version of a mesh.
#[derive(Clone, Debug)]
pub struct LodLevel {
    /// Bound on the distance between both surfaces \[m\]: every point of each has a point of the other within it.
    pub error: f32,
    /// The coarser mesh; levels of its own are not used.
    pub mesh: RenderMesh,
}

/// Smallest number of triangles of a mesh with levels.
const MIN_TRIANGLES: usize = 1000;
/// Bound of a simplification before the first level, so that the cheaper collapses come first \[m\].
const INITIAL_BOUND: f64 = 0.0625e-3;
/// Bounds of the levels \[m\]: 1/8 mm is half a pixel at a distance of 15 cm, for a focal length of 600 pixels.
const BOUNDS: [f64; 4] = [0.125e-3, 0.25e-3, 0.5e-3, 1e-3];
/// Smallest bound of a level \[m\].
pub(super) const MIN_BOUND: f32 = 0.01e-3;
/// Largest ratio of a level's triangles to those of the previous level; other levels are not worth their memory.
const MAX_TRIANGLE_RATIO: f64 = 0.8;
/// Rounding errors of all collapses of a vertex together, as a fraction of the mesh's extent. They are computed with 53
/// bits, from unchanged positions.
const ROUNDING_RATIO: f64 = 1e-7;

/// False for a mesh without levels: it is small, has texture coordinates, or its vertices move.
pub(super) fn may_have_levels(mesh: &RenderMesh) -> bool {
    mesh.triangles().len() >= MIN_TRIANGLES && mesh.uvs().is_none() && !mesh.is_deformable()
}

/// Levels of a mesh, the finest first.
pub(super) fn build_levels(mesh: &RenderMesh) -> Vec<LodLevel> {
    let mut levels = Vec::new();
    if !may_have_levels(mesh) {
        return levels;
    }
    let [lo, hi] = mesh.bounds();
    let rounding = ROUNDING_RATIO * (0..3).map(|k| f64::from(hi[k]) - f64::from(lo[k])).fold(0.0, f64::max);
    let mut surface = Surface::new(mesh);
    let mut last = mesh.triangles().len();
    surface.simplify(INITIAL_BOUND - rounding);
    for bound in BOUNDS {
        // A margin of 0.1 % for the rounding to 24 bits.
        surface.simplify(0.999 * bound - rounding);
        let count = surface.triangles().len();
        if count as f64 <= MAX_TRIANGLE_RATIO * last as f64 {
            last = count;
            let error = ((f64::from(surface.error()) + rounding) as f32).max(MIN_BOUND);
            levels.push(LodLevel { error, mesh: prepare(mesh, surface.triangles()) });
        }
    }
    levels
}

/// Prepares some triangles of a mesh for rendering.
fn prepare(mesh: &RenderMesh, triangles: &[[u32; 3]]) -> RenderMesh {
    const UNUSED: u32 = u32::MAX;
    let mut place = vec![UNUSED; mesh.positions().len()];
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    let corner = |i: u32| {
        let to = &mut place[i as usize];
        if *to == UNUSED {
            *to = positions.len() as u32;
            positions.push(mesh.positions()[i as usize]);
            normals.push(mesh.normals()[i as usize]);
        }
        *to
    };
    let triangles = triangles.as_flattened().iter().copied().map(corner).collect::<Vec<_>>();
    let triangles = triangles.as_chunks::<3>().0.to_vec();
    let mut coarse = TriMesh::from_triangles(positions, triangles);
    coarse.normals = Some(normals);
    RenderMesh::new(&coarse, RenderMesh::DEFAULT_CREASE_ANGLE)
}

//! Coarser versions of a mesh, with proven bounds on how far they are from it.
//!
//! A coarser version is made by collapses: a vertex moves onto a neighbour, two triangles vanish. The triangles around the
//! vertex, and those that replace them, fill the same polygon when they are looked at along the mean normal (that is
//! checked), so every point has a partner straight above or below. The difference in height is linear over the pieces that
//! the edges of both cut each other into; it is largest at a corner of a piece, and all corners are looked at. A triangle
//! keeps the sum of these largest differences over the chain of collapses that led to it. So the mesh and its coarser
//! version are joined by a continuous one-to-one map that moves no point by more than [`Level::error`]: every point of each
//! surface has a point of the other within that distance, sheets stay sheets, and what was closed stays closed. Source of
//! the idea: Cohen, Manocha and Olano, Simplifying polygonal models using successive mappings, Visualization 1997.
//!
//! Vertices are not moved: a coarser version has some of the mesh's own vertices, each with the normal that it had. No
//! triangle is made whose own normal is farther than about 40° from the normal of one of its corners, so that creases stay
//! where they are. Borders of open meshes and edges with more than two triangles stay as they are, which keeps parts of
//! one mesh that are drawn with different materials together.

mod simplify;
mod star;
#[cfg(test)]
mod tests;

use super::RenderMesh;
use crate::mesh::TriMesh;
use simplify::Surface;

/// A coarser version of a mesh.
#[derive(Clone, Debug)]
pub struct Level {
    /// Every point of each of both surfaces has a point of the other that is not farther \[m\].
    pub error: f32,
    /// The coarser version. It has no levels of its own.
    pub mesh: RenderMesh,
}

/// Meshes of fewer triangles have no coarser versions.
const MIN_TRIANGLES: usize = 1000;
/// The bound that is aimed at before the first level, so that the cheaper collapses come first \[m\].
const BEFORE: f64 = 0.0625e-3;
/// The bounds of the levels \[m\]: 1/8 mm is half a pixel at a distance of 15 cm, where the focal length is 600 pixels.
const BOUNDS: [f64; 4] = [0.125e-3, 0.25e-3, 0.5e-3, 1e-3];
/// No level has a smaller bound \[m\].
pub(super) const FINEST: f32 = 0.01e-3;
/// A level has this share of the triangles of the one before, or less; others are not worth their memory.
const WORTH: f64 = 0.8;
/// Rounding of all collapses of a vertex together, as a share of the mesh's extent: computed with 53 bits, from positions
/// that are taken over bit by bit.
const ROUNDING: f64 = 1e-7;

/// False for a mesh that has no coarser versions: it is small, collapses would pull textures along, or its vertices move.
pub(super) fn may_have_levels(mesh: &RenderMesh) -> bool {
    mesh.triangles().len() >= MIN_TRIANGLES && mesh.uvs().is_none() && !mesh.is_deformable()
}

/// The coarser versions of a mesh, the finest first.
pub(super) fn chain(mesh: &RenderMesh) -> Vec<Level> {
    let mut levels = Vec::new();
    if !may_have_levels(mesh) {
        return levels;
    }
    let [lo, hi] = mesh.bounds();
    let rounding = ROUNDING * (0..3).map(|k| f64::from(hi[k]) - f64::from(lo[k])).fold(0.0, f64::max);
    let mut surface = Surface::new(mesh);
    let mut last = mesh.triangles().len();
    surface.simplify(BEFORE - rounding);
    for bound in BOUNDS {
        // A part in a thousand for the rounding to 24 bits.
        surface.simplify(0.999 * bound - rounding);
        let count = surface.triangles().len();
        if count as f64 <= WORTH * last as f64 {
            last = count;
            let error = ((f64::from(surface.error()) + rounding) as f32).max(FINEST);
            levels.push(Level { error, mesh: prepare(mesh, surface.triangles()) });
        }
    }
    levels
}

/// Some triangles of a mesh's vertices, prepared for drawing.
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
    RenderMesh::new(&coarse, RenderMesh::CREASE)
}

//! Thin convex solids of the triangles of a mesh.

use super::pieces::{Triangle, triangles_of, unit_normal};
use super::{HullError, TriMesh};

/// A prism for each triangle that has an area: its front is the triangle, its back is `thickness` \[m\] behind it. Together they
/// have the surface of the mesh, exactly, seen from outside; where the mesh is thinner than that, they reach out behind.
/// Which side is outside a [closed](TriMesh::is_closed) mesh says itself, whichever way its triangles turn; of an open one it
/// is the side from which they turn counter-clockwise.
///
/// Triangles of less than 1e-14 m³ / `thickness`, or not higher than single precision tells their corners apart, are left
/// out: MuJoCo takes no mesh of less than 1e-15 m³.
///
/// # Errors
/// A thickness that is none; a mesh that breaks a promise of [`TriMesh`].
pub fn prisms(mesh: &TriMesh, thickness: f64) -> Result<Vec<TriMesh>, HullError> {
    /// Ten times what MuJoCo takes \[m³\].
    const LEAST: f64 = 1e-14;
    if !(thickness > 0.0 && thickness.is_finite()) {
        return Err(HullError::InvalidThickness { value: thickness });
    }
    let prism = |triangle: Triangle| {
        let normal = unit_normal(&triangle)?;
        let back = triangle.map(|p| [0, 1, 2].map(|k| p[k] - thickness * normal[k]));
        let positions: Vec<[f32; 3]> = triangle.iter().chain(&back).map(|p| p.map(|x| x as f32)).collect();
        let sides = [[0, 3, 4], [0, 4, 1], [1, 4, 5], [1, 5, 2], [2, 5, 3], [2, 3, 0]];
        let faces = [[0, 1, 2], [3, 5, 4]].into_iter().chain(sides).collect();
        let prism = TriMesh::from_triangles(positions, faces);
        // As it is in single precision: the back of a sliver may be an edge, or turned over.
        let expected = super::pieces::area(&triangle) * thickness;
        let volume = prism.signed_volume();
        (volume >= LEAST && volume >= 0.5 * expected).then_some(prism)
    };
    Ok(triangles_of(mesh)?.into_iter().filter_map(prism).collect())
}

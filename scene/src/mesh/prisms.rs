//! Thin prisms from the triangles of a mesh.

use super::convex_decomposition::{Triangle, triangles_of, unit_normal};
use super::{HullError, TriMesh};

/// Builds a prism for each triangle with an area: its front is the triangle, its back is `thickness` \[m\] behind it.
///
/// Together, the prisms have exactly the surface of the mesh, seen from outside. Where the mesh is thinner than
/// `thickness`, they stick out behind. For a [closed](TriMesh::is_closed) mesh, outside follows from the mesh, in
/// either orientation of its triangles. The triangles of an open mesh are counter-clockwise seen from outside.
///
/// Triangles below an area of 1e-14 m³ / `thickness`, or with a height that single precision does not resolve, are left
/// out. MuJoCo rejects meshes of less than 1e-15 m³.
///
/// # Errors
/// The thickness is not positive and finite, or the mesh violates an invariant of [`TriMesh`].
pub fn prisms(mesh: &TriMesh, thickness: f64) -> Result<Vec<TriMesh>, HullError> {
    /// Ten times MuJoCo's smallest volume \[m³\].
    const MIN_VOLUME: f64 = 1e-14;
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
        // The volume in single precision: the back of a sliver may be degenerate or flipped.
        let expected = super::convex_decomposition::area(&triangle) * thickness;
        let volume = prism.signed_volume();
        (volume >= MIN_VOLUME && volume >= 0.5 * expected).then_some(prism)
    };
    Ok(triangles_of(mesh)?.into_iter().filter_map(prism).collect())
}

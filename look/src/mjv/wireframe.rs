//! Edges of polygons instead of surfaces, as in MuJoCo's OpenGL renderer with `mjRND_WIREFRAME`.

use super::decor::LineView;
use super::tessellation::Facets;
use kinetoscope_scene::PoseF32;
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::shape::RenderMesh;
use kinetoscope_scene::vector::{cross, dot, sub, to_f64};

/// A mesh of strips that show the edges of polygons, in the frame of the polygons. With `culls`, it has the edges of those
/// polygons only whose front is visible. `None` if there are no edges.
pub(super) fn wire_mesh(facets: &Facets, view: &LineView, culls: bool) -> Option<RenderMesh> {
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    let mut uvs = facets.uvs.as_ref().map(|_| Vec::new());
    for polygon in &facets.polygons {
        let corners = polygon.map(|i| facets.positions[i as usize]);
        if culls && !is_front(corners, view) {
            continue;
        }
        for (k, &from) in polygon.iter().enumerate() {
            let to = polygon[(k + 1) % 4];
            if from == to {
                continue;
            }
            let [a, b] = [from, to].map(|i| i as usize);
            positions.extend(view.strip([a, b].map(|i| facets.positions[i]), 1.0));
            let [m, n] = [a, b].map(|i| facets.normals[i]);
            normals.extend([m, m, n, n]);
            if let (Some(to), Some(from)) = (&mut uvs, &facets.uvs) {
                to.extend([from[a], from[a], from[b], from[b]]);
            }
        }
    }
    if positions.is_empty() {
        return None;
    }
    let strips = 0..positions.len() as u32 / 4;
    let triangles = strips.flat_map(|k| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|corner: u32| 4 * k + corner)));
    let mesh = TriMesh::from_triangles(positions, triangles.collect());
    Some(RenderMesh::deformable(&TriMesh { normals: Some(normals), uvs, ..mesh }))
}

/// True if the camera sees the front of a polygon.
fn is_front(corners: [[f32; 3]; 4], view: &LineView) -> bool {
    let [a, b, c, d] = corners.map(to_f64);
    // Two sides of a triangle; the diagonals of a quadrilateral.
    let normal = if c == d { cross(sub(b, a), sub(c, a)) } else { cross(sub(c, a), sub(d, b)) };
    let toward = if view.parallel { to_f64(view.forward).map(|x| -x) } else { sub(to_f64(view.position), a) };
    dot(normal, toward) > 0.0
}

impl LineView {
    /// The view in the frame of an object.
    pub(super) fn in_frame(&self, world_from_object: &PoseF32) -> Self {
        let from = [0, 1, 2].map(|k| self.position[k] - world_from_object.translation[k]);
        let position = world_from_object.rotate_inverse(from);
        Self { position, forward: world_from_object.rotate_inverse(self.forward), ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mjv::tessellation::PlaneGrid;
    use kinetoscope_scene::Tessellation;
    use kinetoscope_scene::shape::{Box, Shape};

    const VIEW: LineView = LineView {
        position: [0.0, 0.0, 3.0],
        forward: [0.0, 0.0, -1.0],
        width: 0.01,
        near: 0.1,
        far: 10.0,
        parallel: false,
    };

    /// Area of all strips of a box seen from above: of each face in view, quads x quads squares with four edges each.
    #[test]
    fn edges_of_a_box() {
        let quality = Tessellation { quads: 2, ..Tessellation::default() };
        let half = [0.4, 0.3, 1.0];
        let facets =
            Facets::new(&Shape::from(Box { half }), &PlaneGrid { spacing: None, repeat: [0.0; 2], far: 1.0, quality });
        let area = |mesh: &RenderMesh| -> f64 {
            let one = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|i| to_f64(mesh.positions()[i as usize]));
                let n = cross(sub(b, a), sub(c, a));
                0.5 * dot(n, n).sqrt()
            };
            mesh.triangles().iter().map(one).sum()
        };
        // The top is 2 m below the camera, where a line is 2 x 0.01 wide; each square has edges along x and y.
        let expected = 4.0 * 2.0 * (0.4 + 0.3) * 0.02;
        let top = wire_mesh(&facets, &VIEW, true).expect("edges");
        assert!((area(&top) - expected).abs() < 1e-4 * expected, "{} {expected}", area(&top));
        let all = wire_mesh(&facets, &VIEW, false).expect("edges");
        assert_eq!(all.triangles().len(), 6 * top.triangles().len());
        // From inside, no front is visible.
        assert!(wire_mesh(&facets, &LineView { position: [0.0; 3], ..VIEW }, true).is_none());
        // Turned by half a turn about x, the camera sees the bottom, of the same size.
        let turned = PoseF32 { rotation: [[1., 0., 0.], [0., -1., 0.], [0., 0., -1.]], translation: [0.0; 3] };
        let bottom = wire_mesh(&facets, &VIEW.in_frame(&turned), true).expect("edges");
        assert!((area(&bottom) - expected).abs() < 1e-4 * expected);
        assert!(bottom.normals().iter().all(|n| *n == [0.0, 0.0, -1.0]));
    }
}

//! Vertex maps of meshes with moving vertices.

use super::RenderMesh;
use crate::vector::{add, cross, sub, try_normalize};

/// Vertex maps of a deformable mesh.
#[derive(Debug, Default)]
pub(super) struct Deformation {
    /// Vertex of the input mesh, for each vertex.
    pub(super) sources: Vec<u32>,
    /// Vertex, for each of [`RenderMesh::cluster_positions`].
    pub(super) source_vertices: Vec<u32>,
}

impl Deformation {
    pub(super) fn new(sources: Vec<u32>, mesh: &RenderMesh) -> Self {
        let mut source_vertices = vec![0; mesh.cluster_positions()[0].len()];
        for cluster in mesh.clusters() {
            let triangles = cluster.first as usize..(cluster.first + cluster.count) as usize;
            let lanes = &mut source_vertices[cluster.first_vertex as usize..][..cluster.vertex_count as usize];
            let mut count = 0;
            for (corners, triangle) in mesh.corners()[triangles.clone()].iter().zip(&mesh.triangles()[triangles]) {
                for (&corner, &vertex) in corners.iter().zip(triangle) {
                    lanes[usize::from(corner)] = vertex;
                    count = count.max(usize::from(corner) + 1);
                }
            }
            // The last vertex is repeated as padding.
            let last = count.checked_sub(1).map_or(0, |last| lanes[last]);
            lanes[count..].fill(last);
        }
        Self { sources, source_vertices }
    }
}

/// Fills `normals` with the unit normals of vertices: the mean of the adjacent triangles' normals, weighted by area.
///
/// The normal of a vertex without an adjacent area is zero.
///
/// # Panics
///
/// A triangle refers to a vertex beyond `positions` or `normals`.
pub fn smooth_normals(positions: &[[f32; 3]], triangles: &[[u32; 3]], normals: &mut [[f32; 3]]) {
    normals.fill([0.0; 3]);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| positions[i as usize]);
        let doubled = cross(sub(b, a), sub(c, a));
        for &i in triangle {
            normals[i as usize] = add(normals[i as usize], doubled);
        }
    }
    for normal in normals {
        *normal = try_normalize(*normal, 0.0).unwrap_or_default();
    }
}

//! Flexes of MuJoCo 4 (cables, cloth and solids), rendered as in its viewers.
//!
//! Source: `mjv_updateActiveFlex` of `engine_vis_visualize.c` and `render_gl3.c` with the default options. A cable is a
//! round bar along each edge. Cloth has two sides, a radius away from its elements along smooth normals, and a rim. For
//! a solid the boundary is rendered, a radius outside.

use super::{Scratch, Segment};
use kinetoscope_mujoco::{Data, FlexArrays};
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::shape::smooth_normals;
use kinetoscope_scene::vector::{cross, sub, try_normalize};
use std::collections::HashMap;

/// Flex of one dimension.
#[derive(Clone, Debug)]
pub(super) struct Cable(usize);

impl Cable {
    pub(super) fn of(flex: usize) -> Self {
        Self(flex)
    }

    pub(super) fn segments(&self, data: &Data, each: &mut dyn FnMut(Segment)) {
        let Some(flex) = data.model().flex(self.0) else { return };
        let points = points(data, flex.first_vertex, flex.vertices);
        let at = |vertex: i32| usize::try_from(vertex).ok().and_then(|vertex| points.get(vertex)).copied();
        for &[a, b] in flex.edges {
            if let (Some(a), Some(b)) = (at(a), at(b)) {
                each(Segment { ends: [a, b], radius: flex.radius });
            }
        }
    }
}

/// Positions of the vertices of a flex in the environment \[m\]; empty if the data contains no such vertices.
fn points(data: &Data, first: usize, count: usize) -> &[[f64; 3]] {
    data.flex_vertices().get(first..first + count).unwrap_or(&[])
}

/// Flex of two or three dimensions: the vertices of the rendered mesh, each beside a vertex of the flex.
#[derive(Clone, Debug)]
pub(super) struct Cloth {
    first_vertex: usize,
    /// Triangles of flex vertices, whose normals are averaged.
    faces: Vec<[u32; 3]>,
    count: usize,
    corners: Vec<FlexVertex>,
    /// Triangles of the rendered mesh, as indices of `corners`.
    triangles: Vec<[u32; 3]>,
}

/// Vertex of the rendered mesh.
#[derive(Clone, Copy, Debug)]
struct FlexVertex {
    /// Index of the vertex in the flex.
    vertex: u32,
    /// Distance along the smooth normal \[m\].
    offset: f32,
    /// Side of the smooth normal on which its own normal is; 0 for a vertex with the normal of its triangle.
    side: f32,
}

/// Collector of the vertices of the rendered mesh: one for each position, side and texture coordinate.
struct FlexMeshBuilder<'a> {
    flex: &'a FlexArrays<'a>,
    known: HashMap<(u32, i32, u32, u32), u32>,
    corners: Vec<FlexVertex>,
    uvs: Vec<[f32; 2]>,
    triangles: Vec<[u32; 3]>,
}

/// Triangle number of vertices with smooth normals, which triangles share.
const SHARED: u32 = u32::MAX;

impl FlexMeshBuilder<'_> {
    /// Adds a triangle of flex vertices, each on a side of the flex, with their texture coordinates.
    fn add(&mut self, vertices: [(u32, i32); 3], texcoords: [u32; 3], smooth: bool) {
        let number = if smooth { SHARED } else { self.triangles.len() as u32 };
        let triangle = [0, 1, 2].map(|k| {
            let ((vertex, side), texcoord) = (vertices[k], texcoords[k]);
            let texcoord = if self.flex.texcoords.is_empty() { 0 } else { texcoord };
            *self.known.entry((vertex, side, texcoord, number)).or_insert_with(|| {
                let offset = side as f32 * self.flex.radius as f32;
                self.corners.push(FlexVertex { vertex, offset, side: if smooth { side as f32 } else { 0.0 } });
                let [u, v] = self.flex.texcoords.get(texcoord as usize).copied().unwrap_or_default();
                // MuJoCo's v axis points down the image.
                self.uvs.push([u, 1.0 - v]);
                self.corners.len() as u32 - 1
            })
        });
        self.triangles.push(triangle);
    }
}

impl Cloth {
    /// Converts a flex. The mesh for rendering has all vertices at one position at first.
    pub(super) fn of(flex: &FlexArrays<'_>) -> (Self, TriMesh) {
        let count = flex.vertices;
        let index = |n: i32| u32::try_from(n).unwrap_or(u32::MAX);
        let exists = |vertices: &[u32]| vertices.iter().all(|&vertex| (vertex as usize) < count);
        let mut builder = FlexMeshBuilder {
            flex,
            known: HashMap::new(),
            corners: Vec::new(),
            uvs: Vec::new(),
            triangles: Vec::new(),
        };
        let mut faces = Vec::new();
        let smooth = !flex.flat_shading;
        if flex.dimensions == 2 {
            for (element, texcoords) in
                flex.elements.as_chunks::<3>().0.iter().zip(flex.element_texcoords.as_chunks::<3>().0)
            {
                let (e @ [a, b, c], t) = (element.map(index), texcoords.map(index));
                if !exists(&e) {
                    continue;
                }
                faces.push(e);
                builder.add([(a, 1), (b, 1), (c, 1)], t, smooth);
                builder.add([(a, -1), (c, -1), (b, -1)], [t[0], t[2], t[1]], smooth);
            }
            for piece in flex.shell.as_chunks::<2>().0 {
                let e @ [a, b] = piece.map(index);
                if exists(&e) && flex.radius > 0.0 {
                    builder.add([(a, 1), (b, -1), (b, 1)], [a, b, b], false);
                    builder.add([(b, -1), (a, 1), (a, -1)], [b, a, a], false);
                }
            }
        } else {
            for piece in flex.shell.as_chunks::<3>().0 {
                let e @ [a, b, c] = piece.map(index);
                if exists(&e) {
                    faces.push(e);
                    builder.add([(a, 1), (b, 1), (c, 1)], e, smooth);
                }
            }
        }
        let FlexMeshBuilder { corners, uvs, triangles, .. } = builder;
        let mut mesh = TriMesh::from_triangles(vec![[0.0; 3]; corners.len()], triangles.clone());
        mesh.uvs = (!flex.texcoords.is_empty()).then_some(uvs);
        (Self { first_vertex: flex.first_vertex, faces, count, corners, triangles }, mesh)
    }

    pub(super) fn vertices(&self, data: &Data, scratch: &mut Scratch) {
        let points = points(data, self.first_vertex, self.count);
        let Scratch { positions, normals, of_flex: [places, smooth], .. } = scratch;
        places.clear();
        places.extend(points.iter().map(|p| p.map(|x| x as f32)));
        places.resize(self.count, [0.0; 3]);
        smooth.resize(self.count, [0.0; 3]);
        mean_normals(places, &self.faces, smooth);
        positions.clear();
        positions.extend(self.corners.iter().map(|corner| {
            let (at, normal) = (places[corner.vertex as usize], smooth[corner.vertex as usize]);
            [0, 1, 2].map(|k| at[k] + corner.offset * normal[k])
        }));
        normals.resize(positions.len(), [0.0; 3]);
        // Corners without a smooth normal belong to one triangle.
        smooth_normals(positions, &self.triangles, normals);
        for (normal, corner) in normals.iter_mut().zip(&self.corners).filter(|(_, corner)| corner.side != 0.0) {
            *normal = smooth[corner.vertex as usize].map(|x| corner.side * x);
        }
    }
}

/// Computes the mean of the unit normals of the triangles around each vertex, normalized to length 1.
fn mean_normals(positions: &[[f32; 3]], triangles: &[[u32; 3]], normals: &mut [[f32; 3]]) {
    let unit = |v: [f64; 3]| try_normalize(v, 0.0).unwrap_or_default();
    normals.fill([0.0; 3]);
    for triangle in triangles {
        let [p, q, r] = triangle.map(|i| positions[i as usize].map(f64::from));
        let normal = unit(cross(sub(q, p), sub(r, p)));
        for &i in triangle {
            let sum = &mut normals[i as usize];
            *sum = [0, 1, 2].map(|k| sum[k] + normal[k] as f32);
        }
    }
    for normal in normals {
        *normal = unit(normal.map(f64::from)).map(|x| x as f32);
    }
}

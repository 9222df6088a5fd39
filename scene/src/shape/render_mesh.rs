//! Triangles prepared for rendering: normals, clusters, bounds, levels of detail.

use super::crease::{corner_normals, face_normals, unit, weld};
use super::deformation::Deformation;
use super::lod::{self, LodLevel};
use crate::mesh::{Submesh, TriMesh};
use crate::vector::{add, dot, sub};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// A mesh prepared for rendering, once per asset and shared by all environments.
///
/// Triangles are sorted along a space-filling curve and split into [`Cluster`]s of at most
/// [`RenderMesh::MAX_CLUSTER_TRIANGLES`] triangles, which the rasterizer culls and transforms.
#[derive(Clone, Debug, Default)]
pub struct RenderMesh {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Option<Vec<[f32; 2]>>,
    triangles: Vec<[u32; 3]>,
    clusters: Vec<Cluster>,
    cluster_positions: [Vec<f32>; 3],
    corners: Vec<[u8; 3]>,
    bounds: [[f32; 3]; 2],
    levels: OnceLock<Vec<LodLevel>>,
    /// Vertex maps of a deformable mesh; `None` for a rigid mesh.
    deformation: Option<Arc<Deformation>>,
}

/// A group of neighboring triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct Cluster {
    /// Index of the first triangle in [`RenderMesh::triangles`].
    pub first: u32,
    /// Number of triangles.
    pub count: u32,
    /// Index of the first vertex in [`RenderMesh::cluster_positions`].
    pub first_vertex: u32,
    /// Number of vertices, padded to a multiple of 16 by repeating the last one.
    pub vertex_count: u32,
    /// Center of the bounding sphere in the frame of the mesh \[m\].
    pub center: [f32; 3],
    /// Radius of the bounding sphere \[m\].
    pub radius: f32,
    /// True if every triangle belongs to a closed surface with its front outside, so that no back face is visible from
    /// outside. False for deformable meshes.
    pub closed: bool,
    /// Axis of the cone that contains the normals of all triangles; unit vector in the frame of the mesh.
    pub cone_axis: [f32; 3],
    /// Cosine of the half angle of that cone; -1 if there is no useful cone.
    pub cone_cos: f32,
}

impl RenderMesh {
    /// Crease angle of meshes without normals \[rad\]: 30°. Chamfers of CAD parts (45°) stay sharp, cylinders of 16
    /// sides (22.5°) look round.
    pub const DEFAULT_CREASE_ANGLE: f32 = std::f32::consts::FRAC_PI_6;
    /// Largest number of triangles per cluster.
    pub const MAX_CLUSTER_TRIANGLES: usize = 64;

    /// Prepares all triangles. If the mesh has no normals, they are smooth up to the `crease` angle \[rad\].
    ///
    /// # Panics
    ///
    /// If `mesh` violates an invariant of [`TriMesh`].
    pub fn new(mesh: &TriMesh, crease: f32) -> Self {
        let welded = weld(&mesh.positions);
        let closed = closed_triangles(mesh, &welded);
        Self::prepare(mesh, crease, &welded, &closed)
    }

    /// Prepares a closed surface whose vertices are at different positions, such as a height field.
    ///
    /// This takes a fraction of the time of [`new`](Self::new), because it searches for neither edges nor positions.
    pub(super) fn from_closed(mesh: &TriMesh, crease: f32) -> Self {
        let welded: Vec<u32> = (0..mesh.positions.len() as u32).collect();
        Self::prepare(mesh, crease, &welded, &vec![true; mesh.triangles.len()])
    }

    /// Prepares all triangles. `welded` has for each vertex the first vertex at the same position; `closed` is true for
    /// triangles of closed surfaces.
    fn prepare(mesh: &TriMesh, crease: f32, welded: &[u32], closed: &[bool]) -> Self {
        /// Marks a missing vertex.
        const NONE: u32 = u32::MAX;
        let faces = face_normals(mesh);
        let corner_normals = corner_normals(mesh, welded, &faces, crease);
        let order = drawing_order(mesh);
        let mut out = Self { uvs: mesh.uvs.as_ref().map(|_| Vec::new()), ..Self::default() };
        let vertices = mesh.positions.len();
        out.positions.reserve(vertices);
        out.normals.reserve(vertices);
        out.triangles.reserve(order.len());
        out.corners.reserve(order.len());
        out.clusters.reserve(order.len().div_ceil(Self::MAX_CLUSTER_TRIANGLES));
        out.cluster_positions.iter_mut().for_each(|lane| lane.reserve(order.len() * 3 / 4));
        out.bounds = mesh.bounds().map_or([[0.; 3]; 2], |(lo, hi)| [lo, hi]);
        // Vertices that were made from each vertex of `mesh`, one for each normal, as linked lists: the last one, and
        // the previous one of each.
        let (mut last, mut before) = (vec![NONE; vertices], Vec::with_capacity(vertices));
        let mut places = Vec::with_capacity(vertices);
        for &k in &order {
            let (t, normals) = (mesh.triangles[k as usize], corner_normals[k as usize]);
            let triangle = [0, 1, 2].map(|c| {
                let (i, n) = (t[c] as usize, normals[c]);
                let mut at = last[i];
                while at != NONE && out.normals[at as usize].map(f32::to_bits) != n.map(f32::to_bits) {
                    at = before[at as usize];
                }
                if at != NONE {
                    return at;
                }
                out.positions.push(mesh.positions[i]);
                out.normals.push(n);
                if let (Some(to), Some(from)) = (&mut out.uvs, &mesh.uvs) {
                    to.push(from[i]);
                }
                places.push(welded[i]);
                before.push(last[i]);
                last[i] = out.positions.len() as u32 - 1;
                last[i]
            });
            out.triangles.push(triangle);
        }
        // For each position, the last cluster that contains it, and the number of its vertex there.
        let mut known = vec![(NONE, 0u8); mesh.positions.len()];
        for (cluster, first) in (0..).zip((0..order.len()).step_by(Self::MAX_CLUSTER_TRIANGLES)) {
            let end = (first + Self::MAX_CLUSTER_TRIANGLES).min(order.len());
            let all_closed = order[first..end].iter().all(|&k| closed[k as usize]);
            let faces = order[first..end].iter().map(|&k| faces[k as usize]);
            out.push_cluster(first..end, all_closed, faces, |vertex, next| {
                let known = &mut known[places[vertex as usize] as usize];
                let is_new = known.0 != cluster;
                if is_new {
                    *known = (cluster, next);
                }
                (known.1, is_new)
            });
        }
        out
    }

    /// Prepares a mesh whose vertices [`deform`](Self::deform) will move.
    ///
    /// Every vertex has one normal: that of `mesh` or, if it has none, the mean of its triangles' normals, weighted by
    /// area. Both sides of the triangles are visible. The mesh has no coarser [levels](Self::levels).
    ///
    /// # Panics
    ///
    /// If `mesh` violates an invariant of [`TriMesh`].
    pub fn deformable(mesh: &TriMesh) -> Self {
        let normals = mesh.normals.clone().unwrap_or_else(|| {
            let mut normals = vec![[0.0; 3]; mesh.positions.len()];
            super::smooth_normals(&mesh.positions, &mesh.triangles, &mut normals);
            normals
        });
        // With one normal, a vertex stays one vertex. A vertex without an adjacent area gets an arbitrary normal.
        let some = |n: [f32; 3]| unit(n).unwrap_or([0.0, 0.0, 1.0]);
        let mesh = &TriMesh { normals: Some(normals.into_iter().map(some).collect()), ..mesh.clone() };
        // Vertices at the same position may separate.
        let welded: Vec<u32> = (0..mesh.positions.len() as u32).collect();
        let mut out = Self::prepare(mesh, Self::DEFAULT_CREASE_ANGLE, &welded, &vec![false; mesh.triangles.len()]);
        let mut sources = vec![0; out.positions.len()];
        for (ours, k) in out.triangles.iter().zip(drawing_order(mesh)) {
            let theirs = mesh.triangles[k as usize];
            (0..3).for_each(|c| sources[ours[c] as usize] = theirs[c]);
        }
        out.deformation = Some(Arc::new(Deformation::new(sources, &out)));
        out
    }

    /// True if [`deform`](Self::deform) can move the vertices.
    pub fn is_deformable(&self) -> bool {
        self.deformation.is_some()
    }

    /// Moves the vertices: `positions` \[m\] and `normals`, of length 1 or 0, are in the order of the input mesh.
    ///
    /// Does not allocate.
    ///
    /// # Panics
    ///
    /// The mesh is not [deformable](Self::deformable), or there are fewer positions or normals than vertices.
    #[track_caller]
    pub fn deform(&mut self, positions: &[[f32; 3]], normals: &[[f32; 3]]) {
        let Some(deformation) = self.deformation.clone() else { panic!("the mesh was not built as deformable") };
        for (k, &source) in deformation.sources.iter().enumerate() {
            let normal = normals[source as usize];
            self.positions[k] = positions[source as usize];
            self.normals[k] = if normal == [0.0; 3] { [0.0, 0.0, 1.0] } else { normal };
        }
        for (lane, &vertex) in deformation.source_vertices.iter().enumerate() {
            (0..3).for_each(|a| self.cluster_positions[a][lane] = self.positions[vertex as usize][a]);
        }
        let mut all = [[f32::MAX; 3], [f32::MIN; 3]];
        for cluster in &mut self.clusters {
            let lanes = cluster.first_vertex as usize..(cluster.first_vertex + cluster.vertex_count) as usize;
            let mut here = [[f32::MAX; 3], [f32::MIN; 3]];
            for a in 0..3 {
                for &x in &self.cluster_positions[a][lanes.clone()] {
                    (here[0][a], here[1][a]) = (here[0][a].min(x), here[1][a].max(x));
                }
                (all[0][a], all[1][a]) = (all[0][a].min(here[0][a]), all[1][a].max(here[1][a]));
            }
            cluster.center = [0, 1, 2].map(|a| (here[0][a] + here[1][a]) / 2.0);
            let far = lanes
                .map(|i| sub([0, 1, 2].map(|a| self.cluster_positions[a][i]), cluster.center))
                .fold(0.0f32, |m, d| m.max(dot(d, d).sqrt()));
            // Slightly enlarged, so that rounding never culls.
            cluster.radius = far * 1.0001;
            // Both sides are visible.
            (cluster.cone_axis, cluster.cone_cos) = ([0.0, 0.0, 1.0], -1.0);
        }
        self.bounds = if self.clusters.is_empty() { [[0.0; 3]; 2] } else { all };
    }

    /// Prepares the triangles of one part (one material) of a mesh; `crease` as in [`new`](Self::new).
    ///
    /// # Panics
    ///
    /// If `part` or `mesh` violates an invariant of [`TriMesh`].
    pub fn from_submesh(mesh: &TriMesh, part: &Submesh, crease: f32) -> Self {
        let triangles = mesh.triangles[part.triangles.clone()].to_vec();
        let mut map = HashMap::new();
        let mut out = TriMesh { normals: mesh.normals.as_ref().map(|_| vec![]), ..TriMesh::default() };
        out.uvs = mesh.uvs.as_ref().map(|_| vec![]);
        for t in triangles {
            let t = t.map(|i| {
                *map.entry(i).or_insert_with(|| {
                    out.positions.push(mesh.positions[i as usize]);
                    if let (Some(to), Some(from)) = (&mut out.normals, &mesh.normals) {
                        to.push(from[i as usize]);
                    }
                    if let (Some(to), Some(from)) = (&mut out.uvs, &mesh.uvs) {
                        to.push(from[i as usize]);
                    }
                    out.positions.len() as u32 - 1
                })
            });
            out.triangles.push(t);
        }
        Self::new(&out, crease)
    }

    /// Adds a cluster of the triangles in the given range. `faces` are their unit normals, zero for triangles without
    /// an area; `closed` is [`Cluster::closed`].
    ///
    /// `number(vertex, next)` returns the number of a vertex in the cluster, and true if the vertex is new; a new
    /// vertex gets `next`.
    fn push_cluster(
        &mut self,
        Range { start: first, end }: Range<usize>,
        closed: bool,
        faces: impl Iterator<Item = [f32; 3]> + Clone,
        mut number: impl FnMut(u32, u8) -> (u8, bool),
    ) {
        let first_lane = self.cluster_positions[0].len();
        let (mut lo, mut hi) = ([f32::MAX; 3], [f32::MIN; 3]);
        let faces = faces.filter(|&n| n != [0.0; 3]);
        let axis = faces.clone().fold([0.0f32; 3], add);
        for k in first..end {
            let triangle = self.triangles[k];
            let p = triangle.map(|i| self.positions[i as usize]);
            let corner = [0, 1, 2].map(|c| {
                let next = (self.cluster_positions[0].len() - first_lane) as u8;
                let (number, is_new) = number(triangle[c], next);
                if is_new {
                    for a in 0..3 {
                        self.cluster_positions[a].push(p[c][a]);
                        (lo[a], hi[a]) = (lo[a].min(p[c][a]), hi[a].max(p[c][a]));
                    }
                }
                number
            });
            self.corners.push(corner);
        }
        let lane_count = (self.cluster_positions[0].len() - first_lane).next_multiple_of(16);
        for lane in &mut self.cluster_positions {
            let last = lane.last().copied().unwrap_or(0.0);
            lane.resize(first_lane + lane_count, last);
        }
        let center = [0, 1, 2].map(|a| (lo[a] + hi[a]) / 2.0);
        let far = (first_lane..first_lane + lane_count)
            .map(|i| sub([0, 1, 2].map(|a| self.cluster_positions[a][i]), center))
            .fold(0.0f32, |m, d| m.max(dot(d, d).sqrt()));
        let cone_axis = unit(axis).unwrap_or([0., 0., 1.]);
        let cone_cos = faces.map(|n| dot(n, cone_axis)).fold(1.0, f32::min);
        self.clusters.push(Cluster {
            first: first as u32,
            count: (end - first) as u32,
            first_vertex: first_lane as u32,
            vertex_count: lane_count as u32,
            center,
            // Slightly enlarged, so that rounding never culls.
            radius: far * 1.0001,
            closed,
            cone_axis,
            cone_cos: if cone_cos > 0.05 { cone_cos - 1e-3 } else { -1.0 },
        });
    }

    /// Vertex positions in the frame of the mesh \[m\]. A vertex of the input occurs once for each of its normals.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// Unit normals, one per vertex, in the frame of the mesh; 0 for a triangle without an area in a mesh without
    /// normals of its own.
    pub fn normals(&self) -> &[[f32; 3]] {
        &self.normals
    }

    /// Texture coordinates, one pair per vertex, origin at the lower left of the image; `None` if the input has none.
    pub fn uvs(&self) -> Option<&[[f32; 2]]> {
        self.uvs.as_deref()
    }

    /// Vertex indices of each triangle, in drawing order.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Clusters, which cover the triangles consecutively.
    pub fn clusters(&self) -> &[Cluster] {
        &self.clusters
    }

    /// Positions of the clusters' vertices in the frame of the mesh \[m\], one array per axis.
    pub fn cluster_positions(&self) -> &[Vec<f32>; 3] {
        &self.cluster_positions
    }

    /// Corners of each triangle, as vertex numbers in its cluster.
    pub fn corners(&self) -> &[[u8; 3]] {
        &self.corners
    }

    /// Smallest and largest coordinates in the frame of the mesh \[m\]; zero without triangles.
    pub fn bounds(&self) -> [[f32; 3]; 2] {
        self.bounds
    }

    /// Levels of detail, the finest first, each with a bound of at most 1 mm on its distance from the mesh.
    ///
    /// They are computed when they are first requested (about 2 µs for each triangle) and shared by all holders of the
    /// mesh. Meshes with fewer than 1000 triangles, with texture coordinates or with moving vertices have no levels.
    pub fn levels(&self) -> &[LodLevel] {
        self.levels.get_or_init(|| lod::build_levels(self))
    }

    /// Number of the coarsest level whose [`LodLevel::error`] is at most `error` \[m\]: 0 is the mesh itself, n the
    /// element n - 1 of [`levels`](Self::levels).
    ///
    /// Computes the levels only if one of them may qualify.
    pub fn level_within(&self, error: f32) -> usize {
        let may = error >= lod::MIN_BOUND && lod::may_have_levels(self);
        if may { self.levels().iter().take_while(|level| level.error <= error).count() } else { 0 }
    }

    /// Returns the level with a number of [`RenderMesh::level_within`]. The mesh itself is returned for 0, for numbers
    /// without a level, and while the levels are not computed.
    #[inline]
    pub fn level(&self, number: usize) -> &Self {
        let level = |index: usize| self.levels.get().and_then(|levels| levels.get(index));
        number.checked_sub(1).and_then(level).map_or(self, |level| &level.mesh)
    }

    /// [`LodLevel::error`] of level `number` \[m\], numbered as in [`level_within`](Self::level_within). 0 for the mesh
    /// itself, for numbers without a level, and while the levels are not computed.
    pub fn level_error(&self, number: usize) -> f32 {
        let level = |index: usize| self.levels.get().and_then(|levels| levels.get(index));
        number.checked_sub(1).and_then(level).map_or(0.0, |level| level.error)
    }

    /// Converts the mesh back to a [`TriMesh`] of one submesh without a material, in drawing order.
    pub fn to_tri_mesh(&self) -> TriMesh {
        let mut mesh = TriMesh::from_triangles(self.positions.clone(), self.triangles.clone());
        mesh.normals = Some(self.normals.clone());
        mesh.uvs.clone_from(&self.uvs);
        mesh
    }
}

/// Indices of the triangles in drawing order.
fn drawing_order(mesh: &TriMesh) -> Vec<u32> {
    let mut order: Vec<u64> =
        morton_codes(mesh).into_iter().zip(0..).map(|(code, k)| u64::from(code) << 32 | k).collect();
    order.sort_unstable();
    order.into_iter().map(|place| place as u32).collect()
}

/// Position of each triangle on a space-filling curve (Morton code of its center, 10 bits per axis).
fn morton_codes(mesh: &TriMesh) -> Vec<u32> {
    let (lo, hi) = mesh.bounds().unwrap_or_default();
    let extent = (0..3).map(|a| hi[a] - lo[a]).fold(1e-30, f32::max);
    let code = |t: &[u32; 3]| {
        (0..3).fold(0, |code, a| {
            let middle = t.iter().map(|&i| mesh.positions[i as usize][a]).sum::<f32>() / 3.0;
            code | spread_bits((((middle - lo[a]) / extent) * 1023.0) as u32) << a
        })
    };
    mesh.triangles.iter().map(code).collect()
}

/// Spreads the lowest 10 bits of a number: bit n becomes bit 3 n.
pub(super) fn spread_bits(mut v: u32) -> u32 {
    for (shift, kept) in [(16, 0x0300_00ff), (8, 0x0300_f00f), (4, 0x030c_30c3), (2, 0x0924_9249)] {
        v = (v | v << shift) & kept;
    }
    v
}

/// True for triangles of a connected surface in which every edge has exactly one neighbor with the opposite direction,
/// and that encloses a positive volume.
fn closed_triangles(mesh: &TriMesh, welded: &[u32]) -> Vec<bool> {
    let mut edges: HashMap<(u32, u32), u32> = HashMap::with_capacity(mesh.triangles.len() * 3);
    let corners = |t: &[u32; 3]| t.map(|i| welded[i as usize]);
    for t in &mesh.triangles {
        let t = corners(t);
        for k in 0..3 {
            *edges.entry((t[k], t[(k + 1) % 3])).or_default() += 1;
        }
    }
    let mut parent: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    for t in &mesh.triangles {
        let t = corners(t);
        for k in 1..3 {
            let (a, b) = (root(&mut parent, t[0]), root(&mut parent, t[k]));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    // Per component: true while it is closed, and six times its volume.
    let mut components: HashMap<u32, (bool, f64)> = HashMap::new();
    let middle = mesh.bounds().map_or([0.; 3], |(lo, hi)| [0, 1, 2].map(|a| f64::from(lo[a] + hi[a]) / 2.0));
    for t in &mesh.triangles {
        let w = corners(t);
        let whole = (0..3).all(|k| {
            let (a, b) = (w[k], w[(k + 1) % 3]);
            a != b && edges.get(&(a, b)) == Some(&1) && edges.get(&(b, a)) == Some(&1)
        });
        let p = t.map(|i| [0, 1, 2].map(|a| f64::from(mesh.positions[i as usize][a]) - middle[a]));
        let six = p[0][0] * (p[1][1] * p[2][2] - p[1][2] * p[2][1])
            + p[0][1] * (p[1][2] * p[2][0] - p[1][0] * p[2][2])
            + p[0][2] * (p[1][0] * p[2][1] - p[1][1] * p[2][0]);
        let entry = components.entry(root(&mut parent, w[0])).or_insert((true, 0.0));
        *entry = (entry.0 && whole, entry.1 + six);
    }
    let of = |t: &[u32; 3]| {
        let component = root(&mut parent, corners(t)[0]);
        components.get(&component).is_some_and(|&(whole, six)| whole && six > 0.0)
    };
    mesh.triangles.iter().map(of).collect()
}

//! Sequences of collapses, in an order that keeps the bounds small.

use super::super::RenderMesh;
use super::super::crease::weld;
use super::star::{BestCollapse, Fan, Star};

/// Largest number of rounds of collapses for one bound.
const MAX_ROUNDS: usize = 40;
/// A round that removes a smaller fraction of the vertices is the last one.
const MIN_REMOVED_RATIO: f64 = 0.02;

/// Triangles of a mesh during its simplification.
#[derive(Clone, Debug)]
pub(super) struct Surface<'a> {
    mesh: &'a RenderMesh,
    /// For every corner of the mesh, the first corner at the same position: its vertex.
    vertex: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    /// Bound of each triangle \[m\].
    error: Vec<f32>,
    /// Triangles around each vertex, with the vertex's corner in each: `around[start[v]..start[v + 1]]`.
    start: Vec<u32>,
    around: Vec<(u32, u8)>,
    /// Smallest known bound of a collapse of each vertex \[m\]; 0 if unknown, infinite if no collapse is possible.
    min_error: Vec<f32>,
}

impl<'a> Surface<'a> {
    pub(super) fn new(mesh: &'a RenderMesh) -> Self {
        let vertex = weld(mesh.positions());
        let flat = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| vertex[i as usize]);
            a == b || b == c || c == a
        };
        // Triangles without an area are never drawn, and their two other edges coincide.
        let triangles: Vec<[u32; 3]> = mesh.triangles().iter().filter(|t| !flat(t)).copied().collect();
        let count = mesh.positions().len();
        let error = vec![0.0; triangles.len()];
        let (start, around, min_error) = (vec![0; count + 1], Vec::new(), vec![0.0; count]);
        Self { mesh, vertex, triangles, error, start, around, min_error }
    }

    pub(super) fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Largest bound of all triangles \[m\].
    pub(super) fn error(&self) -> f32 {
        self.error.iter().copied().fold(0.0, f32::max)
    }

    #[inline]
    pub(super) fn error_of(&self, triangle: u32) -> f64 {
        f64::from(self.error[triangle as usize])
    }

    /// Triangles around a vertex, with the vertex's corner in each.
    #[inline]
    pub(super) fn around(&self, vertex: u32) -> &[(u32, u8)] {
        &self.around[self.start[vertex as usize] as usize..self.start[vertex as usize + 1] as usize]
    }

    /// Corner of a triangle. Corners 3 and 4 are the corners 0 and 1.
    #[inline]
    pub(super) fn corner(&self, triangle: u32, corner: u8) -> u32 {
        self.triangles[triangle as usize][usize::from(if corner < 3 { corner } else { corner - 3 })]
    }

    /// Vertex at a corner of a triangle.
    #[inline]
    pub(super) fn vertex_of(&self, triangle: u32, corner: u8) -> u32 {
        self.vertex[self.corner(triangle, corner) as usize]
    }

    #[inline]
    pub(super) fn position(&self, vertex: u32) -> [f64; 3] {
        self.mesh.positions()[vertex as usize].map(f64::from)
    }

    #[inline]
    pub(super) fn normal(&self, corner: u32) -> [f32; 3] {
        self.mesh.normals()[corner as usize]
    }

    /// Collapses vertices while no triangle's bound exceeds `bound` \[m\].
    pub(super) fn simplify(&mut self, bound: f64) {
        for _ in 0..MAX_ROUNDS {
            let (vertices, removed) = self.collapse_round(bound);
            if (removed as f64) < MIN_REMOVED_RATIO * vertices as f64 || removed == 0 {
                break;
            }
        }
    }

    /// Runs one round in the order of the vertices.
    ///
    /// Each vertex is tried once, unless another collapse changed its surroundings. Returns the number of vertices
    /// before the round, and the number of removed ones.
    fn collapse_round(&mut self, bound: f64) -> (usize, usize) {
        self.connect();
        let (mut star, mut fan) = (Star::empty(), Fan::empty());
        let mut changed = vec![false; self.min_error.len()];
        let (mut vertices, mut removed) = (0, 0);
        for v in 0..self.min_error.len() as u32 {
            if self.around(v).is_empty() {
                continue;
            }
            vertices += 1;
            if changed[v as usize] || f64::from(self.min_error[v as usize]) > bound {
                continue;
            }
            let best =
                if star.load(self, v) { star.best(self, &mut fan, &changed, bound) } else { BestCollapse::Impossible };
            match best {
                BestCollapse::WithinBound(onto) => {
                    for &w in star.ring[..star.count].iter().chain([&v]) {
                        (changed[w as usize], self.min_error[w as usize]) = (true, 0.0);
                    }
                    self.apply(&star, onto, &fan);
                    removed += 1;
                }
                BestCollapse::ExceedsBound(error) => self.min_error[v as usize] = error as f32,
                BestCollapse::Impossible => self.min_error[v as usize] = f32::INFINITY,
                BestCollapse::Unknown => {}
            }
        }
        self.remove_dead_triangles();
        (vertices, removed)
    }

    fn apply(&mut self, star: &Star, onto: usize, fan: &Fan) {
        for j in 0..star.count {
            let (triangle, corner) = star.triangles[(onto + j) % star.count];
            let corners = &mut self.triangles[triangle as usize];
            if j == 0 || j == star.count - 1 {
                *corners = [u32::MAX; 3];
            } else {
                corners[usize::from(corner)] = fan.corner[j];
                self.error[triangle as usize] = (fan.error[j] as f32).next_up();
            }
        }
    }

    /// Removes triangles that have vanished.
    fn remove_dead_triangles(&mut self) {
        let Self { triangles, error, .. } = self;
        let alive = |t: &[u32; 3]| t[0] != u32::MAX;
        let mut kept = triangles.iter().map(alive);
        error.retain(|_| kept.next() == Some(true));
        triangles.retain(alive);
    }

    /// Rebuilds `start` and `around`, the lists of triangles around each vertex.
    fn connect(&mut self) {
        let Self { vertex, triangles, start, around, .. } = self;
        start.fill(0);
        let vertex = |i: u32| vertex[i as usize] as usize;
        for &i in triangles.as_flattened() {
            start[vertex(i) + 1] += 1;
        }
        for v in 1..start.len() {
            start[v] += start[v - 1];
        }
        around.clear();
        around.resize(3 * triangles.len(), (0, 0));
        let mut fill = start.clone();
        for (k, t) in triangles.iter().enumerate() {
            for (c, &i) in t.iter().enumerate() {
                let slot = &mut fill[vertex(i)];
                around[*slot as usize] = (k as u32, c as u8);
                *slot += 1;
            }
        }
    }
}

//! Convex hulls with a bounded number of vertices.
//!
//! The algorithm is Quickhull that always adds the point farthest outside the current hull. Stopped early, it therefore
//! gives a good coarse hull. Its vertices are input points, so the hull never extends beyond the true hull.
//!
//! The side of a plane on which a point lies is decided exactly: points are snapped to a grid of 2^38 steps across
//! their extent (4e-12 of it, far below what `f32` coordinates resolve), where planes are integers. With rounding
//! instead, faces of CAD parts with many points in one plane give slivers with arbitrary normals.

use serde::{Deserialize, Serialize};
use std::collections::{BTreeSet, BinaryHeap, HashMap};

use super::{HullError, TriMesh};
use crate::vector::{cross, dot, norm, sub};

/// Version of the algorithm. It changes whenever the same input may give another hull; part of the key of
/// [`super::HullCache`].
pub(super) const ALGORITHM_VERSION: u32 = 1;

/// Smallest tolerance, as a fraction of the diagonal: less than half a unit in the last place of `f32`.
const RESOLUTION: f64 = 1e-8;

/// Grid steps across the largest extent, as a power of two. Planes then fit into 79 bits, and their products with
/// differences of points into 120.
const GRID_BITS: i32 = 38;

/// Simplification of a convex hull.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HullCfg {
    /// Largest number of vertices, at least 4. Contact tests cost time per vertex.
    pub max_vertices: usize,
    /// Largest distance of an omitted point from the hull, as a fraction of the diagonal of the bounding box.
    ///
    /// At least 0, which acts as 1e-8 (less than `f32` resolves), and less than 1. The default 1e-4 is 0.03 mm on a
    /// link of 0.3 m: below the tolerances of robot parts, above the noise of a tessellated cylinder.
    pub tolerance: f64,
    /// Thickness of the hull of a flat point set \[m\], half on each side of its plane (in a convex decomposition: all
    /// of it behind the front). Flat means thinner than the tolerance. With `None`, a flat point set is an error.
    #[serde(with = "crate::file_format::or_false")]
    pub min_thickness: Option<f64>,
}

impl Default for HullCfg {
    fn default() -> Self {
        Self { max_vertices: 64, tolerance: 1e-4, min_thickness: Some(1e-3) }
    }
}

/// Computes the convex hull of points: closed, convex, with outward-facing triangles. Equal inputs give equal hulls.
///
/// Unless `max_vertices` stops the algorithm, no point is farther outside than the tolerance.
///
/// # Errors
/// The configuration is out of range, a coordinate is not finite, or the points are fewer than four, coincident,
/// collinear, or coplanar without [`HullCfg::min_thickness`].
pub fn convex_hull(points: &[[f32; 3]], cfg: &HullCfg) -> Result<TriMesh, HullError> {
    check(cfg)?;
    if let Some(index) = points.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        return Err(HullError::NonFinite { index, value: points[index] });
    }
    if points.len() < 4 {
        return Err(HullError::TooFewPoints { found: points.len() });
    }
    let exact: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
    let tolerance = cfg.tolerance.max(RESOLUTION) * diagonal(&exact);
    if tolerance == 0.0 {
        return Err(HullError::Coincident { count: points.len() });
    }
    let start = simplex(&exact);
    if start.off_line <= tolerance {
        return Err(HullError::Collinear { deviation: start.off_line, tolerance });
    }
    if start.off_plane > tolerance {
        return Ok(Quickhull::run(&exact, start.corners, tolerance, cfg.max_vertices));
    }
    let Some(thickness) = cfg.min_thickness else {
        return Err(HullError::Coplanar { deviation: start.off_plane, tolerance });
    };
    let slab = thicken(&exact, &start, thickness);
    // The thickness may be less than the tolerance of a large plate.
    let tolerance = tolerance.min(thickness / 10.0).max(RESOLUTION * diagonal(&slab));
    let start = simplex(&slab);
    if start.off_plane <= tolerance {
        return Err(HullError::Coplanar { deviation: start.off_plane, tolerance });
    }
    Ok(Quickhull::run(&slab, start.corners, tolerance, cfg.max_vertices))
}

fn check(cfg: &HullCfg) -> Result<(), HullError> {
    let fault = |field, value, expected| Err(HullError::InvalidCfg { field, value, expected });
    if cfg.max_vertices < 4 {
        return fault("max_vertices", cfg.max_vertices as f64, "4 or more");
    }
    if !(cfg.tolerance >= 0.0 && cfg.tolerance < 1.0) {
        return fault("tolerance", cfg.tolerance, "0 or more and less than 1");
    }
    match cfg.min_thickness {
        Some(t) if !(t > 0.0 && t.is_finite()) => {
            fault("min_thickness", t, "a positive length, or None (false in a scene file)")
        }
        _ => Ok(()),
    }
}

fn diagonal(points: &[[f64; 3]]) -> f64 {
    let (mut lo, mut hi) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in points {
        for i in 0..3 {
            lo[i] = lo[i].min(p[i]);
            hi[i] = hi[i].max(p[i]);
        }
    }
    norm(sub(hi, lo))
}

/// Four extreme points, the distance of the third from the line and of the fourth from the plane of the points before.
struct Simplex {
    corners: [usize; 4],
    off_line: f64,
    off_plane: f64,
    normal: [f64; 3],
    origin: [f64; 3],
}

/// Index and value of the largest distance; the first of equal ones.
fn farthest(points: &[[f64; 3]], distance: impl Fn([f64; 3]) -> f64) -> (usize, f64) {
    points.iter().enumerate().fold((0, f64::NEG_INFINITY), |best, (i, &p)| {
        let d = distance(p);
        if d > best.1 { (i, d) } else { best }
    })
}

fn simplex(points: &[[f64; 3]]) -> Simplex {
    // The longest extent along the axes, then the point farthest from one of its ends: nearly the diameter.
    let extent = |axis: usize| {
        let (hi, above) = farthest(points, |p| p[axis]);
        let (_, below) = farthest(points, |p| -p[axis]);
        (above + below, hi)
    };
    let (_, a) = (0..3).map(extent).fold((-1.0, 0), |best, e| if e.0 > best.0 { e } else { best });
    let (b, length) = farthest(points, |p| norm(sub(p, points[a])));
    let origin = points[a];
    let along = sub(points[b], origin).map(|x| x / length.max(f64::MIN_POSITIVE));
    let (c, off_line) = farthest(points, |p| norm(cross(along, sub(p, origin))));
    let normal = cross(along, sub(points[c], origin)).map(|x| x / off_line.max(f64::MIN_POSITIVE));
    let (d, off_plane) = farthest(points, |p| dot(normal, sub(p, origin)).abs());
    Simplex { corners: [a, b, c, d], off_line, off_plane, normal, origin }
}

/// Points projected onto two planes parallel to theirs: `thickness` apart, or as far apart as the points are if that is
/// more.
fn thicken(points: &[[f64; 3]], flat: &Simplex, thickness: f64) -> Vec<[f64; 3]> {
    let heights = || points.iter().map(|&p| dot(flat.normal, sub(p, flat.origin)));
    let (lo, hi) = heights().fold((0.0f64, 0.0f64), |(lo, hi), h| (lo.min(h), hi.max(h)));
    let (middle, half) = ((lo + hi) / 2.0, (hi - lo).max(thickness) / 2.0);
    let side = |sign: f64| {
        points
            .iter()
            .zip(heights())
            .map(move |(p, h)| std::array::from_fn(|i| p[i] + flat.normal[i] * (middle + sign * half - h)))
    };
    side(-1.0).chain(side(1.0)).collect()
}

struct Face {
    corners: [usize; 3],
    /// Neighbor across the edge from corner `i` to corner `i + 1`.
    neighbors: [usize; 3],
    /// Exact normal, not of unit length.
    exact: [i128; 3],
    /// Unit normal.
    normal: [f64; 3],
    alive: bool,
    /// Points in front of this face. Each point is in the list of one face only.
    outside: Vec<usize>,
}

/// An edge of the horizon, directed as in the removed face, with the remaining face beyond it.
struct Edge {
    from: usize,
    to: usize,
    face_beyond: usize,
}

/// Candidate for the next point, ordered by distance, then by the smaller index.
#[derive(PartialEq)]
struct Candidate {
    distance: f64,
    point: usize,
    face: usize,
}

impl Eq for Candidate {}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let order = self.distance.total_cmp(&other.distance);
        order.then(other.point.cmp(&self.point)).then(other.face.cmp(&self.face))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

struct Quickhull {
    /// Points in grid steps, relative to the first point.
    points: Vec<[f64; 3]>,
    faces: Vec<Face>,
    heap: BinaryHeap<Candidate>,
    /// Number of faces at each vertex of the hull; 0 for all other points.
    degree: Vec<u32>,
    vertices: usize,
    /// Tolerance in grid steps.
    tolerance: f64,
}

impl Quickhull {
    fn run(points: &[[f64; 3]], start: [usize; 4], tolerance: f64, max_vertices: usize) -> TriMesh {
        // The diagonal is at most twice the largest extent.
        let extent = diagonal(points);
        let steps = 2f64.powi(GRID_BITS - 1 - extent.log2().floor() as i32);
        let snapped = points.iter().map(|&p| sub(p, points[0]).map(|x| (x * steps).round())).collect();
        let mut hull = Self {
            points: snapped,
            faces: Vec::new(),
            heap: BinaryHeap::new(),
            degree: vec![0; points.len()],
            vertices: 0,
            tolerance: tolerance * steps,
        };
        let [a, mut b, mut c, d] = start;
        let height = dot(
            cross(sub(hull.points[b], hull.points[a]), sub(hull.points[c], hull.points[a])),
            sub(hull.points[d], hull.points[a]),
        );
        if height > 0.0 {
            // Seen from d, the triangle a b c must turn clockwise.
            std::mem::swap(&mut b, &mut c);
        }
        // Initial neighbors: face 0 is the base, faces 1 to 3 are on its edges.
        hull.add([a, b, c], [1, 2, 3]);
        hull.add([b, a, d], [0, 3, 2]);
        hull.add([c, b, d], [0, 1, 3]);
        hull.add([a, c, d], [0, 2, 1]);
        // Each round reconsiders points that the tolerance dropped too early. The second round usually finds no points.
        for _ in 0..8 {
            let everything = (0..points.len()).collect();
            let all: Vec<usize> = (0..hull.faces.len()).filter(|&f| hull.faces[f].alive).collect();
            hull.assign_outside_points(everything, &all);
            if hull.heap.is_empty() || !hull.grow(max_vertices) {
                break;
            }
        }
        hull.into_mesh(points)
    }

    /// Adds points until no point is outside (true) or the vertex limit is reached (false).
    fn grow(&mut self, max_vertices: usize) -> bool {
        while let Some(Candidate { point, face, .. }) = self.heap.pop() {
            if !self.faces[face].alive {
                continue;
            }
            if self.vertices >= max_vertices {
                return false;
            }
            self.insert(point, face);
        }
        for face in &mut self.faces {
            face.outside.clear();
        }
        true
    }

    /// Distance of a point from the plane of a face, in grid steps; positive in front of it.
    fn distance(&self, face: usize, point: usize) -> f64 {
        let face = &self.faces[face];
        dot(face.normal, sub(self.points[point], self.points[face.corners[0]]))
    }

    /// True if a point is strictly in front of a face, decided exactly.
    fn is_in_front(&self, point: usize, face: usize) -> bool {
        let distance = self.distance(face, point);
        // The rounding error of `distance` is below 2^-12 steps.
        if distance.abs() > 0.01 {
            return distance > 0.0;
        }
        let face = &self.faces[face];
        let from_face = sub(self.points[point], self.points[face.corners[0]]).map(|x| x as i128);
        dot(face.exact, from_face) > 0
    }

    fn add(&mut self, corners: [usize; 3], neighbors: [usize; 3]) {
        let [a, b, c] = corners.map(|i| self.points[i]);
        let [u, v] = [sub(b, a), sub(c, a)].map(|e| e.map(|x| x as i128));
        let exact = cross(u, v);
        let normal = exact.map(|x| x as f64);
        let length = norm(normal).max(1.0);
        for corner in corners {
            self.vertices += usize::from(self.degree[corner] == 0);
            self.degree[corner] += 1;
        }
        let normal = normal.map(|x| x / length);
        self.faces.push(Face { corners, neighbors, exact, normal, alive: true, outside: Vec::new() });
    }

    fn remove(&mut self, face: usize) -> Vec<usize> {
        self.faces[face].alive = false;
        for corner in self.faces[face].corners {
            self.degree[corner] -= 1;
            self.vertices -= usize::from(self.degree[corner] == 0);
        }
        std::mem::take(&mut self.faces[face].outside)
    }

    /// Assigns each point to the face of `among` that it is farthest in front of, and adds the farthest point of each
    /// face to the candidates. Hull vertices, and points at most `tolerance` in front of every face, are dropped.
    fn assign_outside_points(&mut self, points: Vec<usize>, among: &[usize]) {
        for point in points {
            if self.degree[point] > 0 {
                continue;
            }
            let mut best = (self.tolerance, None);
            for &face in among {
                let distance = self.distance(face, point);
                if distance > best.0 {
                    best = (distance, Some(face));
                }
            }
            if let Some(face) = best.1 {
                self.faces[face].outside.push(point);
            }
        }
        for &face in among {
            self.push_candidate(face);
        }
    }

    /// Adds the farthest point of a face to the candidates.
    fn push_candidate(&mut self, face: usize) {
        let points = self.faces[face].outside.iter();
        let candidates = points.map(|&point| Candidate { distance: self.distance(face, point), point, face });
        if let Some(best) = candidates.max() {
            self.heap.push(best);
        }
    }

    /// Replaces all faces that `apex` sees by a cone of new faces.
    fn insert(&mut self, apex: usize, from: usize) {
        let (seen, rim) = self.horizon(apex, from);
        let first = self.faces.len();
        let count = rim.len();
        for (i, &Edge { from: a, to: b, face_beyond }) in rim.iter().enumerate() {
            // No face is degenerate: the apex is strictly in front of a face with this edge, so not in line with the
            // edge.
            self.add([a, b, apex], [face_beyond, first + (i + 1) % count, first + (i + count - 1) % count]);
            if let Some(edge) = (0..3).find(|&e| self.faces[face_beyond].corners[e] == b) {
                self.faces[face_beyond].neighbors[edge] = first + i;
            }
        }
        let mut points = Vec::new();
        for face in seen {
            points.extend(self.remove(face));
        }
        let new: Vec<usize> = (first..self.faces.len()).collect();
        self.assign_outside_points(points, &new);
    }

    /// Faces that `apex` sees, starting with `from`, and the edges around them in order. Exact planes of a convex body
    /// make these edges one simple loop.
    fn horizon(&self, apex: usize, from: usize) -> (Vec<usize>, Vec<Edge>) {
        let mut seen = vec![from];
        let mut is_seen = BTreeSet::from([from]);
        let mut edges: HashMap<usize, Edge> = HashMap::new();
        let mut rim = Vec::new();
        let mut next = 0;
        while let Some(&face) = seen.get(next) {
            next += 1;
            let Face { corners, neighbors, .. } = &self.faces[face];
            for (i, &face_beyond) in neighbors.iter().enumerate() {
                if is_seen.contains(&face_beyond) {
                    continue;
                }
                if self.is_in_front(apex, face_beyond) {
                    is_seen.insert(face_beyond);
                    seen.push(face_beyond);
                } else {
                    edges.insert(corners[i], Edge { from: corners[i], to: corners[(i + 1) % 3], face_beyond });
                }
            }
        }
        let mut at = edges.keys().min().copied();
        while let Some(edge) = at.and_then(|a| edges.remove(&a)) {
            at = Some(edge.to);
            rim.push(edge);
        }
        debug_assert!(edges.is_empty(), "the horizon is not one loop");
        (seen, rim)
    }

    fn into_mesh(self, points: &[[f64; 3]]) -> TriMesh {
        let mut number: HashMap<usize, u32> = HashMap::new();
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for face in self.faces.iter().filter(|f| f.alive) {
            triangles.push(face.corners.map(|corner| {
                *number.entry(corner).or_insert_with(|| {
                    positions.push(points[corner].map(|x| x as f32));
                    (positions.len() - 1) as u32
                })
            }));
        }
        TriMesh::from_triangles(positions, triangles)
    }
}

#[cfg(test)]
#[path = "tests_hull.rs"]
mod tests;

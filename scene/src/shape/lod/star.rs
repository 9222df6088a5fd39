//! The star of a vertex (the triangles around it), and the effect of a collapse onto a neighbor.

use super::simplify::Surface;
use crate::vector::{V3, add, cross, dot, norm, sub, try_normalize};

/// Largest number of triangles around a vertex that may collapse.
pub(super) const MAX_VALENCE: usize = 32;
/// Cosine of the largest angle between a new triangle's own normal and the normals of its corners: 40°.
const MIN_NORMAL_COSINE: f32 = 0.766;
/// Sine of the angle below which lines count as parallel and triangles as degenerate: 53 bits do not resolve them.
const PARALLEL_SINE: f64 = 1e-8;

/// Twice the signed area between two vectors.
fn area(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// The triangles around a vertex, in order: triangle `i` has the corners (vertex, `ring[i]`, `ring[i + 1]`).
#[derive(Clone, Debug)]
pub(super) struct Star {
    pub(super) count: usize,
    /// Triangles, with the vertex's corner in each.
    pub(super) triangles: [(u32, u8); MAX_VALENCE],
    pub(super) ring: [u32; MAX_VALENCE],
    /// Vectors from the vertex to the ring.
    to: [V3; MAX_VALENCE],
    /// Projections of these vectors along the mean normal: right and up.
    flat: [[f64; 2]; MAX_VALENCE],
    /// Heights of the ring along the mean normal.
    height: [f64; MAX_VALENCE],
    normal: V3,
    /// Sum over the triangles of area times n nᵀ, which gives the distances of points from their planes.
    quadric: [f64; 6],
}

/// Best collapse of a vertex.
#[derive(Clone, Copy, Debug)]
pub(super) enum BestCollapse {
    /// A collapse onto this place of the ring, within the bound.
    WithinBound(usize),
    /// No collapse is within the bound; the smallest bound that was found.
    ExceedsBound(f64),
    /// No collapse is possible.
    Impossible,
    /// Unknown, because neighbors have changed.
    Unknown,
}

/// Triangles after a collapse onto `ring[onto]`. Triangle `j` in `1..count - 1` is (`ring[onto]`, `ring[onto + j]`,
/// `ring[onto + j + 1]`), with indices modulo `count`.
#[derive(Clone, Debug)]
pub(super) struct Fan {
    /// Bound of each triangle.
    pub(super) error: [f64; MAX_VALENCE],
    /// Corner of the neighbor in each triangle, which selects one of its normals.
    pub(super) corner: [u32; MAX_VALENCE],
    /// The ring, counted from that neighbor: vectors from the vertex, their projections along the mean normal, heights.
    to: [V3; MAX_VALENCE],
    flat: [[f64; 2]; MAX_VALENCE],
    height: [f64; MAX_VALENCE],
    /// Normals of the new triangles, of any length.
    planes: [V3; MAX_VALENCE],
    /// Largest difference in height over each new triangle.
    max_gap: [f64; MAX_VALENCE],
    /// Old triangles above or below each new triangle, as bits.
    overlapped: [u32; MAX_VALENCE],
}

impl Star {
    pub(super) fn empty() -> Self {
        Self {
            count: 0,
            triangles: [(0, 0); MAX_VALENCE],
            ring: [0; MAX_VALENCE],
            to: [[0.0; 3]; MAX_VALENCE],
            flat: [[0.0; 2]; MAX_VALENCE],
            height: [0.0; MAX_VALENCE],
            normal: [0.0; 3],
            quadric: [0.0; 6],
        }
    }

    /// Loads a vertex. Returns `false` if the vertex must stay: on a border, where surfaces meet, or where the
    /// triangles around it overlap when seen along their mean normal.
    pub(super) fn load(&mut self, surface: &Surface<'_>, vertex: u32) -> bool {
        self.sort_triangles(surface, vertex) && self.project(surface, vertex)
    }

    /// Sorts the triangles around the vertex. Returns `false` if they are not one closed ring of 3 to [`MAX_VALENCE`]
    /// triangles.
    fn sort_triangles(&mut self, surface: &Surface<'_>, vertex: u32) -> bool {
        let around = surface.around(vertex);
        let count = around.len();
        if !(3..=MAX_VALENCE).contains(&count) {
            return false;
        }
        let mut ends = [0u32; MAX_VALENCE];
        for (k, &(triangle, corner)) in around.iter().enumerate() {
            self.triangles[k] = (triangle, corner);
            (self.ring[k], ends[k]) =
                (surface.vertex_of(triangle, corner + 1), surface.vertex_of(triangle, corner + 2));
        }
        for i in 1..count {
            let from = ends[i - 1];
            let mut next = (i..count).filter(|&k| self.ring[k] == from);
            let (Some(k), None) = (next.next(), next.next()) else { return false };
            if from == self.ring[0] {
                return false;
            }
            self.triangles.swap(i, k);
            self.ring.swap(i, k);
            ends.swap(i, k);
        }
        self.count = count;
        ends[count - 1] == self.ring[0]
    }

    /// Projects the triangles along their mean normal. Returns `false` if they then overlap or degenerate.
    fn project(&mut self, surface: &Surface<'_>, vertex: u32) -> bool {
        let count = self.count;
        let middle = surface.position(vertex);
        for i in 0..count {
            self.to[i] = sub(surface.position(self.ring[i]), middle);
        }
        let next = |i: usize| if i + 1 < count { i + 1 } else { 0 };
        let mut faces = [[0.0; 3]; MAX_VALENCE];
        let mut sum = [0.0; 3];
        for (i, face) in faces[..count].iter_mut().enumerate() {
            *face = cross(self.to[i], self.to[next(i)]);
            sum = add(sum, *face);
        }
        let Some(n) = try_normalize(sum, 0.0) else { return false };
        // Source: Duff et al., Building an Orthonormal Basis, Revisited, JCGT 2017.
        let sign = if n[2] < 0.0 { -1.0 } else { 1.0 };
        let a = -1.0 / (sign + n[2]);
        let b = n[0] * n[1] * a;
        let right = [1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]];
        let up = [b, sign + n[1] * n[1] * a, -n[1]];
        self.normal = n;
        self.quadric = [0.0; 6];
        for (i, &c) in faces[..count].iter().enumerate() {
            let d = self.to[i];
            self.flat[i] = [dot(d, right), dot(d, up)];
            self.height[i] = dot(d, n);
            let longest = dot(d, d).max(dot(self.to[next(i)], self.to[next(i)]));
            if dot(c, n) <= PARALLEL_SINE * longest {
                return false;
            }
            let k = 1.0 / norm(c);
            let products = [c[0] * c[0], c[1] * c[1], c[2] * c[2], c[0] * c[1], c[1] * c[2], c[2] * c[0]];
            self.quadric = std::array::from_fn(|q| self.quadric[q] + k * products[q]);
        }
        // All triangles have the same orientation, so they do not overlap if they go around once.
        let rises = (0..count).filter(|&i| self.flat[i][1] < 0.0 && self.flat[next(i)][1] >= 0.0).count();
        rises == 1
    }

    /// Estimated cost of the collapse onto `ring[k]`: the mean squared distance from the planes, plus a small penalty
    /// for the length of the edge, which prevents needles in flat regions.
    fn cost(&self, k: usize) -> f64 {
        let (d, q) = (self.to[k], self.quadric);
        let planes = q[0] * d[0] * d[0]
            + q[1] * d[1] * d[1]
            + q[2] * d[2] * d[2]
            + 2.0 * (q[3] * d[0] * d[1] + q[4] * d[1] * d[2] + q[5] * d[2] * d[0]);
        planes / (q[0] + q[1] + q[2]) + 1e-8 * dot(d, d)
    }

    /// Tries the few most promising collapses onto neighbors that are not `changed`, until one keeps `bound`. Its
    /// triangles are then in `fan`.
    pub(super) fn best(&self, surface: &Surface<'_>, fan: &mut Fan, changed: &[bool], bound: f64) -> BestCollapse {
        const TRIES: usize = 3;
        let mut costs = [(0.0, 0); MAX_VALENCE];
        let mut count = 0;
        for k in (0..self.count).filter(|&k| !changed[self.ring[k] as usize]) {
            costs[count] = (self.cost(k), k);
            count += 1;
        }
        costs[..count].sort_unstable_by(|a: &(f64, usize), b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let (mut least, mut tries) = (f64::INFINITY, 0);
        for &(_, onto) in &costs[..count] {
            let Some(error) = self.collapse(surface, onto, fan) else { continue };
            if error <= bound {
                return BestCollapse::WithinBound(onto);
            }
            least = least.min(error);
            tries += 1;
            if tries == TRIES {
                break;
            }
        }
        match (count == self.count, tries) {
            (false, _) => BestCollapse::Unknown,
            (true, 0) => BestCollapse::Impossible,
            (true, _) => BestCollapse::ExceedsBound(least),
        }
    }

    /// Computes the triangles after the collapse onto `ring[onto]`, and returns the largest of their bounds.
    ///
    /// Returns `None` if triangles would overlap, deviate too much from the normals of their corners, or share an edge
    /// with more than one other triangle.
    pub(super) fn collapse(&self, surface: &Surface<'_>, onto: usize, fan: &mut Fan) -> Option<f64> {
        let m = self.count;
        for (j, i) in (onto..m).chain(0..onto).enumerate() {
            (fan.to[j], fan.flat[j], fan.height[j]) = (self.to[i], self.flat[i], self.height[i]);
        }
        let [start, ..] = fan.flat;
        let from_start = |p: [f64; 2]| [p[0] - start[0], p[1] - start[1]];
        for j in 1..m - 1 {
            let (a, b) = (from_start(fan.flat[j]), from_start(fan.flat[j + 1]));
            let longest = (a[0] * a[0] + a[1] * a[1]).max(b[0] * b[0] + b[1] * b[1]);
            if area(a, b) <= PARALLEL_SINE * longest {
                return None;
            }
        }
        for j in 1..m - 1 {
            fan.planes[j] = cross(sub(fan.to[j], fan.to[0]), sub(fan.to[j + 1], fan.to[0]));
        }
        self.corners(surface, onto, fan)?;
        if self.violates_link_condition(surface, onto) {
            return None;
        }
        self.overlay(fan);
        let mut largest = 0.0f64;
        for j in 1..m - 1 {
            let mut error = 0.0f64;
            let mut left = fan.overlapped[j];
            while left != 0 {
                let i = onto + left.trailing_zeros() as usize;
                left &= left - 1;
                error = error.max(surface.error_of(self.triangles[if i < m { i } else { i - m }].0));
            }
            fan.error[j] = error + fan.max_gap[j];
            largest = largest.max(fan.error[j]);
        }
        Some(largest)
    }

    /// Overlays old and new triangles: the largest difference in height over each new triangle, and the old triangles
    /// above or below it.
    fn overlay(&self, fan: &mut Fan) {
        let m = self.count;
        let Fan { to, flat, height, planes, max_gap, overlapped, .. } = fan;
        let (start, rise) = (flat[0], height[0]);
        max_gap[1..m - 1].fill(0.0);
        overlapped[1..m - 1].fill(0);
        for i in 0..m {
            // Old triangle `i` and a new one share an edge of the polygon.
            overlapped[i.clamp(1, m - 2)] |= 1 << i;
        }
        for j in 1..m - 1 {
            // The vertex itself is at the origin.
            let sides = [area(start, flat[j]), area(flat[j], flat[j + 1]), area(flat[j + 1], start)];
            if sides.iter().all(|&side| side >= 0.0) {
                let gap = dot(planes[j], to[0]) / dot(planes[j], self.normal);
                max_gap[j] = max_gap[j].max(gap.abs());
                overlapped[j] = u32::MAX >> (32 - m);
            }
        }
        for j in 2..m - 1 {
            let edge = [flat[j][0] - start[0], flat[j][1] - start[1]];
            let edge_rise = height[j] - rise;
            let length = edge[0] * edge[0] + edge[1] * edge[1];
            let before = area(start, edge);
            for i in 1..m {
                let spoke = flat[i];
                let turn = area(spoke, edge);
                // They cross at the fractions s = before / turn of the spoke and t = after / turn of the edge.
                let after = area(start, spoke);
                let most = (1.0 + PARALLEL_SINE) * turn.abs();
                let (s, t) = if turn < 0.0 { (-before, -after) } else { (before, after) };
                let least = most - turn.abs();
                if s < -least || s > most || t < -least || t > most || i == j {
                    continue;
                }
                // Parallel lines on top of each other separate at ends, which are evaluated anyway.
                if turn * turn <= PARALLEL_SINE * PARALLEL_SINE * length * (spoke[0] * spoke[0] + spoke[1] * spoke[1]) {
                    continue;
                }
                let inverse = 1.0 / turn.abs();
                let gap = (s * inverse * height[i] - (rise + t * inverse * edge_rise)).abs();
                for side in [j - 1, j] {
                    max_gap[side] = max_gap[side].max(gap);
                    overlapped[side] |= 1 << (i - 1) | 1 << i;
                }
            }
        }
    }

    /// Selects the vertex normal of each new triangle at the neighbor. The candidates are the two normals along the
    /// collapsed edge; the one nearer to the corner's previous normal is used. Returns `None` if a triangle would
    /// deviate too much from the normals of its corners.
    fn corners(&self, surface: &Surface<'_>, onto: usize, fan: &mut Fan) -> Option<()> {
        let m = self.count;
        let corner = |(triangle, corner): (u32, u8), step: u8| surface.corner(triangle, corner + step);
        let (first, last) = (corner(self.triangles[onto], 1), corner(self.triangles[(onto + m - 1) % m], 2));
        let normals = [surface.normal(first), surface.normal(last)];
        for j in 1..m - 1 {
            let old = self.triangles[if onto + j < m { onto + j } else { onto + j - m }];
            let had = surface.normal(corner(old, 0));
            let take_last = dot(had, normals[1]) > dot(had, normals[0]);
            let n = fan.planes[j];
            let length = norm(n);
            let face = n.map(|x| (x / length) as f32);
            let kept =
                [normals[usize::from(take_last)], surface.normal(corner(old, 1)), surface.normal(corner(old, 2))];
            if !kept.iter().all(|&n| dot(n, face) >= MIN_NORMAL_COSINE) {
                return None;
            }
            fan.corner[j] = if take_last { last } else { first };
        }
        Some(())
    }

    /// True if the neighbor already has an edge to a vertex to which the collapse would make one: three sheets would
    /// meet there, or two would overlap.
    fn violates_link_condition(&self, surface: &Surface<'_>, onto: usize) -> bool {
        let m = self.count;
        let next = |i: usize, step: usize| if i + step < m { i + step } else { i + step - m };
        // Neighbors of the neighbor along the ring, to which it has edges. It must have no edge to other ring vertices.
        let (after, before) = (self.ring[next(onto, 1)], self.ring[next(onto, m - 1)]);
        let own = |triangle: u32| self.triangles[..m].iter().any(|&(t, _)| t == triangle);
        surface.around(self.ring[onto]).iter().any(|&(triangle, corner)| {
            let ends = [surface.vertex_of(triangle, corner + 1), surface.vertex_of(triangle, corner + 2)];
            let far = |v: u32| v != after && v != before && self.ring[..m].contains(&v);
            let same = m == 3 && !own(triangle) && ends.contains(&after) && ends.contains(&before);
            far(ends[0]) || far(ends[1]) || same
        })
    }
}

impl Fan {
    pub(super) fn empty() -> Self {
        Self {
            error: [0.0; MAX_VALENCE],
            corner: [0; MAX_VALENCE],
            to: [[0.0; 3]; MAX_VALENCE],
            flat: [[0.0; 2]; MAX_VALENCE],
            height: [0.0; MAX_VALENCE],
            planes: [[0.0; 3]; MAX_VALENCE],
            max_gap: [0.0; MAX_VALENCE],
            overlapped: [0; MAX_VALENCE],
        }
    }
}

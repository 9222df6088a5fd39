//! One vertex, the triangles around it, and what a collapse onto a neighbour would change.

use super::simplify::Surface;

/// Vertices with more triangles around them stay.
pub(super) const MOST: usize = 32;
/// Cosine of the largest angle between a new triangle's own normal and the normals of its corners: 40°.
const FACING: f32 = 0.766;
/// Sine of an angle below which lines count as parallel, and triangles as flat: 53 bits say nothing about them.
const PARALLEL: f64 = 1e-8;

type V = [f64; 3];

fn sub(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Twice the signed area between two vectors.
fn area(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// The triangles around a vertex, in order: triangle `i` has the corners (vertex, `ring[i]`, `ring[i + 1]`).
#[derive(Clone, Debug)]
pub(super) struct Star {
    pub(super) count: usize,
    /// Triangle and which of its corners the vertex is.
    pub(super) triangles: [(u32, u8); MOST],
    pub(super) ring: [u32; MOST],
    /// From the vertex to the ring.
    to: [V; MOST],
    /// The same, looked at along the mean normal: right, up, and height towards the eye.
    flat: [[f64; 2]; MOST],
    height: [f64; MOST],
    normal: V,
    /// Sum over the triangles of area times n nᵀ: how far points are from their planes.
    quadric: [f64; 6],
}

/// The triangles after a collapse onto `ring[onto]`: triangle `j`, of `1..count - 1` counted from there, is (that
/// neighbour, `ring[onto + j]`, `ring[onto + j + 1]`).
#[derive(Clone, Debug)]
pub(super) struct Fan {
    /// The bound of each.
    pub(super) error: [f64; MOST],
    /// The neighbour as a corner of each: which of its normals.
    pub(super) corner: [u32; MOST],
}

impl Star {
    pub(super) fn empty() -> Self {
        Self {
            count: 0,
            triangles: [(0, 0); MOST],
            ring: [0; MOST],
            to: [[0.0; 3]; MOST],
            flat: [[0.0; 2]; MOST],
            height: [0.0; MOST],
            normal: [0.0; 3],
            quadric: [0.0; 6],
        }
    }

    /// Looks at a vertex; `false` where it must stay: on a border, where surfaces meet, or where the triangles around it
    /// cover each other when they are looked at along their mean normal.
    pub(super) fn look(&mut self, surface: &Surface<'_>, vertex: u32) -> bool {
        self.order(surface, vertex) && self.flatten(surface, vertex)
    }

    /// Brings the triangles in order.
    fn order(&mut self, surface: &Surface<'_>, vertex: u32) -> bool {
        let around = surface.around(vertex);
        let count = around.len();
        if !(3..=MOST).contains(&count) {
            return false;
        }
        let mut ends = [0u32; MOST];
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

    /// Looks at the triangles along their mean normal.
    fn flatten(&mut self, surface: &Surface<'_>, vertex: u32) -> bool {
        let count = self.count;
        let middle = surface.position(vertex);
        for i in 0..count {
            self.to[i] = sub(surface.position(self.ring[i]), middle);
        }
        let mut faces = [[0.0; 3]; MOST];
        let mut sum = [0.0; 3];
        for i in 0..count {
            faces[i] = cross(self.to[i], self.to[(i + 1) % count]);
            sum = [0, 1, 2].map(|k| sum[k] + faces[i][k]);
        }
        let length = dot(sum, sum).sqrt();
        if length == 0.0 || !length.is_finite() {
            return false;
        }
        let n = sum.map(|x| x / length);
        // Source: Duff et al., Building an Orthonormal Basis, Revisited, JCGT 2017.
        let sign = if n[2] < 0.0 { -1.0 } else { 1.0 };
        let a = -1.0 / (sign + n[2]);
        let b = n[0] * n[1] * a;
        let right = [1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]];
        let up = [b, sign + n[1] * n[1] * a, -n[1]];
        self.normal = n;
        self.quadric = [0.0; 6];
        for i in 0..count {
            let (d, c) = (self.to[i], faces[i]);
            self.flat[i] = [dot(d, right), dot(d, up)];
            self.height[i] = dot(d, n);
            let longest = dot(d, d).max(dot(self.to[(i + 1) % count], self.to[(i + 1) % count]));
            if dot(c, n) <= PARALLEL * longest {
                return false;
            }
            let k = 1.0 / dot(c, c).sqrt();
            let products = [c[0] * c[0], c[1] * c[1], c[2] * c[2], c[0] * c[1], c[1] * c[2], c[2] * c[0]];
            self.quadric = std::array::from_fn(|q| self.quadric[q] + k * products[q]);
        }
        // All turn the same way: they cover nothing twice if they go around once.
        let rises = (0..count).filter(|&i| self.flat[i][1] < 0.0 && self.flat[(i + 1) % count][1] >= 0.0).count();
        rises == 1
    }

    /// How much the collapse onto `ring[k]` seems to cost: the mean squared distance from the planes, and a little for the
    /// length of the way, so that triangles do not become needles where everything is flat.
    fn cost(&self, k: usize) -> f64 {
        let (d, q) = (self.to[k], self.quadric);
        let planes = q[0] * d[0] * d[0]
            + q[1] * d[1] * d[1]
            + q[2] * d[2] * d[2]
            + 2.0 * (q[3] * d[0] * d[1] + q[4] * d[1] * d[2] + q[5] * d[2] * d[0]);
        planes / (q[0] + q[1] + q[2]) + 1e-8 * dot(d, d)
    }

    /// The collapse with the smallest bound among those few that look best, and that bound; the first that keeps `enough`
    /// is good enough.
    pub(super) fn best(&self, surface: &Surface<'_>, fan: &mut Fan, enough: f64) -> Option<(u32, f64)> {
        const TRIES: usize = 3;
        let mut costs: [(f64, u8); MOST] = std::array::from_fn(|k| (0.0, k as u8));
        let costs = &mut costs[..self.count];
        for (k, entry) in costs.iter_mut().enumerate() {
            entry.0 = self.cost(k);
        }
        costs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut best: Option<(u32, f64)> = None;
        let mut tries = 0;
        for &(_, k) in costs.iter() {
            let onto = usize::from(k);
            let Some(error) = self.collapse(surface, onto, fan) else { continue };
            if best.is_none_or(|(_, least)| error < least) {
                best = Some((self.ring[onto], error));
            }
            tries += 1;
            if error <= enough || tries == TRIES {
                break;
            }
        }
        best
    }

    /// The triangles after the collapse onto `ring[onto]`, and the largest of their bounds. `None` where it would make
    /// triangles that cover each other, that face elsewhere than their corners, or an edge with more than two triangles.
    pub(super) fn collapse(&self, surface: &Surface<'_>, onto: usize, fan: &mut Fan) -> Option<f64> {
        let m = self.count;
        let at = |j: usize| (onto + j) % m;
        let (start, rise) = (self.flat[onto], self.height[onto]);
        let from_start = |j: usize| [self.flat[at(j)][0] - start[0], self.flat[at(j)][1] - start[1]];
        let mut planes = [[0.0; 3]; MOST];
        for j in 1..m - 1 {
            let (a, b) = (from_start(j), from_start(j + 1));
            let longest = (a[0] * a[0] + a[1] * a[1]).max(b[0] * b[0] + b[1] * b[1]);
            if area(a, b) <= PARALLEL * longest {
                return None;
            }
            planes[j] = cross(sub(self.to[at(j)], self.to[onto]), sub(self.to[at(j + 1)], self.to[onto]));
        }
        self.corners(surface, onto, &planes, fan)?;
        if self.pinches(surface, onto) {
            return None;
        }
        // Where pieces of old and new triangles meet: the largest difference in height over each new triangle, and which
        // old ones are below or above it.
        let mut apart = [0.0f64; MOST];
        let mut over = [0u32; MOST];
        for i in 0..m {
            // Old triangle `i` and a new one have an edge of the polygon in common.
            over[i.clamp(1, m - 2)] |= 1 << i;
        }
        for j in 1..m - 1 {
            let sides = [self.flat[onto], self.flat[at(j)], self.flat[at(j + 1)]];
            // The vertex itself, at the origin.
            if (0..3).all(|k| area(sides[k], sides[(k + 1) % 3]) >= 0.0) {
                let gap = dot(planes[j], self.to[onto]) / dot(planes[j], self.normal);
                apart[j] = apart[j].max(gap.abs());
                over[j] = u32::MAX >> (32 - m);
            }
        }
        for j in 2..m - 1 {
            let edge = from_start(j);
            let edge_rise = self.height[at(j)] - rise;
            let before = area(start, edge);
            for i in (1..m).filter(|&i| i != j) {
                let spoke = self.flat[at(i)];
                let turn = area(spoke, edge);
                let scale = (spoke[0] * spoke[0] + spoke[1] * spoke[1]) * (edge[0] * edge[0] + edge[1] * edge[1]);
                // Parallel ones that lie on each other part at ends that are looked at anyway.
                if turn * turn <= PARALLEL * PARALLEL * scale {
                    continue;
                }
                let (s, t) = (before / turn, area(start, spoke) / turn);
                let within = -PARALLEL..=1.0 + PARALLEL;
                if within.contains(&s) && within.contains(&t) {
                    let gap = (s * self.height[at(i)] - (rise + t * edge_rise)).abs();
                    for side in [j - 1, j] {
                        apart[side] = apart[side].max(gap);
                        over[side] |= 1 << (i - 1) | 1 << i;
                    }
                }
            }
        }
        let mut largest = 0.0f64;
        for j in 1..m - 1 {
            let below = (0..m).filter(|i| over[j] >> i & 1 == 1).map(|i| surface.error_of(self.triangles[at(i)].0));
            fan.error[j] = below.fold(0.0, f64::max) + apart[j];
            largest = largest.max(fan.error[j]);
        }
        Some(largest)
    }

    /// Finds which normal of the neighbour each new triangle gets: of the two along the collapsed edge the one that is
    /// nearer to what the corner had. `None` where a triangle would face elsewhere than its corners.
    fn corners(&self, surface: &Surface<'_>, onto: usize, planes: &[V; MOST], fan: &mut Fan) -> Option<()> {
        let m = self.count;
        let corner = |(triangle, corner): (u32, u8), step: u8| surface.corner(triangle, corner + step);
        let (first, last) = (corner(self.triangles[onto], 1), corner(self.triangles[(onto + m - 1) % m], 2));
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let normals = [surface.normal(first), surface.normal(last)];
        for j in 1..m - 1 {
            let old = self.triangles[(onto + j) % m];
            let had = surface.normal(corner(old, 0));
            let take_last = dot(had, normals[1]) > dot(had, normals[0]);
            let n = planes[j];
            let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
            let face = n.map(|x| (x / length) as f32);
            let kept = [normals[usize::from(take_last)], surface.normal(corner(old, 1)), surface.normal(corner(old, 2))];
            if !kept.iter().all(|&n| dot(n, face) >= FACING) {
                return None;
            }
            fan.corner[j] = if take_last { last } else { first };
        }
        Some(())
    }

    /// Whether the neighbour has an edge already to where the collapse would make one: three sheets would meet there, or
    /// two cover each other.
    fn pinches(&self, surface: &Surface<'_>, onto: usize) -> bool {
        let m = self.count;
        let ring = |j: usize| self.ring[(onto + j) % m];
        let own = |triangle: u32| self.triangles[..m].iter().any(|&(t, _)| t == triangle);
        surface.around(ring(0)).iter().any(|&(triangle, corner)| {
            let ends = [surface.vertex_of(triangle, corner + 1), surface.vertex_of(triangle, corner + 2)];
            let far = (2..m - 1).any(|j| ends.contains(&ring(j)));
            let same = m == 3 && !own(triangle) && ends.contains(&ring(1)) && ends.contains(&ring(2));
            far || same
        })
    }
}

impl Fan {
    pub(super) fn empty() -> Self {
        Self { error: [0.0; MOST], corner: [0; MOST] }
    }
}

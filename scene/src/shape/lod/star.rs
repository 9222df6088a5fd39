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

/// What the best collapse of a vertex is.
#[derive(Clone, Copy, Debug)]
pub(super) enum Best {
    /// Onto that place of the ring, within the bound.
    Enough(usize),
    /// None is within the bound; the smallest that was found.
    Least(f64),
    /// None is possible.
    None,
    /// Neighbours have changed.
    Unknown,
}

/// The triangles after a collapse onto `ring[onto]`: triangle `j`, of `1..count - 1` counted from there, is (that
/// neighbour, `ring[onto + j]`, `ring[onto + j + 1]`).
#[derive(Clone, Debug)]
pub(super) struct Fan {
    /// The bound of each.
    pub(super) error: [f64; MOST],
    /// The neighbour as a corner of each: which of its normals.
    pub(super) corner: [u32; MOST],
    /// The ring counted from that neighbour: from the vertex, and looked at along the mean normal.
    to: [V; MOST],
    flat: [[f64; 2]; MOST],
    height: [f64; MOST],
    /// Normals of the new triangles, of any length.
    planes: [V; MOST],
    /// The largest difference in height over each new triangle.
    apart: [f64; MOST],
    /// Which old triangles are above or below each new one.
    over: [u32; MOST],
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
        let next = |i: usize| if i + 1 < count { i + 1 } else { 0 };
        let mut faces = [[0.0; 3]; MOST];
        let mut sum = [0.0; 3];
        for (i, face) in faces[..count].iter_mut().enumerate() {
            *face = cross(self.to[i], self.to[next(i)]);
            sum = [0, 1, 2].map(|k| sum[k] + face[k]);
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
        for (i, &c) in faces[..count].iter().enumerate() {
            let d = self.to[i];
            self.flat[i] = [dot(d, right), dot(d, up)];
            self.height[i] = dot(d, n);
            let longest = dot(d, d).max(dot(self.to[next(i)], self.to[next(i)]));
            if dot(c, n) <= PARALLEL * longest {
                return false;
            }
            let k = 1.0 / dot(c, c).sqrt();
            let products = [c[0] * c[0], c[1] * c[1], c[2] * c[2], c[0] * c[1], c[1] * c[2], c[2] * c[0]];
            self.quadric = std::array::from_fn(|q| self.quadric[q] + k * products[q]);
        }
        // All turn the same way: they cover nothing twice if they go around once.
        let rises = (0..count).filter(|&i| self.flat[i][1] < 0.0 && self.flat[next(i)][1] >= 0.0).count();
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

    /// Tries the few collapses that look best, onto neighbours that are not `changed`, until one keeps `bound`; that is in
    /// `fan` then.
    pub(super) fn best(&self, surface: &Surface<'_>, fan: &mut Fan, changed: &[bool], bound: f64) -> Best {
        const TRIES: usize = 3;
        let mut costs = [(0.0, 0); MOST];
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
                return Best::Enough(onto);
            }
            least = least.min(error);
            tries += 1;
            if tries == TRIES {
                break;
            }
        }
        match (count == self.count, tries) {
            (false, _) => Best::Unknown,
            (true, 0) => Best::None,
            (true, _) => Best::Least(least),
        }
    }

    /// The triangles after the collapse onto `ring[onto]`, and the largest of their bounds. `None` where it would make
    /// triangles that cover each other, that face elsewhere than their corners, or an edge with more than two triangles.
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
            if area(a, b) <= PARALLEL * longest {
                return None;
            }
        }
        for j in 1..m - 1 {
            fan.planes[j] = cross(sub(fan.to[j], fan.to[0]), sub(fan.to[j + 1], fan.to[0]));
        }
        self.corners(surface, onto, fan)?;
        if self.pinches(surface, onto) {
            return None;
        }
        self.overlay(fan);
        let mut largest = 0.0f64;
        for j in 1..m - 1 {
            let mut error = 0.0f64;
            let mut left = fan.over[j];
            while left != 0 {
                let i = onto + left.trailing_zeros() as usize;
                left &= left - 1;
                error = error.max(surface.error_of(self.triangles[if i < m { i } else { i - m }].0));
            }
            fan.error[j] = error + fan.apart[j];
            largest = largest.max(fan.error[j]);
        }
        Some(largest)
    }

    /// Where pieces of old and new triangles meet: the largest difference in height over each new triangle, and which old
    /// ones are below or above it.
    fn overlay(&self, fan: &mut Fan) {
        let m = self.count;
        let Fan { to, flat, height, planes, apart, over, .. } = fan;
        let (start, rise) = (flat[0], height[0]);
        apart[1..m - 1].fill(0.0);
        over[1..m - 1].fill(0);
        for i in 0..m {
            // Old triangle `i` and a new one have an edge of the polygon in common.
            over[i.clamp(1, m - 2)] |= 1 << i;
        }
        for j in 1..m - 1 {
            // The vertex itself, at the origin.
            let sides = [area(start, flat[j]), area(flat[j], flat[j + 1]), area(flat[j + 1], start)];
            if sides.iter().all(|&side| side >= 0.0) {
                let gap = dot(planes[j], to[0]) / dot(planes[j], self.normal);
                apart[j] = apart[j].max(gap.abs());
                over[j] = u32::MAX >> (32 - m);
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
                // They cross at the shares s = before / turn of the spoke and t = after / turn of the edge.
                let after = area(start, spoke);
                let most = (1.0 + PARALLEL) * turn.abs();
                let (s, t) = if turn < 0.0 { (-before, -after) } else { (before, after) };
                let least = most - turn.abs();
                if s < -least || s > most || t < -least || t > most || i == j {
                    continue;
                }
                // Parallel ones that lie on each other part at ends that are looked at anyway.
                if turn * turn <= PARALLEL * PARALLEL * length * (spoke[0] * spoke[0] + spoke[1] * spoke[1]) {
                    continue;
                }
                let inverse = 1.0 / turn.abs();
                let gap = (s * inverse * height[i] - (rise + t * inverse * edge_rise)).abs();
                for side in [j - 1, j] {
                    apart[side] = apart[side].max(gap);
                    over[side] |= 1 << (i - 1) | 1 << i;
                }
            }
        }
    }

    /// Finds which normal of the neighbour each new triangle gets: of the two along the collapsed edge the one that is
    /// nearer to what the corner had. `None` where a triangle would face elsewhere than its corners.
    fn corners(&self, surface: &Surface<'_>, onto: usize, fan: &mut Fan) -> Option<()> {
        let m = self.count;
        let corner = |(triangle, corner): (u32, u8), step: u8| surface.corner(triangle, corner + step);
        let (first, last) = (corner(self.triangles[onto], 1), corner(self.triangles[(onto + m - 1) % m], 2));
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let normals = [surface.normal(first), surface.normal(last)];
        for j in 1..m - 1 {
            let old = self.triangles[if onto + j < m { onto + j } else { onto + j - m }];
            let had = surface.normal(corner(old, 0));
            let take_last = dot(had, normals[1]) > dot(had, normals[0]);
            let n = fan.planes[j];
            let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
            let face = n.map(|x| (x / length) as f32);
            let kept =
                [normals[usize::from(take_last)], surface.normal(corner(old, 1)), surface.normal(corner(old, 2))];
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
        let next = |i: usize, step: usize| if i + step < m { i + step } else { i + step - m };
        // Its neighbours along the ring, which it has edges to; nobody else of the ring may be one.
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
            error: [0.0; MOST],
            corner: [0; MOST],
            to: [[0.0; 3]; MOST],
            flat: [[0.0; 2]; MOST],
            height: [0.0; MOST],
            planes: [[0.0; 3]; MOST],
            apart: [0.0; MOST],
            over: [0; MOST],
        }
    }
}

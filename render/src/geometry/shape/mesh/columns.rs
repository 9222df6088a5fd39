//! Triangles binned into columns, a uniform grid seen from above: one list of triangles per column.
//!
//! Height scanners look at terrain from above. A steep ray has few triangles near it, and no BVH traversal is needed to
//! find them. They are those of the columns that the ray passes between the lowest and the highest corner of the mesh.
//! The ray is tested against each of them, eight pairs of a ray and a triangle at a time, by the arithmetic of a single
//! ray: the same bits.
//!
//! Above is along any axis of the mesh's own frame (MuJoCo turns meshes to their principal axes). That axis is called z
//! below.
//!
//! The columns contain every triangle that [`ShearedRay`](crate::geometry::triangle::ShearedRay) can hit. Some point of
//! that triangle, at a height z between those of its corners, is along x where the ray is at that height, up to
//! rounding: the corners as seen from the ray are on both sides of it. With coordinates up to M, slopes b up to 1 and e
//! = 2^-53, a corner is off by at most e M times 2 (the difference to the ray's origin along x), 2 (along z), 2 (their
//! product with b) and 4 (the difference of both). The ray's position at the lowest and the highest corner is off by 2
//! (the difference along z), 2 (the product) and 3 (the sum). So the interval between these two positions, wider by 15
//! e M, meets the triangle's own interval; along y likewise. Rounding keeps order when coordinates become columns. So
//! intervals that meet have columns in common, and both have all columns of a rectangle.

use super::MeshBvh;
use crate::geometry::bvh::MAX_ORIGIN_RATIO;
use crate::geometry::packet::{Packet, WIDTH};
use crate::geometry::shape::Intersections;
use crate::geometry::triangle::{ShearedPacket, Triangle, distances, normals};
use crate::simd::{D, D3, Simd};
use kinetoscope_scene::shape::Intersection;
use kinetoscope_scene::vector::V3;

/// Meshes with fewer triangles have no columns: their BVHs are small.
const MIN_TRIANGLES: usize = 256;
/// Width of columns, relative to the mean extent of the triangles. A ray passes many narrow columns, and wide columns
/// hold many triangles to test.
const COLUMN_WIDTH: f64 = 0.7;
/// Largest ratio of columns to triangles.
const MAX_COLUMNS_PER_TRIANGLE: f64 = 2.0;
/// Largest mean number of columns per triangle; meshes of triangles of very different sizes have no columns.
const MAX_MEAN_COLUMNS: usize = 12;
/// Largest slope of a steep ray: meters along x or y per meter along z.
const MAX_SLOPE: f64 = 0.125;
/// Columns that a ray may pass along x, and along y.
const MAX_PASSED: usize = 4;
/// Largest number of triangles in the columns that the rays of a packet pass. A BVH traversal costs about as much as
/// these tests.
const MAX_CANDIDATES: usize = 320;
/// Marks the absence of a triangle.
const NONE: u32 = u32::MAX;

#[derive(Clone, Debug)]
pub(crate) struct Columns {
    /// Permutation of the axes, the axis of the columns last; all other fields are in this order.
    axes: [usize; 3],
    /// Smallest coordinates of all triangles \[m\].
    low: [f64; 2],
    columns_per_meter: [f64; 2],
    /// Columns along x and y.
    size: [usize; 2],
    /// Start of each column's list, row by row along x, and the end of the last list.
    starts: Vec<u32>,
    lists: Vec<u32>,
    /// Smallest and largest coordinates of each triangle across the columns \[m\].
    sides: Vec<[[f32; 2]; 2]>,
    /// Heights of the lowest and highest corner \[m\].
    heights: [f64; 2],
    /// Largest absolute coordinate \[m\].
    max_coordinate: f64,
    /// Widening of rays, as a fraction of the largest coordinate.
    slack: f64,
}

impl Columns {
    /// Builds columns, slightly narrower than the mean triangle if their number allows it. `None` for small meshes, and
    /// if triangles are in too many columns.
    pub(crate) fn new(triangles: &[Triangle], bounds: &[V3; 2], axes: [usize; 3]) -> Option<Self> {
        if triangles.len() < MIN_TRIANGLES {
            return None;
        }
        let count = triangles.len() as f64;
        let size = [0, 1].map(|axis| {
            let mean =
                triangles.iter().map(|t| extent(t, axes[axis])).map(|[low, high]| high - low).sum::<f64>() / count;
            (bounds[1][axes[axis]] - bounds[0][axes[axis]]) / (COLUMN_WIDTH * mean)
        });
        // The number of columns is limited by their memory.
        let fewer = (MAX_COLUMNS_PER_TRIANGLE * count / (size[0] * size[1])).sqrt().min(1.0);
        let size = size.map(|n| (n * fewer).ceil());
        let known = size.iter().all(|n| (1.0..=MAX_COLUMNS_PER_TRIANGLE * count).contains(n));
        if known { Self::with_size(triangles, bounds, axes, size.map(|n| n as usize)) } else { None }
    }

    pub(crate) fn with_size(
        triangles: &[Triangle],
        bounds: &[V3; 2],
        axes: [usize; 3],
        size: [usize; 2],
    ) -> Option<Self> {
        let [low, high] = bounds.map(|p| axes.map(|axis| p[axis]));
        let per_meter = [0, 1].map(|axis| size[axis] as f64 / (high[axis] - low[axis]));
        let mut columns = Self {
            axes,
            low: [low[0], low[1]],
            columns_per_meter: per_meter,
            size,
            starts: vec![0; size[0] * size[1] + 2],
            lists: Vec::new(),
            sides: Vec::new(),
            heights: [low[2], high[2]],
            max_coordinate: bounds.iter().flatten().fold(0.0, |m, x| x.abs().max(m)),
            // 32 e.
            slack: 16.0 * f64::EPSILON,
        };
        let most = MAX_MEAN_COLUMNS * triangles.len();
        let rectangles = triangles.iter().map(|t| columns.rectangle(t));
        let in_all: usize = rectangles.map(|[from, to]| (to[0] - from[0] + 1) * (to[1] - from[1] + 1)).sum();
        if in_all > most || !per_meter.iter().all(|x| x.is_finite()) {
            return None;
        }
        let side = |t: &Triangle, axis: usize| extent(t, axes[axis]).map(|x| x as f32);
        columns.sides = triangles.iter().map(|t| [side(t, 0), side(t, 1)]).collect();
        // Counts are stored two columns ahead, so the running sum is stored one ahead of each list's start. Writing a
        // list advances that number to the start of the next list.
        for t in triangles {
            columns.each_row(t, |row, starts, _| row.for_each(|column| starts[column + 2] += 1));
        }
        let mut sum = 0;
        for start in &mut columns.starts {
            sum += *start;
            *start = sum;
        }
        columns.lists.resize(in_all, 0);
        for (k, t) in triangles.iter().enumerate() {
            columns.each_row(t, |row, starts, lists| {
                for column in row {
                    let at = &mut starts[column + 1];
                    lists[*at as usize] = k as u32;
                    *at += 1;
                }
            });
        }
        Some(columns)
    }

    #[cfg(test)]
    pub(crate) fn axes(&self) -> [usize; 3] {
        self.axes
    }

    /// The same columns without slack for rays.
    #[cfg(test)]
    pub(crate) fn without_slack(&self) -> Self {
        Self { slack: 0.0, ..self.clone() }
    }

    /// The first and the last column of a triangle along both axes.
    fn rectangle(&self, triangle: &Triangle) -> [[usize; 2]; 2] {
        let ends = |axis: usize| extent(triangle, self.axes[axis]).map(|x| self.column(axis, x));
        let ([left, right], [bottom, top]) = (ends(0), ends(1));
        [[left, bottom], [right, top]]
    }

    /// Column of a coordinate; the first or the last one for coordinates outside.
    fn column(&self, axis: usize, x: f64) -> usize {
        let at = (x - self.low[axis]) * self.columns_per_meter[axis];
        at.max(0.0).min((self.size[axis] - 1) as f64) as usize
    }

    /// Passes the columns of a triangle to `show`, row by row.
    fn each_row(&mut self, triangle: &Triangle, show: impl Fn(std::ops::Range<usize>, &mut [u32], &mut [u32])) {
        let [[left, bottom], [right, top]] = self.rectangle(triangle);
        for row in bottom..=top {
            let row = row * self.size[0];
            show(row + left..row + right + 1, &mut self.starts, &mut self.lists);
        }
    }
}

/// Smallest and largest coordinate of a triangle along an axis.
fn extent(triangle: &Triangle, axis: usize) -> [f64; 2] {
    let [a, b, c] = triangle.map(|p| f64::from(p[axis]));
    [a.min(b).min(c), a.max(b).max(c)]
}

/// True if all rays of a packet are steep enough.
#[inline(always)]
pub(crate) fn are_steep<S: Simd>(s: S, shear: &ShearedPacket<S>) -> bool {
    let [x, y] = shear.slopes();
    x.abs().max(y.abs()).le(D::splat(s, MAX_SLOPE)).to_bitmask() == crate::geometry::packet::ALL
}

/// A value per ray, for both ends, along both axes.
type Ends<T> = [[[T; WIDTH]; 2]; 2];

/// True if two intervals overlap.
#[inline(always)]
fn overlap([a, b]: &[f32; 2], [c, d]: [f64; 2]) -> bool {
    (f64::from(*a) <= d) & (c <= f64::from(*b))
}

/// The nearest triangle of each ray so far.
struct ClosestHits {
    limit: [f64; WIDTH],
    best: [u32; WIDTH],
}

/// Pairs of a triangle and a ray to be tested.
#[derive(Default)]
struct Pairs {
    count: usize,
    triangles: [u32; WIDTH],
    rays: [usize; WIDTH],
}

impl Columns {
    /// Intersects a packet of steep rays. Returns false, without writing, if they pass too many columns or triangles,
    /// or if they begin so far away that rounding could put them into triangles whose BVH boxes they miss.
    #[inline(always)]
    pub(crate) fn intersect_packet<S: Simd>(
        &self,
        s: S,
        tree: &MeshBvh,
        packet: &Packet,
        shear: &ShearedPacket<S>,
        touches: &mut Intersections,
    ) -> bool {
        let (origin, by) = (shear.origin(), shear.shear());
        if origin[0].abs().max(origin[1].abs()).max(origin[2].abs()).reduce_max()
            > MAX_ORIGIN_RATIO * self.max_coordinate
        {
            return false;
        }
        let (ends, [[left, bottom], [right, top]]) = self.column_ranges(s, &origin, &by);
        let mut crowd = 0;
        for k in 0..WIDTH {
            if !packet.is_active(k) {
                continue;
            }
            if right[k] - left[k] >= MAX_PASSED || top[k] - bottom[k] >= MAX_PASSED {
                return false;
            }
            for row in bottom[k]..=top[k] {
                crowd += self.list(row, left[k], right[k]).len();
            }
        }
        if crowd > MAX_CANDIDATES {
            return false;
        }
        let mut nearest = ClosestHits { limit: packet.limits(s).array(), best: [NONE; WIDTH] };
        let rays = [origin, by].map(|v| [v[0].array(), v[1].array(), v[2].array()]);
        let mut pairs = Pairs::default();
        for k in 0..WIDTH {
            if !packet.is_active(k) {
                continue;
            }
            let [x, y] = [[ends[0][0][k], ends[1][0][k]], [ends[0][1][k], ends[1][1][k]]];
            for row in bottom[k]..=top[k] {
                for &triangle in self.list(row, left[k], right[k]) {
                    let at = pairs.count % WIDTH;
                    (pairs.triangles[at], pairs.rays[at]) = (triangle, k);
                    // Written without a branch, which would be unpredictable: about half of the triangles are near the
                    // ray.
                    let sides = &self.sides[triangle as usize];
                    pairs.count += usize::from(overlap(&sides[0], x) & overlap(&sides[1], y));
                    if pairs.count == WIDTH {
                        pairs.test(s, &tree.triangles, self.axes, &rays, &mut nearest);
                        pairs.count = 0;
                    }
                }
            }
        }
        if pairs.count > 0 {
            // The remaining lanes hold earlier pairs or default ones: they change nothing.
            pairs.test(s, &tree.triangles, self.axes, &rays, &mut nearest);
        }
        tree.write_hits(s, &nearest.limit, &nearest.best, touches);
        true
    }

    /// Intervals of the rays' coordinates along both axes, and the first and the last columns there.
    #[inline(always)]
    fn column_ranges<S: Simd>(&self, s: S, origin: &D3<S>, by: &D3<S>) -> (Ends<f64>, Ends<usize>) {
        let reach = origin[0].abs().max(origin[1].abs()).max(origin[2].abs()).max(D::splat(s, self.max_coordinate));
        let slack = reach * self.slack;
        let [below, above] = self.heights.map(|z| D::splat(s, z) - origin[2]);
        let zero = D::splat(s, 0.0);
        let (mut ends, mut columns) = ([[[0.0; WIDTH]; 2]; 2], [[[0; WIDTH]; 2]; 2]);
        for axis in 0..2 {
            let (a, b) = (origin[axis] + by[axis] * below, origin[axis] + by[axis] * above);
            let last = D::splat(s, (self.size[axis] - 1) as f64);
            for (end, x) in [a.min(b) - slack, a.max(b) + slack].into_iter().enumerate() {
                ends[end][axis] = x.array();
                let at = (x - D::splat(s, self.low[axis])) * self.columns_per_meter[axis];
                let at = at.max(zero).min(last).array();
                for k in 0..WIDTH {
                    columns[end][axis][k] = at[k] as u32 as usize;
                }
            }
        }
        (ends, columns)
    }

    /// Triangles in the columns from `left` to `right`, both included, of a row; one in several columns is repeated.
    #[inline(always)]
    fn list(&self, row: usize, left: usize, right: usize) -> &[u32] {
        let row = row * self.size[0];
        &self.lists[self.starts[row + left] as usize..self.starts[row + right + 1] as usize]
    }
}

impl Pairs {
    /// Tests all lanes.
    #[inline(always)]
    fn test<S: Simd>(
        &self,
        s: S,
        triangles: &[Triangle],
        axes: [usize; 3],
        rays: &[[[f64; WIDTH]; 3]; 2],
        nearest: &mut ClosestHits,
    ) {
        let mut corners = [[[0.0; WIDTH]; 3]; 3];
        let mut lines = [[[0.0; WIDTH]; 3]; 2];
        for lane in 0..WIDTH {
            let triangle = &triangles[self.triangles[lane] as usize];
            let ray = self.rays[lane] % WIDTH;
            for axis in 0..3 {
                for corner in 0..3 {
                    corners[corner][axis][lane] = f64::from(triangle[corner][axis]);
                }
                lines[0][axis][lane] = rays[0][axis][ray];
                lines[1][axis][lane] = rays[1][axis][ray];
            }
        }
        let load = |v: &[[f64; WIDTH]; 3]| [D::load(s, &v[0]), D::load(s, &v[1]), D::load(s, &v[2])];
        let [origin, by] = [load(&lines[0]), load(&lines[1])];
        let hit = distances(
            s,
            &origin,
            &by,
            #[inline(always)]
            |corner, axis| D::load(s, &corners[corner][axes[axis]]),
        );
        let Some((t, inside)) = hit else { return };
        let mut hit = (inside & D::splat(s, 0.0).le(t)).to_bitmask();
        let t = t.array();
        while hit != 0 {
            let lane = hit.trailing_zeros() as usize % WIDTH;
            hit &= hit - 1;
            let (triangle, ray) = (self.triangles[lane], self.rays[lane] % WIDTH);
            let (limit, best) = (&mut nearest.limit[ray], &mut nearest.best[ray]);
            // On an edge the first triangle counts.
            if t[lane] < *limit || t[lane] == *limit && triangle < *best {
                (*limit, *best) = (t[lane], triangle);
            }
        }
    }
}

impl MeshBvh {
    /// Writes the hits of a packet, lane by lane.
    #[inline(always)]
    fn write_hits<S: Simd>(&self, s: S, limit: &[f64; WIDTH], best: &[u32; WIDTH], touches: &mut Intersections) {
        let mut corners = [[[0.0; WIDTH]; 3]; 3];
        for lane in 0..WIDTH {
            let found = if best[lane] == NONE { 0 } else { best[lane] as usize };
            let triangle = &self.triangles[found];
            for axis in 0..3 {
                for corner in 0..3 {
                    corners[corner][axis][lane] = f64::from(triangle[corner][axis]);
                }
            }
        }
        let (normal, known) = normals(
            s,
            #[inline(always)]
            |corner, axis| D::load(s, &corners[corner][axis]),
        );
        let known = known.to_bitmask();
        for lane in 0..WIDTH {
            touches[lane] = (best[lane] != NONE && known >> lane & 1 == 1).then(|| Intersection {
                t: limit[lane] + 0.0,
                normal: [normal[0][lane], normal[1][lane], normal[2][lane]],
            });
        }
    }
}

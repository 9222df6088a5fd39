//! BVH over the instances of a frame: split by the surface area heuristic; large or deep nodes are split in half at the
//! median, along the axis with the widest spread of box centers.
//!
//! Source: Goldsmith and Salmon, Automatic creation of object hierarchies for ray tracing, 1987.

use super::group::Slabs;
use super::motion::Motion;
use crate::simd::{F, LANES, M, Simd};
use kinetoscope_scene::PoseF64;
use kinetoscope_scene::Ray;
use kinetoscope_scene::vector::{V3, add, scale, sub};

/// Enlargement of boxes: more than the rounding of the test.
const BOUNDS_SCALE: f64 = 1.0 + 1e-6;
/// Depth of splits by the heuristic.
const MAX_SAH_DEPTH: usize = 8;
/// More than the depth of any BVH: below, nodes of fewer than 2^32 instances are split in half.
const MAX_DEPTH: usize = MAX_SAH_DEPTH + 32;
/// Larger nodes are not split by the heuristic: that takes as long as several thousand rays.
const MAX_SAH_SPLIT: usize = 64;

/// A box that contains two boxes, or an instance.
#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: [V3; 2],
    /// Index of the second child; the first child follows this node. 0 for a leaf.
    second_child: u32,
    instance: u32,
}

/// A box, its center (doubled), and its instance.
type InstanceItem = ([V3; 2], V3, u32);

/// A BVH over boxes; keeps its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct InstanceBvh {
    boxes: Vec<InstanceItem>,
    nodes: Vec<Node>,
}

impl InstanceBvh {
    pub(super) fn bytes(&self) -> usize {
        self.boxes.capacity() * size_of::<InstanceItem>() + self.nodes.capacity() * size_of::<Node>()
    }

    pub(super) fn clear(&mut self) {
        self.boxes.clear();
        self.nodes.clear();
    }

    /// Adds a static instance. `thing` is its index, `pose` is world from instance, `[lo, hi]` its bounding box in its
    /// own frame.
    pub(super) fn add(&mut self, thing: u32, pose: &PoseF64, [lo, hi]: [V3; 2]) {
        let at = pose.apply(scale(add(lo, hi), 0.5));
        let half = scale(sub(hi, lo), 0.5);
        let reach = pose.rotation.map(|r| BOUNDS_SCALE * (0..3).map(|k| r[k].abs() * half[k]).sum::<f64>());
        let pad = [0, 1, 2].map(|k| reach[k] + 1e-9 * (at[k].abs() + reach[k]));
        let bounds = [sub(at, pad), add(at, pad)];
        self.boxes.push((bounds, scale(at, 2.0), thing));
    }

    /// Adds a moving instance; `bounds` is its bounding box in its own frame.
    pub(super) fn add_moving(&mut self, thing: u32, motion: &Motion, bounds: [V3; 2]) {
        let [lo, hi] = motion.bounds(bounds, BOUNDS_SCALE);
        self.boxes.push(([lo, hi], add(lo, hi), thing));
    }

    /// Bounding box of all instances in the world \[m\], after building; `None` without instances.
    pub(super) fn bounds(&self) -> Option<[V3; 2]> {
        self.nodes.first().map(|node| node.bounds)
    }

    /// Builds the BVH over the added boxes.
    pub(super) fn build(&mut self) {
        let Self { boxes, nodes } = self;
        if !boxes.is_empty() {
            nodes.reserve(2 * boxes.len() - 1);
            split(boxes, nodes, 0);
        }
    }

    /// Visits the instances whose boxes a ray meets at distances from 0 to `limit`, near boxes first. `act` receives an
    /// instance and the limit, and returns a new limit.
    #[inline(always)]
    pub(super) fn traverse(&self, ray: &Ray, mut limit: f64, mut act: impl FnMut(u32, f64) -> f64) {
        // A component close to 0 would have an infinite inverse, and infinity times zero is NaN.
        let inverse = ray.direction.map(|d| 1.0 / if d.abs() < 1e-200 { 1e-200f64.copysign(d) } else { d });
        // Plain comparisons, because those of the library check for NaN.
        let smaller = |a: f64, b: f64| if a < b { a } else { b };
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        let enter = {
            #[inline(always)]
            |node: u32, limit: f64| {
                let [lo, hi] = &self.nodes[node as usize].bounds;
                let (mut near, mut far) = (0.0f64, limit);
                for k in 0..3 {
                    let (a, b) = ((lo[k] - ray.origin[k]) * inverse[k], (hi[k] - ray.origin[k]) * inverse[k]);
                    (near, far) = (larger(near, smaller(a, b)), smaller(far, larger(a, b)));
                }
                (near <= far * BOUNDS_SCALE).then_some(near)
            }
        };
        let mut waiting = [(0.0, 0u32); MAX_DEPTH];
        let mut count = 0usize;
        let mut next = if self.nodes.is_empty() { None } else { enter(0, limit).map(|_| 0) };
        loop {
            let Some(node) = next else {
                // A waiting node may be beyond the limit by now.
                let Some(last) = count.checked_sub(1) else { return };
                count = last;
                let (near, node) = waiting[count];
                next = (near <= limit).then_some(node);
                continue;
            };
            let Node { second_child, instance, .. } = self.nodes[node as usize];
            next = None;
            if second_child == 0 {
                limit = act(instance, limit);
                continue;
            }
            let first = node + 1;
            next = match (enter(first, limit), enter(second_child, limit)) {
                (Some(a), Some(b)) => {
                    let (near, far) = if b < a { (second_child, (a, first)) } else { (first, (b, second_child)) };
                    waiting[count] = far;
                    count += 1;
                    Some(near)
                }
                (Some(_), None) => Some(first),
                (None, Some(_)) => Some(second_child),
                (None, None) => None,
            };
        }
    }
}

impl InstanceBvh {
    /// Visits the instances whose boxes rays of a group may meet, near boxes first for most rays: `act` receives an instance,
    /// those of `lanes` whose rays may meet its box, and their distances to it.
    #[inline(always)]
    pub(super) fn traverse_group<S: Simd>(
        &self,
        s: S,
        slabs: &Slabs<S>,
        lanes: M<S>,
        mut act: impl FnMut(u32, M<S>, F<S>),
    ) {
        let enter = {
            #[inline(always)]
            |node: u32| {
                let (met, near) = slabs.enter(s, &self.nodes[node as usize].bounds);
                (met & lanes, near)
            }
        };
        let mut waiting = [0u32; MAX_DEPTH];
        let mut count = usize::from(!self.nodes.is_empty());
        while let Some(last) = count.checked_sub(1) {
            count = last;
            let mut node = waiting[count];
            let (mut met, mut near) = enter(node);
            while met.any_true() {
                let Node { second_child, instance, .. } = self.nodes[node as usize];
                if second_child == 0 {
                    act(instance, met, near);
                    break;
                }
                let first = (node + 1, enter(node + 1));
                let second = (second_child, enter(second_child));
                let (one, other) = (first.1.0.to_bitmask(), second.1.0.to_bitmask());
                // Any ray that may meet both boxes decides about the order.
                let both = (one & other).trailing_zeros() as usize % LANES;
                let is_first = one != 0 && (other == 0 || first.1.1.array()[both] <= second.1.1.array()[both]);
                let (next, later) = if is_first { (first, second) } else { (second, first) };
                if one != 0 && other != 0 {
                    waiting[count] = later.0;
                    count += 1;
                }
                (node, (met, near)) = next;
            }
        }
    }
}

const EMPTY: [V3; 2] = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];

fn union(all: [V3; 2], b: &[V3; 2]) -> [V3; 2] {
    [[0, 1, 2].map(|k| all[0][k].min(b[0][k])), [0, 1, 2].map(|k| all[1][k].max(b[1][k]))]
}

/// Order by the centers along an axis; of equal centers the first instance comes first.
fn order(axis: usize, a: &InstanceItem, b: &InstanceItem) -> std::cmp::Ordering {
    a.1[axis].total_cmp(&b.1[axis]).then(a.2.cmp(&b.2))
}

/// Sorts a few boxes for the best split; returns its position.
fn best_split(boxes: &mut [InstanceItem]) -> usize {
    let area = |b: [V3; 2]| {
        let [x, y, z] = [0, 1, 2].map(|k| b[1][k] - b[0][k]);
        x * y + y * z + z * x
    };
    let mut best = (f64::INFINITY, 0, boxes.len() / 2);
    for axis in 0..3 {
        boxes.sort_unstable_by(|a, b| order(axis, a, b));
        let mut costs = [0.0f64; MAX_SAH_SPLIT];
        let mut sum = EMPTY;
        for (k, (b, ..)) in boxes.iter().enumerate().skip(1).rev() {
            sum = union(sum, b);
            costs[k] = (boxes.len() - k) as f64 * area(sum);
        }
        sum = EMPTY;
        for (k, (b, ..)) in (1..).zip(&boxes[..boxes.len() - 1]) {
            sum = union(sum, b);
            let cost = k as f64 * area(sum) + costs[k];
            if cost < best.0 {
                best = (cost, axis, k);
            }
        }
    }
    if best.1 != 2 {
        boxes.sort_unstable_by(|a, b| order(best.1, a, b));
    }
    best.2
}

/// Adds the node of some boxes, and all nodes below.
fn split(boxes: &mut [InstanceItem], nodes: &mut Vec<Node>, depth: usize) {
    let bounds = boxes.iter().fold(EMPTY, |all, (b, ..)| union(all, b));
    let index = nodes.len();
    nodes.push(Node { bounds, second_child: 0, instance: boxes[0].2 });
    if boxes.len() == 1 {
        return;
    }
    let at =
        if depth < MAX_SAH_DEPTH && boxes.len() <= MAX_SAH_SPLIT { best_split(boxes) } else { median_split(boxes) };
    let (low, high) = boxes.split_at_mut(at);
    split(low, nodes, depth + 1);
    nodes[index].second_child = nodes.len() as u32;
    split(high, nodes, depth + 1);
}

/// Partitions boxes at their median center, along the axis with the widest spread of centers. Returns the index of the
/// first box of the second half.
fn median_split(boxes: &mut [InstanceItem]) -> usize {
    let spread = |axis: usize| {
        let ends = boxes
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], (_, m, _)| [lo.min(m[axis]), hi.max(m[axis])]);
        ends[1] - ends[0]
    };
    let axis = (1..3).fold(0, |best, k| if spread(k) > spread(best) { k } else { best });
    let half = boxes.len() / 2;
    boxes.select_nth_unstable_by(half, |a, b| order(axis, a, b));
    half
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::TestRng;
    use crate::simd::{all_levels, at_level, splat};
    use crate::trace::RayGroup;
    use kinetoscope_scene::vector::dot;

    /// Rays to points a billionth inside of edges of boxes meet the boxes, although groups are in single precision; those
    /// a thousandth outside do not.
    #[test]
    fn groups_at_edges() {
        let mut rng = TestRng(11);
        let mut tree = InstanceBvh::default();
        let mut boxes = Vec::new();
        for k in 0..64 {
            let lo = rng.point(2.0);
            let size = [0, 1, 2].map(|_| rng.uniform(0.01, 0.5));
            boxes.push([lo, add(lo, size)]);
            tree.add(k, &PoseF64::IDENTITY, boxes[k as usize]);
        }
        tree.build();
        for distance in [0.5, 3.0, 100.0] {
            for number in 0..200 {
                let [lo, hi] = boxes[number % boxes.len()];
                // Rays along a face lose most digits.
                let slope = [1.0, 1e-2, 1e-4][number % 3];
                for (inset, is_met) in [(1e-9, true), (-1e-3, false)] {
                    let rays: [Ray; LANES] = std::array::from_fn(|lane| {
                        // Along the axis of the edge, the point is in the middle; a ray in the plane through it across
                        // meets the box at the edge alone.
                        let axis = lane % 3;
                        let along = [(axis + 1) % 3, (axis + 2) % 3];
                        let mut point = scale(add(lo, hi), 0.5);
                        let mut d = [0.0; 3];
                        let [s, t] = [0, 1].map(|bit| if lane >> bit & 1 == 1 { 1.0 } else { -1.0 });
                        for (k, sign) in [(along[0], s), (along[1], t)] {
                            point[k] = if sign > 0.0 { hi[k] } else { lo[k] } - sign * inset * distance;
                        }
                        (d[along[0]], d[along[1]]) = (s * rng.uniform(0.2, 1.0), -t * slope * rng.uniform(0.2, 1.0));
                        let direction = scale(d, 1.0 / dot(d, d).sqrt());
                        Ray { origin: sub(point, scale(direction, distance)), direction }
                    });
                    for level in all_levels() {
                        let mut met = 0u64;
                        at_level!(level, s => s.vectorize(#[inline(always)] || {
                            let group = RayGroup::of(s, &rays);
                            let all = splat(s, 0.0).simd_eq(splat(s, 0.0));
                            let slabs = Slabs::new(s, group, all, 3.0);
                            tree.traverse_group(s, &slabs, all, |instance, lanes, _| {
                                if instance as usize == number % boxes.len() {
                                    met = lanes.to_bitmask();
                                }
                            });
                        }));
                        assert_eq!(met, if is_met { 0xffff } else { 0 }, "box {number}, {distance} m, {inset}");
                    }
                }
            }
        }
    }

    #[test]
    fn brute_force() {
        let mut state = 9u64;
        let mut number = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for count in [0usize, 1, 2, 3, 7, 64, 65, 300] {
            let mut tree = InstanceBvh::default();
            let boxes: Vec<[V3; 2]> = (0..count)
                .map(|_| {
                    let lo = [0, 1, 2].map(|_| 4.0 * number() - 2.0);
                    [lo, lo.map(|x| x + 0.5 * number())]
                })
                .collect();
            for (k, b) in boxes.iter().enumerate() {
                tree.add(k as u32, &PoseF64::IDENTITY, *b);
            }
            tree.build();
            let mut met_at_all = 0;
            for _ in 0..200 {
                let d = [0, 1, 2].map(|_| number() - 0.5);
                let length = d.iter().map(|x| x * x).sum::<f64>().sqrt();
                let ray = Ray { origin: [0, 1, 2].map(|_| 6.0 * number() - 3.0), direction: d.map(|x| x / length) };
                let limit = 3.0 * number();
                // The textbook's slab test, with the original boxes.
                let meets = |[lo, hi]: &[V3; 2]| {
                    let (mut near, mut far) = (0.0f64, limit);
                    for (k, (o, d)) in ray.origin.iter().zip(ray.direction).enumerate() {
                        let (a, b) = ((lo[k] - o) / d, (hi[k] - o) / d);
                        (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
                    }
                    near <= far
                };
                let mut visited = vec![false; count];
                tree.traverse(&ray, limit, |thing, limit| {
                    assert!(!std::mem::replace(&mut visited[thing as usize], true), "visited twice");
                    limit
                });
                for (visited, b) in visited.iter().zip(&boxes) {
                    assert!(*visited || !meets(b), "{count} boxes");
                    // Boxes are enlarged by a millionth: few are visited needlessly.
                    met_at_all += usize::from(*visited != meets(b));
                }
            }
            assert!(met_at_all <= 2, "{met_at_all} of {count} boxes visited for nothing");
        }
    }
}

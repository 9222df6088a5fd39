//! Builds a BVH. Boxes are sorted along a Morton curve; boxes that are close together on it become groups. A group is
//! one node: among all ways to split it along the curve into at most eight leaves, the cheapest by the surface area
//! heuristic (SAH). Above groups, the heuristic selects planes between bins along the longest side, two children at a
//! time; eight such children are a node.
//!
//! Sources: Wald, On fast construction of SAH-based bounding volume hierarchies, 2007; Lauterbach et al., Fast BVH
//! construction on GPUs, 2009; Ganestam et al., Bonsai: rapid bounding volume hierarchy generation using mini trees,
//! JCGT 4(3), 2015.

use super::{Aabb, BVH_WIDTH, Bvh, Node, PAD};
use crate::simd::{F4, Simd, SimdLevel, at_level};
use kinetoscope_scene::vector::to_f64;
use leaves::Costs;
use morton::MortonOrder;

mod leaves;
mod morton;
mod split;

/// Largest number of primitives in a group.
const MAX_GROUP: usize = 24;
/// Groups up to this size are leaves of the node above.
const SINGLE_LEAF: usize = 3;
/// Below this depth ranges are split in half by count: primitives spread over many orders of magnitude.
const MAX_DEPTH: u32 = 48;
/// Added to a coordinate between 0 and 2^22, it puts the integer part into the last bits; rounding needs no
/// instruction.
const TO_BITS: f32 = 12_582_912.0;

/// Three numbers in a register of four lanes.
type Quad = [f32; 4];

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    lo: Quad,
    hi: Quad,
}

/// Box of a primitive or of a group. The fourth components hold its index (as bits) and its number of primitives.
type BuildItem = Bounds;

const EMPTY: Bounds = Bounds { lo: [f32::INFINITY; 4], hi: [f32::NEG_INFINITY; 4] };

#[inline(always)]
fn quad(f: impl Fn(usize) -> f32) -> Quad {
    std::array::from_fn(f)
}

impl Bounds {
    fn item(lo: [f32; 3], hi: [f32; 3], number: u32, count: u32) -> Self {
        Self { lo: [lo[0], lo[1], lo[2], f32::from_bits(number)], hi: [hi[0], hi[1], hi[2], count as f32] }
    }

    fn index(&self) -> u32 {
        self.lo[3].to_bits()
    }

    /// The box around both. Plain comparisons, because those of the library check for NaN.
    #[inline(always)]
    fn union(&self, other: &Self) -> Self {
        Self {
            lo: quad(|k| if self.lo[k] < other.lo[k] { self.lo[k] } else { other.lo[k] }),
            hi: quad(|k| if self.hi[k] > other.hi[k] { self.hi[k] } else { other.hi[k] }),
        }
    }

    fn enclosing(all: &[Self]) -> Self {
        all.iter().fold(EMPTY, |sum, one| sum.union(one))
    }

    #[inline(always)]
    fn center(&self) -> Quad {
        quad(|k| 0.5 * self.lo[k] + 0.5 * self.hi[k])
    }

    /// Half the surface area.
    #[inline(always)]
    fn area(&self) -> f32 {
        let [x, y, z, _] = quad(|k| self.hi[k] - self.lo[k]);
        x * y + y * z + z * x
    }
}

/// Bounding box of all items.
#[inline(always)]
fn bounds_of<S: Simd>(s: S, all: &[BuildItem]) -> Bounds {
    let mut lo = F4::load(s, &EMPTY.lo);
    let mut hi = F4::load(s, &EMPTY.hi);
    for item in all {
        lo = F4::load(s, &item.lo).min(lo);
        hi = F4::load(s, &item.hi).max(hi);
    }
    Bounds { lo: lo.array(), hi: hi.array() }
}

/// Maps a point to one of N cells along each axis of a box.
#[derive(Clone, Copy, Debug)]
struct BinMapping<const N: usize> {
    base: Quad,
    /// Cells per unit length; 0 along axes without a usable length.
    scale: Quad,
}

impl<const N: usize> BinMapping<N> {
    fn new(within: &Bounds) -> Self {
        // The factor below 1 keeps the last point of the box in the last cell.
        let scale = quad(|k| (N as f32 * (1.0 - 1e-6)) / (within.hi[k] - within.lo[k]));
        Self { base: within.lo, scale: scale.map(|x| if x.is_finite() { x } else { 0.0 }) }
    }

    #[inline(always)]
    fn bin(&self, axis: usize, x: f32) -> u32 {
        ((x - self.base[axis]) * self.scale[axis] - 0.5 + TO_BITS).to_bits() & (N as u32 - 1)
    }
}

/// A range of groups.
#[derive(Clone, Copy, Debug)]
struct GroupRange {
    bounds: Bounds,
    start: u32,
    end: u32,
    depth: u32,
}

impl GroupRange {
    fn len(&self) -> usize {
        (self.end - self.start) as usize
    }

    /// Priority of splitting the range; below any area if it cannot be split.
    #[inline(always)]
    fn split_priority(&self) -> f32 {
        if self.len() > 1 { self.bounds.area() } else { -1.0 }
    }

    /// The first `count` groups and the rest.
    #[inline(always)]
    fn split_at(&self, count: usize, [near, far]: [Bounds; 2]) -> [Self; 2] {
        let (at, depth) = (self.start + count as u32, self.depth + 1);
        [Self { bounds: near, end: at, depth, ..*self }, Self { bounds: far, start: at, depth, ..*self }]
    }
}

/// A child of a node: a node, or the primitives of a leaf.
#[derive(Clone, Copy, Debug)]
struct Child {
    /// Index of the node, or of the first primitive.
    index: u32,
    /// Number of primitives; 0 for a node.
    count: u32,
}

/// Builds BVHs one after the other and keeps its memory between builds.
#[derive(Debug)]
pub(crate) struct BvhBuilder {
    level: SimdLevel,
    unsorted: Vec<BuildItem>,
    curve: MortonOrder,
    /// Start of each group on the curve, and the end of the last one.
    starts: Vec<u32>,
    groups: Vec<BuildItem>,
    /// Each group as a child of the node above it.
    children: Vec<Child>,
    /// Scratch memory for splits.
    scratch: Vec<BuildItem>,
    nodes: Vec<Node>,
    costs: Costs,
    pad: f32,
}

impl Node {
    const EMPTY: Self = {
        let (empty, full) = ([f32::INFINITY; BVH_WIDTH], [f32::NEG_INFINITY; BVH_WIDTH]);
        Self { sides: [empty, empty, empty, full, full, full], child: [0; BVH_WIDTH], count: [0; BVH_WIDTH] }
    };

    #[inline(always)]
    fn set(&mut self, k: usize, Bounds { lo, hi }: &Bounds, pad: f32, child: Child) {
        for axis in 0..3 {
            self.sides[axis][k] = lo[axis] - pad;
            self.sides[axis + 3][k] = hi[axis] + pad;
        }
        (self.child[k], self.count[k]) = (child.index, child.count);
    }
}

impl Bvh {
    /// Builds a BVH over boxes of finite numbers; returns it and the order of the boxes in its leaves. The same boxes
    /// give the same BVH.
    pub(crate) fn build(boxes: impl IntoIterator<Item = Aabb>) -> (Self, Vec<u32>) {
        BvhBuilder::new(SimdLevel::best()).build(boxes)
    }
}

impl BvhBuilder {
    /// Creates a builder for a SIMD level. The BVHs are the same at every level.
    pub(crate) fn new(level: SimdLevel) -> Self {
        Self {
            level,
            unsorted: Vec::new(),
            curve: MortonOrder::default(),
            starts: Vec::new(),
            groups: Vec::new(),
            children: Vec::new(),
            scratch: Vec::new(),
            nodes: Vec::new(),
            costs: Costs::default(),
            pad: 0.0,
        }
    }

    /// Builds a BVH over boxes of finite numbers; returns it and the order of the boxes in its leaves. The same boxes
    /// give the same BVH.
    pub(crate) fn build(&mut self, boxes: impl IntoIterator<Item = Aabb>) -> (Bvh, Vec<u32>) {
        self.unsorted.clear();
        self.unsorted.extend((0..).zip(boxes).map(|(k, [lo, hi])| BuildItem::item(lo, hi, k, 1)));
        if self.unsorted.is_empty() {
            return (
                Bvh { nodes: Vec::new(), root: 0, bounds: [[0.0; 3]; 2], padded_bounds: [[0.0; 3]; 2] },
                Vec::new(),
            );
        }
        at_level!(self.level, s => s.vectorize(
            #[inline(always)]
            || self.build_unsorted(s)
        ))
    }

    #[inline(always)]
    fn build_unsorted<S: Simd>(&mut self, s: S) -> (Bvh, Vec<u32>) {
        let bounds = bounds_of(s, &self.unsorted);
        let sorted = self.curve.sort(s, &self.unsorted, &bounds, &mut self.starts);
        let order: Vec<u32> = sorted.iter().map(|&key| key as u32).collect();
        let around = [bounds.lo, bounds.hi].map(|q| [q[0], q[1], q[2]]);
        let [lo, hi] = around.map(to_f64);
        let reach = lo.iter().chain(&hi).fold(0.0f64, |m, x| m.max(x.abs()));
        let pad = reach * PAD;
        // Rounding a side takes up to u R off a pad of 16 u R.
        self.pad = ((pad * (1.0 + 1.0 / 16.0)) as f32).max(f32::MIN_POSITIVE);
        let count = self.starts.len() - 1;
        self.groups.clear();
        self.children.clear();
        self.nodes = Vec::with_capacity(count + count / 4 + 1);
        self.add_groups(s, &order);
        let root = if count == 1 {
            0
        } else {
            self.scratch.clone_from(&self.groups);
            self.build_wide_node([GroupRange { bounds, start: 0, end: count as u32, depth: 0 }; 2], 1)
        };
        let padded_bounds = [lo.map(|x| x - pad), hi.map(|x| x + pad)];
        (Bvh { nodes: std::mem::take(&mut self.nodes), root, bounds: around, padded_bounds }, order)
    }

    /// Adds all groups; `order` holds the indices of their primitives, group by group.
    #[inline(always)]
    fn add_groups<S: Simd>(&mut self, s: S, order: &[u32]) {
        let mut things = [EMPTY; MAX_GROUP];
        for k in 1..self.starts.len() {
            let [start, end] = [self.starts[k - 1], self.starts[k]];
            let order = &order[start as usize..end as usize];
            for (thing, &number) in things.iter_mut().zip(order) {
                *thing = self.unsorted[number as usize];
            }
            let alone = self.starts.len() == 2;
            self.add_group(s, &things[..order.len().min(MAX_GROUP)], start, alone);
        }
    }
}

impl BvhBuilder {
    /// Adds a group whose first primitive is at `start`, and its node if it needs one.
    #[inline(always)]
    fn add_group<S: Simd>(&mut self, s: S, things: &[BuildItem], start: u32, alone: bool) {
        let count = things.len() as u32;
        let (around, child) = if things.len() <= SINGLE_LEAF && !alone {
            (bounds_of(s, things), Child { index: start, count })
        } else {
            let (ends, leaves) = leaves::leaf_ends(s, things, &mut self.costs);
            // Filled in place.
            let index = self.push(Node::EMPTY);
            let node = &mut self.nodes[index as usize];
            let (mut around, mut first) = (EMPTY, 0);
            for (k, end) in ends.into_iter().map(usize::from).enumerate().take(leaves) {
                let leaf = bounds_of(s, &things[first..end]);
                let child = Child { index: start + first as u32, count: (end - first) as u32 };
                node.set(k, &leaf, self.pad, child);
                (around, first) = (around.union(&leaf), end);
            }
            (around, Child { index, count: 0 })
        };
        let ([a, b, c, _], [d, e, f, _]) = (around.lo, around.hi);
        self.groups.push(BuildItem::item([a, b, c], [d, e, f], self.children.len() as u32, count));
        self.children.push(child);
    }

    #[inline(always)]
    fn push(&mut self, node: Node) -> u32 {
        self.nodes.push(node);
        self.nodes.len() as u32 - 1
    }

    /// Adds the wide node of the first `count` of two ranges, and all nodes below it that are above groups; returns its
    /// index.
    fn build_wide_node(&mut self, seed: [GroupRange; 2], mut count: usize) -> u32 {
        let mut parts = [seed[0]; BVH_WIDTH];
        parts[1] = seed[1];
        let mut worth = [-1.0f32; BVH_WIDTH];
        for (worth, part) in worth.iter_mut().zip(&parts).take(count) {
            *worth = part.split_priority();
        }
        // Splits the largest range until there are eight.
        while count < BVH_WIDTH {
            let (mut largest, mut most) = (0, worth[0]);
            for (k, &other) in worth.iter().enumerate().skip(1) {
                (largest, most) = if other > most { (k, other) } else { (largest, most) };
            }
            if most < 0.0 {
                break;
            }
            let [first, second] = self.split(&parts[largest]);
            (worth[largest], worth[count]) = (first.split_priority(), second.split_priority());
            (parts[largest], parts[count]) = (first, second);
            count += 1;
        }
        let mut node = Node::EMPTY;
        for (k, part) in parts.iter().enumerate().take(count) {
            let child = if part.len() == 1 {
                self.children[self.groups[part.start as usize].index() as usize]
            } else if part.len() <= BVH_WIDTH {
                Child { index: self.build_small(part), count: 0 }
            } else {
                let halves = self.split(part);
                Child { index: self.build_wide_node(halves, 2), count: 0 }
            };
            node.set(k, &part.bounds, self.pad, child);
        }
        self.push(node)
    }

    /// Adds the node of a range of at most eight groups: however the range is split, all groups are children of this
    /// node.
    fn build_small(&mut self, part: &GroupRange) -> u32 {
        let mut node = Node::EMPTY;
        for (k, group) in self.groups[part.start as usize..part.end as usize].iter().enumerate().take(BVH_WIDTH) {
            node.set(k, group, self.pad, self.children[group.index() as usize]);
        }
        self.push(node)
    }

    /// Splits a range of several groups.
    #[inline(always)]
    fn split(&mut self, part: &GroupRange) -> [GroupRange; 2] {
        let groups = &mut self.groups[part.start as usize..part.end as usize];
        let best =
            if part.depth < MAX_DEPTH { split::best_split(&part.bounds, groups, &mut self.scratch) } else { None };
        let (at, sides) = best.unwrap_or_else(|| {
            // No plane separates the groups, or the range is too deep.
            let at = groups.len() / 2;
            (at, [Bounds::enclosing(&groups[..at]), Bounds::enclosing(&groups[at..])])
        });
        part.split_at(at, sides)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::bvh::TraversalStack;
    use kinetoscope_scene::Ray;

    /// Mean number of boxes that a ray down into the unit square tests.
    fn tested(boxes: &[Aabb]) -> f64 {
        let (tree, order) = Bvh::build(boxes.iter().copied());
        let mut seen = order.clone();
        seen.sort_unstable();
        assert!(seen.into_iter().eq(0..boxes.len() as u32), "each item is in exactly one leaf");
        let (mut stack, mut count) = (TraversalStack::default(), 0);
        const RAYS: usize = 100;
        for k in 0..RAYS {
            let [x, y] = [0.05 + 0.009 * k as f64, (0.1 + 0.377 * k as f64).fract()];
            let ray = Ray { origin: [x, y, 1.0], direction: [0.0, 0.0, -1.0] };
            tree.traverse(&ray, 10.0, &mut stack, |leaf, limit| {
                count += leaf.len();
                limit
            });
        }
        count as f64 / RAYS as f64
    }

    /// A floor of 10 000 tiles without gaps, in an order unrelated to their positions, with a random thickness up to
    /// `thick`: a ray meets one tile, or two.
    fn floor(thick: f32) -> Vec<Aabb> {
        let tile = |k: u32| {
            let k = k * 7919 % 10_000;
            let [x, y] = [(k % 100) as f32 / 100.0, (k / 100) as f32 / 100.0];
            let z = thick * (k * 3571 % 1000) as f32 / 1000.0;
            [[x, y, z], [x + 0.01, y + 0.01, z]]
        };
        (0..10_000).map(tile).collect()
    }

    /// Root causes: a grid over everything put all boxes into one cell if one box was far away, so the order of the
    /// file decided. Noise across a flat object was split as if it were as long as the other sides.
    #[test]
    fn outliers_and_noise() {
        let plain = tested(&floor(0.0));
        assert!(plain < 16.0, "{plain}");
        let noisy = tested(&floor(1e-8));
        assert!(noisy < 1.5 * plain, "{noisy}, not {plain}");
        for far in [30.0f32, 300.0, 3e3] {
            let mut boxes = floor(0.0);
            boxes.push([[far, far, 0.0], [far + 1.0, far + 1.0, 0.0]]);
            let outlying = tested(&boxes);
            // Boxes are padded for the largest coordinate of the scene: tiles of 1 cm overlap, by 3 mm on each side at
            // 3 km.
            let grown = (1.0 + 2.0 * f64::from(far + 1.0) * PAD * (1.0 + 1.0 / 16.0) / 0.01).powi(2);
            assert!(outlying < 1.5 * plain * grown, "{far}: {outlying}, not {plain} times {grown}");
        }
        // All boxes at one place: each box is tested, and the recursion ends.
        assert_eq!(tested(&vec![[[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]]; 1000]), 1000.0);
    }
}

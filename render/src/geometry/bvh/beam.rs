//! Beams of nearly parallel rays: one BVH traversal for the part of the tree that any of them may meet.
//!
//! Depth is the coordinate along the dominant axis of all rays. Across it, along either other axis, the rays lie
//! between two straight lines. A ray's position is linear in the depth. So the smallest of several rays is nowhere
//! below the chord between two depths, and the largest nowhere above. A box is met if it reaches between the lines over
//! its own depths.
//!
//! Errors are in units of u R (u = 2^-24, R the largest coordinate of the tree). The single precision height of a line
//! is off by at most 4 for its rounded height at depth 0, 1 for its slope (which is at most 1), 1 for a rounded end of
//! the depths, and 1 and 5 for the product and the sum. That is less than the padding of the boxes,
//! [`PAD`](super::PAD). It holds for heights at depth 0 up to 4 R: lines that begin farther out stay outside of the
//! tree, by more than their error.

use super::{BVH_WIDTH, Bvh, Node, StackEntry, TraversalStack, insert};
use crate::geometry::packet::Packet;
use crate::geometry::triangle::ShearedPacket;
use crate::simd::{D, Simd};
use std::ops::Range;

/// Rays from farther away than this multiple of the largest coordinate are cast one by one. Their positions at the tree
/// are not accurate enough in double precision for lines that are right to single precision.
pub(crate) const MAX_ORIGIN_RATIO: f64 = (1u32 << 20) as f64;
/// Fraction of the largest coordinate: chords between depths closer than this have no slope.
const MIN_DEPTH_RATIO: f64 = 1e-4;

/// A bundle of nearly parallel rays.
#[derive(Clone, Copy)]
pub(crate) struct Beam<S: Simd> {
    /// Permutation of the axes; the axis of depth comes last.
    axes: [usize; 3],
    /// Factor from the coordinate to depth: 1 or -1.
    sign: f32,
    start: f32,
    end: f32,
    /// Lower and upper line along the first axis, then along the second: height at depth 0, and the slope's positive
    /// and negative part.
    lines: [[f32; 3]; 4],
    /// Depth of the ray origins, and depth per unit of distance.
    depth: D<S>,
    speed: D<S>,
    /// Approximate fraction of the tree's cross-section between the lines.
    covered_fraction: f64,
}

/// Result of a traversal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Traversal {
    /// All leaves that the rays may meet were visited.
    Complete,
    /// Stopped before the budget was exceeded; leaves are missing.
    OverBudget,
}

impl<S: Simd> Beam<S> {
    /// The beam around all lanes of a packet, within a tree; `None` if rays go both ways along the axis of depth, or if
    /// single precision cannot bound them.
    #[inline(always)]
    pub(crate) fn enclosing(s: S, packet: &Packet, shear: &ShearedPacket<S>, tree: &Bvh) -> Option<Self> {
        let axes @ [i, j, k] = shear.axes();
        let [lo, hi] = tree.padded_bounds;
        let reach = (0..3).fold(0.0f64, |m, k| m.max(lo[k].abs()).max(hi[k].abs()));
        let (origin, by, along) = (shear.origin(), shear.slopes(), packet.directions(s)[k]);
        let farthest = origin[0].abs().max(origin[1].abs()).max(origin[2].abs()).reduce_max();
        let backward = along.lt(D::splat(s, 0.0)).to_bitmask();
        if backward != 0 && backward != crate::geometry::packet::ALL || farthest > MAX_ORIGIN_RATIO * reach {
            return None;
        }
        let sign = if backward == 0 { 1.0 } else { -1.0 };
        let (depth, speed) = (origin[2] * sign, along * sign);
        let (near, far) = if backward == 0 { (lo[k], hi[k]) } else { (-hi[k], -lo[k]) };
        let start = depth.reduce_min().max(near);
        let end = (depth + packet.limits(s) * speed).reduce_max().min(far);
        let mut beam = Self {
            axes,
            sign: sign as f32,
            start: start as f32,
            end: end as f32,
            lines: [[0.0; 3]; 4],
            depth,
            speed,
            covered_fraction: 1.0,
        };
        let mut finite = start.is_finite() && end.is_finite();
        for axis in 0..2 {
            let at = [i, j][axis];
            let slope = by[axis] * sign;
            let first = origin[axis] + slope * (D::splat(s, start) - depth);
            let last = origin[axis] + slope * (D::splat(s, end) - depth);
            let (low, high) = ([first.reduce_min(), last.reduce_min()], [first.reduce_max(), last.reduce_max()]);
            beam.lines[2 * axis] = line([start, end], low, reach, f64::min);
            beam.lines[2 * axis + 1] = line([start, end], high, reach, f64::max);
            let wide = 0.5 * ((high[0] - low[0]) + (high[1] - low[1]));
            beam.covered_fraction *= (wide / (hi[at] - lo[at])).min(1.0);
            finite &= beam.lines[2 * axis..2 * axis + 2].iter().flatten().all(|x| x.is_finite());
        }
        finite.then_some(beam)
    }

    /// Approximate fraction of the tree's primitives that lie in the beam.
    #[inline(always)]
    pub(crate) fn covered_fraction(&self) -> f64 {
        self.covered_fraction
    }

    /// The largest depth within the limits, rounded up.
    #[inline(always)]
    fn max_depth(&self, limits: D<S>) -> f32 {
        ((self.depth + limits * self.speed).reduce_max() as f32).next_up()
    }

    /// Depths at which the boxes begin, and a bit for each box that is met before the depth `deepest`.
    #[inline(always)]
    fn intersect_children(&self, node: &Node, deepest: f32) -> ([f32; BVH_WIDTH], u32) {
        let [i, j, k] = self.axes;
        let sides = &node.sides;
        let (near, far) = if self.sign > 0.0 { (&sides[k], &sides[k + 3]) } else { (&sides[k + 3], &sides[k]) };
        let (u0, u1, v0, v1) = (&sides[i], &sides[i + 3], &sides[j], &sides[j + 3]);
        let [[al, pl, nl], [ah, ph, nh], [bl, ql, ml], [bh, qh, mh]] = self.lines;
        let (start, end, sign) = (self.start, self.end, self.sign);
        let within = |z: f32| {
            let z = if z > start { z } else { start };
            if z < end { z } else { end }
        };
        // One plain loop, which compilers vectorize.
        let (mut from, mut hit) = ([0.0f32; BVH_WIDTH], [0u32; BVH_WIDTH]);
        for c in 0..BVH_WIDTH {
            let (z0, z1) = (near[c] * sign, far[c] * sign);
            from[c] = z0;
            let (a, b) = (within(z0), within(z1));
            // A rising line is lowest at the near side.
            let deep = (z0 <= deepest) & (z1 >= start);
            let u = (al + pl * a + nl * b <= u1[c]) & (ah + ph * b + nh * a >= u0[c]);
            let v = (bl + ql * a + ml * b <= v1[c]) & (bh + qh * b + mh * a >= v0[c]);
            hit[c] = u32::from(deep & u & v) << c;
        }
        (from, hit.iter().fold(0, |bits, bit| bits | bit))
    }
}

/// The line through two heights: height at depth 0, positive and negative part of the slope. If the depths are too
/// close together, the slope is 0 and `outer` chooses one of the heights.
#[inline(always)]
fn line([start, end]: [f64; 2], [a, b]: [f64; 2], reach: f64, outer: fn(f64, f64) -> f64) -> [f32; 3] {
    let long = end - start;
    let slope = if long > MIN_DEPTH_RATIO * reach { (b - a) / long } else { 0.0 };
    let height = if long > MIN_DEPTH_RATIO * reach { a - slope * start } else { outer(a, b) };
    [height as f32, slope.max(0.0) as f32, slope.min(0.0) as f32]
}

impl Bvh {
    /// Visits the leaves that the rays of a beam may meet within their limits, those of near nodes first, and stops
    /// before a leaf that exceeds the `budget` of primitives. `leaf` receives the primitives of a leaf and returns new
    /// limits if they changed.
    #[inline(always)]
    pub(crate) fn traverse_beam<S: Simd>(
        &self,
        beam: &Beam<S>,
        limits: D<S>,
        mut budget: usize,
        TraversalStack(stack): &mut TraversalStack,
        mut leaf: impl FnMut(Range<usize>) -> Option<D<S>>,
    ) -> Traversal {
        if self.nodes.is_empty() || beam.start > beam.end {
            return Traversal::Complete;
        }
        let mut deepest = beam.max_depth(limits);
        stack.clear();
        let mut index = self.root as usize;
        loop {
            let node = &self.nodes[index];
            let (near, mut hit) = beam.intersect_children(node, deepest);
            let bottom = stack.len();
            while hit != 0 {
                let k = hit.trailing_zeros() as usize & (BVH_WIDTH - 1);
                hit &= hit - 1;
                let (child, count) = (node.child[k], node.count[k]);
                if count == 0 {
                    insert(stack, bottom, StackEntry { entry_distance: near[k], child, count });
                    continue;
                }
                // Leaves are visited at once: their order among neighbors is worth less than keeping it.
                let (first, count) = (child as usize, count as usize);
                if count > budget {
                    return Traversal::OverBudget;
                }
                budget -= count;
                if let Some(limits) = leaf(first..first + count) {
                    deepest = beam.max_depth(limits);
                }
            }
            index = loop {
                match stack.pop() {
                    Some(next) if next.entry_distance <= deepest => break next.child as usize,
                    Some(_) => {}
                    None => return Traversal::Complete,
                }
            };
        }
    }
}

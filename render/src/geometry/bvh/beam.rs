//! Rays that run side by side, and the part of a tree that they may meet: one walk for all of them.
//!
//! Depth is the coordinate along the axis that all rays run along most. Across it, the rays are between two straight lines
//! along either other axis: where a ray is, is linear in the depth, so the smallest of some rays is nowhere below the chord
//! between two depths, and the largest nowhere above. A box is met where it reaches between the lines over its own depths.
//!
//! In units of u R (u = 2^-24, R the largest coordinate of the tree) a line's single precision height is off by at most 4 for
//! its rounded height at depth 0, 1 for its slope (which is at most 1), 1 for a rounded end of the depths, and 1 and 5 for
//! the product and the sum: less than what boxes are larger than what they hold, [`PAD`](super::PAD). That is with heights
//! at depth 0 up to 4 R: lines that begin farther out stay outside of the tree, by more than their error.

use super::{Bvh, Entry, Node, Stack, WIDE, insert};
use crate::geometry::packet::Packet;
use crate::geometry::triangle::ShearPacket;
use crate::simd::{D, Simd};
use std::ops::Range;

/// Rays from farther away than this many times the largest coordinate are cast one by one: their positions at the tree are
/// not known well enough in double precision for the lines to be right to single precision.
pub(crate) const FAR: f64 = (1u32 << 20) as f64;
/// A part of the largest coordinate: chords between depths closer than this are not sloped.
const THIN: f64 = 1e-4;

/// Rays side by side.
#[derive(Clone, Copy)]
pub(crate) struct Beam<S: Simd> {
    /// The axis of depth comes last.
    axes: [usize; 3],
    /// Depth by the coordinate: 1 or -1.
    sign: f32,
    start: f32,
    end: f32,
    /// The lower and the upper line along the first axis, then along the second: height at depth 0, and the slope, once where
    /// it is positive and once where it is negative.
    lines: [[f32; 3]; 4],
    /// Where rays begin, and how fast they get deeper.
    depth: D<S>,
    speed: D<S>,
    /// Part of the tree's cross-section that lies between the lines, about.
    share: f64,
}

/// How a walk ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Walked {
    /// All that may be met was visited.
    All,
    /// More was to be visited than the budget allows.
    Part,
}

impl<S: Simd> Beam<S> {
    /// Around all lanes of a packet, where it may meet a tree; `None` where it cannot be told in single precision.
    #[inline(always)]
    pub(crate) fn around(s: S, packet: &Packet, shear: &ShearPacket<S>, tree: &Bvh) -> Option<Self> {
        let axes @ [i, j, k] = shear.axes();
        let [lo, hi] = tree.bounds;
        let reach = (0..3).fold(0.0f64, |m, k| m.max(lo[k].abs()).max(hi[k].abs()));
        let (origin, by, along) = (shear.origin(), shear.slopes(), packet.directions(s)[k]);
        let farthest = origin[0].abs().max(origin[1].abs()).max(origin[2].abs()).most();
        let backward = along.lt(D::splat(s, 0.0)).to_bitmask();
        if backward != 0 && backward != crate::geometry::packet::ALL || farthest > FAR * reach {
            return None;
        }
        let sign = if backward == 0 { 1.0 } else { -1.0 };
        let (depth, speed) = (origin[2] * sign, along * sign);
        let (near, far) = if backward == 0 { (lo[k], hi[k]) } else { (-hi[k], -lo[k]) };
        let start = depth.least().max(near);
        let end = (depth + packet.limits(s) * speed).most().min(far);
        let mut beam = Self {
            axes,
            sign: sign as f32,
            start: start as f32,
            end: end as f32,
            lines: [[0.0; 3]; 4],
            depth,
            speed,
            share: 1.0,
        };
        let mut finite = start.is_finite() && end.is_finite();
        for axis in 0..2 {
            let at = [i, j][axis];
            let slope = by[axis] * sign;
            let first = origin[axis] + slope * (D::splat(s, start) - depth);
            let last = origin[axis] + slope * (D::splat(s, end) - depth);
            let (low, high) = ([first.least(), last.least()], [first.most(), last.most()]);
            beam.lines[2 * axis] = line([start, end], low, reach, f64::min);
            beam.lines[2 * axis + 1] = line([start, end], high, reach, f64::max);
            let wide = 0.5 * ((high[0] - low[0]) + (high[1] - low[1]));
            beam.share *= (wide / (hi[at] - lo[at])).min(1.0);
            finite &= beam.lines[2 * axis..2 * axis + 2].iter().flatten().all(|x| x.is_finite());
        }
        finite.then_some(beam)
    }

    /// About which part of a tree's things lies in it.
    #[inline(always)]
    pub(crate) fn share(&self) -> f64 {
        self.share
    }

    /// The largest depth that counts, rounded up.
    #[inline(always)]
    fn deepest(&self, limits: D<S>) -> f32 {
        ((self.depth + limits * self.speed).most() as f32).next_up()
    }

    /// From which depth on each of the boxes begins, and a bit for each box that is met before the depth `deepest`.
    #[inline(always)]
    fn meets(&self, node: &Node, deepest: f32) -> ([f32; WIDE], u32) {
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
        // One plain loop: compilers make vectors of it.
        let (mut from, mut met) = ([0.0f32; WIDE], [0u32; WIDE]);
        for c in 0..WIDE {
            let (z0, z1) = (near[c] * sign, far[c] * sign);
            from[c] = z0;
            let (a, b) = (within(z0), within(z1));
            // A line that rises is lowest at the near side.
            let deep = (z0 <= deepest) & (z1 >= start);
            let u = (al + pl * a + nl * b <= u1[c]) & (ah + ph * b + nh * a >= u0[c]);
            let v = (bl + ql * a + ml * b <= v1[c]) & (bh + qh * b + mh * a >= v0[c]);
            met[c] = u32::from(deep & u & v) << c;
        }
        (from, met.iter().fold(0, |bits, bit| bits | bit))
    }
}

/// Height at depth 0 and slope of the line through two heights, which `outer` chooses from where they are too close together.
#[inline(always)]
fn line([start, end]: [f64; 2], [a, b]: [f64; 2], reach: f64, outer: fn(f64, f64) -> f64) -> [f32; 3] {
    let long = end - start;
    let slope = if long > THIN * reach { (b - a) / long } else { 0.0 };
    let height = if long > THIN * reach { a - slope * start } else { outer(a, b) };
    [height as f32, slope.max(0.0) as f32, slope.min(0.0) as f32]
}

impl Bvh {
    /// Visits the leaves that the rays of a beam may meet up to its limits, those of near nodes first, until more than `budget`
    /// things were visited. `leaf` is given the things of a leaf; it returns new limits, where there are.
    #[inline(always)]
    pub(crate) fn walk_beam<S: Simd>(
        &self,
        beam: &Beam<S>,
        limits: D<S>,
        mut budget: usize,
        Stack(stack): &mut Stack,
        mut leaf: impl FnMut(Range<usize>) -> Option<D<S>>,
    ) -> Walked {
        if self.nodes.is_empty() || beam.start > beam.end {
            return Walked::All;
        }
        let mut deepest = beam.deepest(limits);
        stack.clear();
        let mut index = self.root as usize;
        loop {
            let node = &self.nodes[index];
            let (near, mut met) = beam.meets(node, deepest);
            let bottom = stack.len();
            while met != 0 {
                let k = met.trailing_zeros() as usize & (WIDE - 1);
                met &= met - 1;
                let (child, count) = (node.child[k], node.count[k]);
                if count == 0 {
                    insert(stack, bottom, Entry { near: near[k], child, count });
                    continue;
                }
                // Things at once: their order among neighbors is worth less than keeping it.
                let (first, count) = (child as usize, count as usize);
                if count > budget {
                    return Walked::Part;
                }
                budget -= count;
                if let Some(limits) = leaf(first..first + count) {
                    deepest = beam.deepest(limits);
                }
            }
            index = loop {
                match stack.pop() {
                    Some(next) if next.near <= deepest => break next.child as usize,
                    Some(_) => {}
                    None => return Walked::All,
                }
            };
        }
    }
}

//! Binary splits of a range of groups by the surface area heuristic: by planes between bins, or by position on the
//! curve.

use super::{BinMapping, Bounds, BuildItem, EMPTY, quad};

/// Bins along the longest side.
const BINS: usize = 16;
/// Up to this many groups are split between neighbors on the curve: clearing and summing bins would take longer than
/// filling them.
const MAX_CURVE_SPLIT: usize = 16;

/// Finds the best split of at least two groups within a box, and sorts the groups by it if it is a plane. Returns the
/// number of groups before it and the boxes of both sides; `None` if there are more than [`MAX_CURVE_SPLIT`] groups and
/// no plane separates them. `aside` is scratch memory.
#[inline(always)]
pub(super) fn best_split(
    within: &Bounds,
    groups: &mut [BuildItem],
    aside: &mut [BuildItem],
) -> Option<(usize, [Bounds; 2])> {
    // Splits keep the order along the curve.
    if groups.len() <= MAX_CURVE_SPLIT {
        Some(best_curve_split(groups))
    } else {
        best_plane_split(within, groups, aside)
    }
}

/// The best position to split up to [`MAX_CURVE_SPLIT`] groups along the curve: the number of groups before it, and the
/// boxes of both sides.
fn best_curve_split(groups: &[BuildItem]) -> (usize, [Bounds; 2]) {
    let n = groups.len().min(MAX_CURVE_SPLIT);
    let mut rest = [EMPTY; MAX_CURVE_SPLIT];
    let mut costs = [0.0f32; MAX_CURVE_SPLIT];
    let (mut sum, mut after) = (EMPTY, 0.0);
    for k in (1..n).rev() {
        sum = sum.union(&groups[k]);
        rest[k] = sum;
        after += groups[k].hi[3];
        costs[k] = after * sum.area();
    }
    let (mut sum, mut before) = (EMPTY, 0.0);
    let (mut best, mut cost) = ((1, groups[0]), f32::INFINITY);
    for k in 1..n {
        sum = sum.union(&groups[k - 1]);
        before += groups[k - 1].hi[3];
        let whole = before * sum.area() + costs[k];
        if whole < cost {
            (best, cost) = ((k, sum), whole);
        }
    }
    let (at, near) = best;
    (at, [near, rest[at % MAX_CURVE_SPLIT]])
}

/// Partitions groups by the best plane between bins along the longest side of their box. Returns the number of groups
/// before the plane and the boxes of both sides; `None` if all centers are in one bin.
fn best_plane_split(
    within: &Bounds,
    groups: &mut [BuildItem],
    aside: &mut [BuildItem],
) -> Option<(usize, [Bounds; 2])> {
    let cells = BinMapping::<BINS>::new(within);
    let [x, y, z, _] = quad(|k| within.hi[k] - within.lo[k]);
    let axis = if x >= y && x >= z { 0 } else { 1 + usize::from(z > y) };
    let cell = |group: &BuildItem| cells.bin(axis, 0.5 * group.lo[axis] + 0.5 * group.hi[axis]) as usize % BINS;
    // The fourth component holds the number of primitives.
    let mut bins = [Bounds { hi: [f32::NEG_INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY, 0.0], ..EMPTY }; BINS];
    for group in &*groups {
        let bin = &mut bins[cell(group)];
        let count = bin.hi[3] + group.hi[3];
        *bin = bin.union(group);
        bin.hi[3] = count;
    }
    let mut costs = [0.0; BINS];
    let mut rest = [EMPTY; BINS];
    let (mut sum, mut after) = (EMPTY, 0.0);
    for k in (1..BINS).rev() {
        sum = sum.union(&bins[k]);
        rest[k] = sum;
        after += bins[k].hi[3];
        costs[k] = after;
    }
    let mut best: Option<(f32, usize, Bounds)> = None;
    let (mut sum, mut before) = (EMPTY, 0.0);
    for k in 0..BINS - 1 {
        sum = sum.union(&bins[k]);
        before += bins[k].hi[3];
        if before == 0.0 || costs[k + 1] == 0.0 {
            continue;
        }
        let cost = before * sum.area() + costs[k + 1] * rest[k + 1].area();
        // A NaN cost comes from sizes beyond the range: any plane is accepted.
        if best.is_none_or(|(least, ..)| cost < least) {
            best = Some((cost, k, sum));
        }
    }
    let (_, last, near_bounds) = best?;
    let (mut near, mut far) = (0, 0);
    let aside = &mut aside[..groups.len()];
    for k in 0..groups.len() {
        let group = groups[k];
        let first = cell(&group) <= last;
        // Written to both places without a branch; one of the two is overwritten.
        (groups[near], aside[far]) = (group, group);
        near += usize::from(first);
        far += usize::from(!first);
    }
    groups[near..].copy_from_slice(&aside[..far]);
    Some((near, [near_bounds, rest[last + 1]]))
}

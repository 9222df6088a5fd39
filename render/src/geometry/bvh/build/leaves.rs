//! Splits a group into leaves at the least cost, by dynamic programming: the cheapest leaves of the first j primitives
//! are the cheapest leaves of fewer primitives, plus one leaf.

use super::{BVH_WIDTH, BuildItem, MAX_GROUP};
use crate::simd::{F4, F8, Simd};

/// Largest number of primitives in a leaf.
const MAX_LEAF: usize = 4;
/// Cost of visiting a leaf, in tests of one primitive.
const LEAF_COST: f32 = 1.0;
/// Cost of a visited leaf with one primitive, two, and so on.
const LEAF_COSTS: [f32; MAX_LEAF] = [1.0 + LEAF_COST, 2.0 + LEAF_COST, 3.0 + LEAF_COST, 4.0 + LEAF_COST];
const _: () = assert!(MAX_GROUP <= MAX_LEAF * BVH_WIDTH, "every group can be cut into leaves");

/// Costs of the leaves of a group. The memory is kept between groups, so that only rows in use are written. Rows beyond
/// the primitives of the group are those of an earlier group.
#[derive(Clone, Debug)]
pub(super) struct Costs {
    /// Cost of a leaf that ends with each primitive, one primitive long, two, and so on.
    costs: [[f32; MAX_LEAF]; MAX_GROUP],
    /// Least cost of the first j primitives as k leaves, in row j + MAX_LEAF - 1. The rows in front stand for negative
    /// j.
    min_costs: [[f32; BVH_WIDTH]; MAX_LEAF + MAX_GROUP],
}

impl Default for Costs {
    fn default() -> Self {
        let mut min_costs = [[f32::INFINITY; BVH_WIDTH]; MAX_LEAF + MAX_GROUP];
        min_costs[MAX_LEAF - 1][0] = 0.0;
        Self { costs: [[0.0; MAX_LEAF]; MAX_GROUP], min_costs }
    }
}

/// Splits consecutive primitives into leaves: the end of each leaf, and the number of leaves.
#[inline(always)]
pub(super) fn leaf_ends<S: Simd>(
    s: S,
    things: &[BuildItem],
    Costs { costs, min_costs }: &mut Costs,
) -> ([u8; BVH_WIDTH], usize) {
    let things = &things[..things.len().min(MAX_GROUP)];
    // The last rows, the newest first: avoids reading memory that has just been written.
    let none = F8::splat(s, f32::INFINITY);
    let mut recent = [none; MAX_LEAF];
    recent[0] = F8::load(s, &min_costs[MAX_LEAF - 1]);
    // Least cost of all primitives as k + 1 leaves.
    let mut best = none;
    // The boxes around the last primitive, the last two, and so on.
    let mut lo = [F4::splat(s, f32::INFINITY); 3];
    let mut hi = [F4::splat(s, f32::NEG_INFINITY); 3];
    let (longest, tests) = (F4::splat(s, f32::MAX), F4::load(s, &LEAF_COSTS));
    for (j, thing) in things.iter().enumerate() {
        for axis in 0..3 {
            lo[axis] = lo[axis].shift_in(f32::INFINITY).min(F4::splat(s, thing.lo[axis]));
            hi[axis] = hi[axis].shift_in(f32::NEG_INFINITY).max(F4::splat(s, thing.hi[axis]));
        }
        // No NaN: no side is infinite, so 0 times infinity does not occur.
        let [x, y, z] = [0, 1, 2].map(
            #[inline(always)]
            |axis| (hi[axis] - lo[axis]).min(longest),
        );
        costs[j] = ((x * y + y * z + z * x) * tests).array();
        // The newest row comes last: the next row depends on it.
        best = none;
        for (row, &cost) in recent.iter().zip(&costs[j]).rev() {
            best = best.min(*row + F8::splat(s, cost));
        }
        recent = [best.shift_in(f32::INFINITY), recent[0], recent[1], recent[2]];
        min_costs[MAX_LEAF + j] = recent[0].array();
    }
    let (mut leaves, mut cost) = (0, f32::INFINITY);
    for (k, other) in best.array().into_iter().enumerate() {
        (leaves, cost) = if other < cost { (k, other) } else { (leaves, cost) };
    }
    // Sizes beyond the range have an infinite cost: full leaves are used.
    if cost == f32::INFINITY {
        let ends = std::array::from_fn(|k| (MAX_LEAF * (k + 1)).min(things.len()) as u8);
        return (ends, things.len().div_ceil(MAX_LEAF));
    }
    let mut ends = [0; BVH_WIDTH];
    let mut j = things.len();
    for k in (0..=leaves).rev() {
        ends[k] = j as u8;
        // Leaf lengths that gave the least cost. All are tested: the first one is unpredictable for a branch.
        let gave = (0..MAX_LEAF).fold(1 << MAX_LEAF, |bits: u32, before| {
            bits | u32::from(min_costs[MAX_LEAF + j - 2 - before][k] + costs[j - 1][before] == cost) << before
        });
        j -= gave.trailing_zeros() as usize + 1;
        cost = min_costs[MAX_LEAF + j - 1][k];
    }
    (ends, leaves + 1)
}

#[cfg(test)]
mod tests {
    use super::super::Bounds;
    use super::*;
    use crate::simd::{SimdLevel, all_levels, at_level};

    /// Cost of leaves, by their areas.
    fn cost(things: &[BuildItem], ends: impl IntoIterator<Item = usize>) -> f32 {
        let mut first = 0;
        let mut sum = 0.0;
        for end in ends {
            let leaf = &things[first..end];
            sum += (leaf.len() as f32 + LEAF_COST) * Bounds::enclosing(leaf).area();
            first = end;
        }
        assert_eq!(first, things.len(), "everything is in a leaf");
        sum
    }

    /// Compares with every possible split.
    #[test]
    fn least_cost() {
        let mut state = 1u32;
        let mut rng = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1u32 << 24) as f32
        };
        // Kept from group to group, as the builder does.
        let mut kept = Costs::default();
        for round in 0..200 {
            let count = 1 + round % 14;
            let things: Vec<BuildItem> = (0..count as u32)
                .map(|k| {
                    let lo = [rng() + 0.3 * k as f32, rng(), rng()];
                    let long = rng() * rng();
                    BuildItem::item(lo, lo.map(|x| x + long), k, 1)
                })
                .collect();
            let (ends, leaves) = at_level!(SimdLevel::best(), s => leaf_ends(s, &things, &mut kept));
            let chosen = ends[..leaves].iter().map(|&end| usize::from(end));
            assert!(
                chosen.clone().scan(0, |last, end| Some(end - std::mem::replace(last, end))).all(|n| n <= MAX_LEAF)
            );
            let mut least = f32::INFINITY;
            for cuts in 0..1u32 << (count - 1) {
                let all = (1..count).filter(|k| cuts >> (k - 1) & 1 == 1).chain([count]);
                let lengths = all.clone().scan(0, |last, end| Some(end - std::mem::replace(last, end)));
                if all.clone().count() <= BVH_WIDTH && lengths.max().is_some_and(|longest| longest <= MAX_LEAF) {
                    least = least.min(cost(&things, all));
                }
            }
            // Both are sums of up to eight numbers, which may be rounded differently.
            let ours = cost(&things, chosen);
            assert!(ours <= least * (1.0 + 16.0 * f32::EPSILON), "{ours}, not {least}, of {count}");
        }
    }

    #[test]
    fn huge_boxes() {
        let huge = [[-3e38f32; 3], [3e38; 3]];
        let things: Vec<BuildItem> = (0..MAX_GROUP as u32).map(|k| BuildItem::item(huge[0], huge[1], k, 1)).collect();
        for level in all_levels() {
            let (ends, leaves) = at_level!(level, s => leaf_ends(s, &things, &mut Costs::default()));
            assert_eq!(ends[..leaves], [4, 8, 12, 16, 20, 24]);
        }
    }
}

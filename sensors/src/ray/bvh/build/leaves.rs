//! The leaves of a group: which way to cut it costs least. By dynamic programming over the cuts: the cheapest leaves of the first
//! j things are the cheapest leaves of fewer, and one leaf more.

use super::{GROUP, Item, WIDE};

/// Things of a leaf, at most.
const LEAF: usize = 4;
/// What a leaf that is met costs, in tests of one thing.
const LEAF_COST: f32 = 1.0;
const _: () = assert!(GROUP <= LEAF * WIDE, "every group can be cut into leaves");

/// Where the leaves of things that lie together on the curve end, and how many leaves there are.
#[inline(always)]
pub(super) fn ends(things: &[Item]) -> ([u8; WIDE], usize) {
    // Loops are as long as the arrays, so that compilers make vectors of them; half of all groups are small.
    match things.len() {
        0..=8 => ends_of::<8, 9>(things),
        9..=16 => ends_of::<16, 17>(things),
        _ => ends_of::<GROUP, { GROUP + 1 }>(things),
    }
}

/// With room for N things; M is one more.
#[inline(always)]
fn ends_of<const N: usize, const M: usize>(things: &[Item]) -> ([u8; WIDE], usize) {
    let count = things.len().min(N);
    let last = costs_of_leaves::<N>(things);
    // Least cost of the first j things as k leaves; and of all of them, as k + 1.
    let mut least = [[f32::INFINITY; WIDE]; M];
    least[0][0] = 0.0;
    let mut best = [f32::INFINITY; WIDE];
    // The last rows, the newest first: not read from memory that has just been written.
    let mut recent = [[f32::INFINITY; WIDE]; LEAF];
    recent[0] = least[0];
    for j in 1..=count {
        best = [f32::INFINITY; WIDE];
        for before in 0..LEAF {
            let cost = last[before][j - 1];
            for k in 0..WIDE {
                let sum = recent[before][k] + cost;
                best[k] = if sum < best[k] { sum } else { best[k] };
            }
        }
        let [a, b, c, d, e, f, g, _] = best;
        recent = [[f32::INFINITY, a, b, c, d, e, f, g], recent[0], recent[1], recent[2]];
        least[j] = recent[0];
    }
    let (mut leaves, mut cost) = (0, best[0]);
    for (k, &other) in best.iter().enumerate() {
        (leaves, cost) = if other < cost { (k, other) } else { (leaves, cost) };
    }
    // Costs that are no numbers come from sizes beyond the range: any leaves will do, but not too long ones.
    if !cost.is_finite() {
        let ends = std::array::from_fn(|k| (LEAF * (k + 1)).min(count) as u8);
        return (ends, count.div_ceil(LEAF));
    }
    let mut ends = [0; WIDE];
    let mut j = count;
    for k in (0..=leaves).rev() {
        ends[k] = j as u8;
        // Those that gave the least.
        let longer = (0..LEAF.min(j)).find(|&before| least[j - 1 - before][k] + last[before][j - 1] == cost);
        j -= longer.unwrap_or(0) + 1;
        cost = least[j][k];
    }
    (ends, leaves + 1)
}

/// What a leaf costs that ends with each of the things and has from one to [`LEAF`] of them; with fewer things before than that,
/// it means nothing.
#[inline(always)]
fn costs_of_leaves<const N: usize>(things: &[Item]) -> [[f32; N]; LEAF] {
    let mut single = [[0.0f32; N]; 6];
    for (j, thing) in things.iter().enumerate().take(N) {
        for axis in 0..3 {
            (single[axis][j], single[axis + 3][j]) = (thing.lo[axis], thing.hi[axis]);
        }
    }
    let mut sides = single;
    let mut costs = [[0.0f32; N]; LEAF];
    for (before, costs) in costs.iter_mut().enumerate() {
        if before > 0 {
            for axis in 0..3 {
                for j in before..N {
                    let (a, b) = (single[axis][j - before], sides[axis][j]);
                    sides[axis][j] = if a < b { a } else { b };
                    let (a, b) = (single[axis + 3][j - before], sides[axis + 3][j]);
                    sides[axis + 3][j] = if a > b { a } else { b };
                }
            }
        }
        let tests = before as f32 + 1.0 + LEAF_COST;
        for (j, cost) in costs.iter_mut().enumerate() {
            let [x, y, z] = [0, 1, 2].map(|k| sides[k + 3][j] - sides[k][j]);
            *cost = (x * y + y * z + z * x) * tests;
        }
    }
    costs
}

#[cfg(test)]
mod tests {
    use super::super::Bounds;
    use super::*;

    /// What leaves cost: the tests of those that are met.
    fn cost(things: &[Item], ends: impl IntoIterator<Item = usize>) -> f32 {
        let mut first = 0;
        let mut sum = 0.0;
        for end in ends {
            let leaf = &things[first..end];
            sum += (leaf.len() as f32 + LEAF_COST) * Bounds::around(leaf).area();
            first = end;
        }
        assert_eq!(first, things.len(), "everything is in a leaf");
        sum
    }

    /// Every way to cut is looked at.
    #[test]
    fn no_other_leaves_cost_less() {
        let mut state = 1u32;
        let mut dice = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1u32 << 24) as f32
        };
        for round in 0..200 {
            let count = 1 + round % 14;
            let things: Vec<Item> = (0..count as u32)
                .map(|k| {
                    let lo = [dice() + 0.3 * k as f32, dice(), dice()];
                    let long = dice() * dice();
                    Item::item(lo, lo.map(|x| x + long), k, 1)
                })
                .collect();
            let (ends, leaves) = ends(&things);
            let chosen = ends[..leaves].iter().map(|&end| usize::from(end));
            assert!(chosen.clone().scan(0, |last, end| Some(end - std::mem::replace(last, end))).all(|n| n <= LEAF));
            let mut least = f32::INFINITY;
            for cuts in 0..1u32 << (count - 1) {
                let all = (1..count).filter(|k| cuts >> (k - 1) & 1 == 1).chain([count]);
                let lengths = all.clone().scan(0, |last, end| Some(end - std::mem::replace(last, end)));
                if all.clone().count() <= WIDE && lengths.max().is_some_and(|longest| longest <= LEAF) {
                    least = least.min(cost(&things, all));
                }
            }
            // Both are sums of up to eight numbers: they may be rounded otherwise.
            let ours = cost(&things, chosen);
            assert!(ours <= least * (1.0 + 16.0 * f32::EPSILON), "{ours}, not {least}, of {count}");
        }
    }

    #[test]
    fn sizes_beyond_the_range_have_short_leaves() {
        let huge = [[-3e38f32; 3], [3e38; 3]];
        let things: Vec<Item> = (0..GROUP as u32).map(|k| Item::item(huge[0], huge[1], k, 1)).collect();
        let (ends, leaves) = ends(&things);
        assert_eq!(ends[..leaves], [4, 8, 12, 16, 20, 24]);
    }
}

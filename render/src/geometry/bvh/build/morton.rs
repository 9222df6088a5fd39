//! Sorting of boxes along a Morton curve, and grouping of adjacent boxes.

use super::{BinMapping, Bounds, BuildItem, EMPTY, MAX_GROUP, TO_BITS};
use crate::simd::{F4, Simd};

/// Bits per coordinate on the curve.
const BITS: u32 = 10;
/// Size of a radix sort digit: one digit per axis.
const DIGITS: usize = 1 << BITS;
/// Fewer keys than this are sorted by comparison: clearing and summing the counters of a radix sort takes longer.
const RADIX_SORT_MIN: usize = 512;
/// Adjacent cells with at most this many boxes together become one group: one node less, and not more to test.
const MAX_JOINED: usize = 12;
/// Lowest bits of the Morton code of a cell. If more boxes than a group holds differ in these bits only, they are
/// sorted along a finer curve.
const CROWDED_BITS: u32 = 3;

/// Bits of a coordinate spread out with two empty bits between them. A table takes a third of the time of shifting.
static MORTON_BITS: [u32; 1 << BITS] = {
    let mut table = [0; 1 << BITS];
    let mut x = 0;
    while x < table.len() {
        let mut bit = 0;
        while bit < BITS {
            table[x] |= (x as u32 >> bit & 1) << (3 * bit);
            bit += 1;
        }
        x += 1;
    }
    table
};

/// Items in the order of the curve: the Morton code in the upper half of each number, the index of the item in the
/// lower.
#[derive(Clone, Debug, Default)]
pub(super) struct MortonOrder {
    keys: Vec<u64>,
    /// Scratch memory for sorting.
    sorted: Vec<u64>,
}

impl MortonOrder {
    /// Sorts items by the Morton codes of their centers within a box around them, and writes the starts of the groups
    /// and the end of the last group. A group is the largest cell of the curve (halves of halves of the box) that holds
    /// no more items than a group may, or a few adjacent small cells.
    #[inline(always)]
    pub(super) fn sort<S: Simd>(
        &mut self,
        s: S,
        items: &[BuildItem],
        bounds: &Bounds,
        starts: &mut Vec<u32>,
    ) -> &[u64] {
        self.compute_keys(s, items, 0..items.len() as u32, bounds);
        starts.clear();
        find_groups(s, items, &mut self.keys, 0, starts);
        starts.push(items.len() as u32);
        &self.keys
    }

    /// Computes sorted keys of some items.
    #[inline(always)]
    fn compute_keys<S: Simd>(
        &mut self,
        s: S,
        items: &[BuildItem],
        numbers: impl ExactSizeIterator<Item = u32>,
        bounds: &Bounds,
    ) {
        let mut cells = BinMapping::<{ 1 << BITS }>::new(bounds);
        // Cells are cubes: the small thickness of a flat object, perhaps rounding noise, is not split as if it were as
        // long as the other sides.
        let least =
            cells.scale.iter().take(3).filter(|&&scale| scale > 0.0).fold(f32::INFINITY, |least, &x| least.min(x));
        cells.scale = [if least.is_finite() { least } else { 0.0 }; 4];
        let [half, down, to_bits] = [0.5, -0.5, TO_BITS].map(|x| F4::splat(s, x));
        let (base, scale) = (F4::load(s, &cells.base), F4::load(s, &cells.scale));
        self.keys.clear();
        self.keys.reserve(numbers.len());
        // No closures of the standard library: their bodies are not compiled for the instruction set.
        for number in numbers {
            let Bounds { lo: [a, b, c, _], hi: [d, e, f, _] } = items[number as usize];
            let middle = half * F4::load(s, &[a, b, c, 0.0]) + half * F4::load(s, &[d, e, f, 0.0]);
            let [x, y, z, _] = ((middle - base) * scale + down + to_bits).array();
            let place = |x: f32| MORTON_BITS[x.to_bits() as usize % DIGITS];
            self.keys.push(u64::from(place(x) | place(y) << 1 | place(z) << 2) << 32 | u64::from(number));
        }
        if self.keys.len() < RADIX_SORT_MIN {
            self.keys.sort_unstable();
            return;
        }
        // Radix sort: a fraction of the time of comparison sort.
        let digit = |key: u64, pass: u32| (key >> (32 + BITS * pass)) as usize % DIGITS;
        let mut places = [[0u32; DIGITS]; 3];
        for &key in &self.keys {
            for (pass, places) in (0..).zip(&mut places) {
                places[digit(key, pass)] += 1;
            }
        }
        self.sorted.resize(self.keys.len(), 0);
        for (pass, places) in (0..).zip(&mut places) {
            let mut sum = 0;
            for place in places.iter_mut() {
                (*place, sum) = (sum, sum + *place);
            }
            for &key in &self.keys {
                let place = &mut places[digit(key, pass)];
                self.sorted[*place as usize] = key;
                *place += 1;
            }
            std::mem::swap(&mut self.keys, &mut self.sorted);
        }
    }
}

/// Appends the start of each group of the sorted `keys`, plus `first`, to `starts`. More than [`MAX_GROUP`] keys that
/// differ in the lowest [`CROWDED_BITS`] bits only are sorted along a finer curve first.
fn find_groups<S: Simd>(s: S, items: &[BuildItem], keys: &mut [u64], first: u32, starts: &mut Vec<u32>) {
    let place = |key: u64| (key >> 32) as u32;
    // The first cell cannot join a group before it.
    let (mut at, mut last) = (0, MAX_GROUP);
    while at < keys.len() {
        let here = place(keys[at]);
        let differs = |key: Option<&u64>| key.map_or(u32::MAX, |&key| place(key) ^ here);
        // The cell must not contain the item before the group or the first one after a full group.
        let (before, after) = (differs(keys[..at].last()), differs(keys.get(at + MAX_GROUP)));
        if after >> CROWDED_BITS == 0 {
            let count = keys[at..].partition_point(|&key| place(key) >> CROWDED_BITS == here >> CROWDED_BITS);
            group_crowded(s, items, &mut keys[at..at + count], first + at as u32, starts);
            (at, last) = (at + count, MAX_GROUP);
            continue;
        }
        let bits = before.checked_ilog2().unwrap_or(0).min(after.ilog2());
        // All candidates are counted: the end of the cell is unpredictable for a branch.
        let few = &keys[at..keys.len().min(at + MAX_GROUP)];
        let count = few.iter().filter(|&&key| place(key) >> bits == here >> bits).count();
        if last + count <= MAX_JOINED {
            last += count;
        } else {
            starts.push(first + at as u32);
            last = count;
        }
        at += count;
    }
}

/// Groups keys that differ in the lowest [`CROWDED_BITS`] bits only: they are sorted along a curve of their own, or cut
/// every [`MAX_GROUP`] keys if that curve does not separate them. Happens for dense details with an outlier far away.
#[cold]
fn group_crowded<S: Simd>(s: S, items: &[BuildItem], keys: &mut [u64], first: u32, starts: &mut Vec<u32>) {
    let numbers = || keys.iter().map(|&key| key as u32);
    let within = numbers().fold(EMPTY, |sum, number| {
        let middle = items[number as usize].center();
        sum.union(&Bounds { lo: middle, hi: middle })
    });
    let mut finer = MortonOrder::default();
    s.vectorize(
        #[inline(always)]
        || finer.compute_keys(s, items, numbers(), &within),
    );
    let finer = finer.keys;
    if finer[0] >> 32 != finer[finer.len() - 1] >> 32 {
        keys.copy_from_slice(&finer);
        find_groups(s, items, keys, first, starts);
    } else {
        // All centers coincide.
        starts.extend((0..keys.len() as u32).step_by(MAX_GROUP).map(|k| first + k));
    }
}

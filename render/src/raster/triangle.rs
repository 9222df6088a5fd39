//! Rasterization of one triangle into the visibility buffer.
//!
//! Coverage: vertices are snapped to 1/256 pixel, edge functions are exact integers, and the top-left rule decides on
//! edges. Two triangles that share an edge never both draw a sample and never both leave it out.
//!
//! Overflow: snapped coordinates are below 2^22 ([`GUARD_BAND`] pixels of 2^8), so differences are below 2^23 and edge
//! functions below 2^47: set up in `i64`. Samples are a whole pixel apart, so the value shifted down by 8 has the same
//! sign and steps by the edge's differences: within a block it changes by less than 14 * 2^23 < 2^27. The value at a
//! block's corner is clamped to ±2^30, which keeps every sign in the block, and the rest is done in `i32`.

use super::tile::{BLOCK, MAX_SAMPLE_OFFSET, Tile};
use crate::simd::{COLUMN, F, I, ROW, Simd, load, load_i, load_u, max, min, select, select_i, select_u};
use crate::simd::{splat, splat_i, splat_u, store, store_u};

/// Vertices farther than this from the first pixel are clipped \[pixels\].
pub(crate) const GUARD_BAND: f32 = 16000.0;
/// Sub-pixel positions per pixel.
pub(crate) const SUBPIXELS: f32 = 256.0;

/// Largest number of pixels that are tested one after the other: sixteen at a time take longer, because they need more
/// preparation.
const FEW_PIXELS: i32 = 9;

/// Nearness of a plane over the image, and its range on the triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gradient {
    /// A point of the image \[pixels\] and its nearness.
    pub(crate) at: [f32; 3],
    /// Change per pixel.
    pub(crate) step: [f32; 2],
    pub(crate) low: f32,
    pub(crate) high: f32,
}

/// Rasterizes a triangle given by its snapped corners `p`, in the order in which (p1 - p0) x (p2 - p0) is positive. The
/// gradient costs several divisions: for a small triangle, it is computed for the first covered sample. Samples nearer
/// than `nearest` are not drawn.
#[inline(always)]
pub(crate) fn draw<S: Simd>(
    s: S,
    tile: &mut Tile,
    p: [[i32; 2]; 3],
    gradient: impl Fn() -> Gradient,
    nearest: f32,
    id: u32,
) {
    let low = [0, 1].map(|k| p[0][k].min(p[1][k]).min(p[2][k]));
    let high = [0, 1].map(|k| p[0][k].max(p[1][k]).max(p[2][k]));
    let reach = if tile.planes > 1 { MAX_SAMPLE_OFFSET } else { 0 };
    let (tx, ty) = (tile.x0 as i32, tile.y0 as i32);
    let x0 = ((low[0] - reach + 127) >> 8).max(tx);
    let x1 = ((high[0] + reach - 128) >> 8).min(tx + (tile.blocks_x * BLOCK) as i32 - 1);
    let y0 = ((low[1] - reach + 127) >> 8).max(ty);
    let y1 = ((high[1] + reach - 128) >> 8).min(ty + (tile.blocks_y * BLOCK) as i32 - 1);
    if x0 > x1 || y0 > y1 {
        return;
    }
    let (mut a, mut b, mut c) = ([0i32; 3], [0i32; 3], [0i64; 3]);
    for k in 0..3 {
        let (from, to) = (p[k], p[(k + 1) % 3]);
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let owns_edge = dy < 0 || (dy == 0 && dx > 0);
        (a[k], b[k]) = (-dy, dx);
        c[k] =
            i64::from(dx) * i64::from(128 - from[1]) - i64::from(dy) * i64::from(128 - from[0]) - i64::from(!owns_edge);
    }
    if (x1 - x0 + 1) * (y1 - y0 + 1) <= FEW_PIXELS {
        return few_pixels(tile, [x0, y0, x1, y1], [low, high], [a, b], c, gradient, nearest, id);
    }
    let g = &gradient();
    let offsets = tile.offsets;
    let one_block = x0 >> 3 == x1 >> 3 && y0 >> 3 == y1 >> 3;
    let column = COLUMN.map(|x| x as i32);
    let column: I<S> = load_i(s, &column);
    let in_second_row = load(s, &ROW).simd_gt(splat(s, 0.5));
    let zero = splat_i(s, 0);
    let edge = {
        #[inline(always)]
        |k: usize| column * a[k] + select_i(in_second_row, splat_i(s, b[k]), zero)
    };
    let edges = [edge(0), edge(1), edge(2)];
    let steps: F<S> = load(s, &COLUMN) * g.step[0] + load(s, &ROW) * g.step[1];
    let (low, high) = (splat(s, g.low), splat(s, g.high));
    let (nearest, ids) = (splat(s, nearest), splat_u(s, id));
    for by in y0 >> 3..=y1 >> 3 {
        for bx in x0 >> 3..=x1 >> 3 {
            let (x, y) = (bx * 8, by * 8);
            let block = tile.block(bx as usize, by as usize);
            let first_row = ((y0.max(y) - y) >> 1) as usize;
            let last_row = ((y1.min(y + 7) - y) >> 1) as usize;
            let corner = g.at[2] + g.step[0] * (x as f32 + 0.5 - g.at[0]) + g.step[1] * (y as f32 + 0.5 - g.at[1]);
            let mut drawn = false;
            for (plane, offset) in offsets.iter().enumerate().take(tile.planes) {
                let mut e = [0i32; 3];
                let mut outside = false;
                for k in 0..3 {
                    let at = c[k] + i64::from(a[k]) * i64::from(offset[0]) + i64::from(b[k]) * i64::from(offset[1]);
                    let at = (at >> 8) + i64::from(a[k]) * i64::from(x) + i64::from(b[k]) * i64::from(y);
                    e[k] = at.clamp(-(1 << 30), 1 << 30) as i32;
                    outside |= e[k] + 7 * a[k].max(0) + 7 * b[k].max(0) < 0;
                }
                if outside && !one_block {
                    continue;
                }
                // Most blocks in the bounds of a long slanted triangle are outside, and stay empty.
                tile.prepare_block(block);
                let q0 = corner
                    + (g.step[0] * (offset[0] as f32 * (1.0 / SUBPIXELS))
                        + g.step[1] * (offset[1] as f32 * (1.0 / SUBPIXELS)));
                let samples = tile.samples(block, plane);
                for row in first_row..=last_row {
                    let at = {
                        #[inline(always)]
                        |k: usize| edges[k] + (e[k] + 2 * row as i32 * b[k])
                    };
                    let inside = (at(0) | at(1) | at(2)).simd_ge(zero);
                    let q = steps + (q0 + g.step[1] * (2 * row) as f32);
                    let q = min(max(q, low), high);
                    let here = samples + row * 16;
                    let old = load(s, &tile.nearness[here..]);
                    let m = inside & q.simd_ge(old) & q.simd_le(nearest);
                    if m.any_true() {
                        // Of surfaces at the same depth the last one counts. An empty sample has the largest id.
                        let old_ids = load_u(s, &tile.id[here..]);
                        let m = m & (q.simd_gt(old) | old_ids.simd_lt(ids));
                        store(select(m, q, old), &mut tile.nearness[here..]);
                        store_u(select_u(m, ids, old_ids), &mut tile.id[here..]);
                        drawn = true;
                    }
                }
            }
            if drawn {
                tile.mark_dirty(block);
            }
        }
    }
}

/// At most [`FEW_PIXELS`] pixels, one after the other; the same values as in [`draw`].
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "inlined into its only caller")]
fn few_pixels(
    tile: &mut Tile,
    [x0, y0, x1, y1]: [i32; 4],
    [low, high]: [[i32; 2]; 2],
    [a, b]: [[i32; 3]; 2],
    c: [i64; 3],
    gradient: impl Fn() -> Gradient,
    nearest: f32,
    id: u32,
) {
    let offsets = tile.offsets;
    let mut found = None;
    for (plane, offset) in offsets.iter().enumerate().take(tile.planes) {
        // Pixels whose samples are in the bounds of the triangle: mostly none.
        let (x0, x1) = (x0.max((low[0] - offset[0] + 127) >> 8), x1.min((high[0] - offset[0] - 128) >> 8));
        let (y0, y1) = (y0.max((low[1] - offset[1] + 127) >> 8), y1.min((high[1] - offset[1] - 128) >> 8));
        if x0 > x1 || y0 > y1 {
            continue;
        }
        let start: [i64; 3] = std::array::from_fn(|k| {
            (c[k] + i64::from(a[k]) * i64::from(offset[0]) + i64::from(b[k]) * i64::from(offset[1])) >> 8
        });
        for y in y0..=y1 {
            for x in x0..=x1 {
                let at = |k: usize| start[k] + i64::from(a[k]) * i64::from(x) + i64::from(b[k]) * i64::from(y);
                if (at(0) | at(1) | at(2)) < 0 {
                    continue;
                }
                let g: &Gradient = found.get_or_insert_with(&gradient);
                // The additions have the order of the wide path: corner of the block, sample, row pair, lane.
                let shift = g.step[0] * (offset[0] as f32 * (1.0 / SUBPIXELS))
                    + g.step[1] * (offset[1] as f32 * (1.0 / SUBPIXELS));
                let (bx, by) = (x & !7, y & !7);
                let corner =
                    g.at[2] + g.step[0] * (bx as f32 + 0.5 - g.at[0]) + g.step[1] * (by as f32 + 0.5 - g.at[1]);
                let (column, row) = (x - bx, y - by);
                let lane = column as f32 * g.step[0] + (row & 1) as f32 * g.step[1];
                let q = lane + ((corner + shift) + g.step[1] * (row & !1) as f32);
                let q = if q > g.low { q } else { g.low };
                let q = if q < g.high { q } else { g.high };
                let block = tile.block(bx as usize / BLOCK, by as usize / BLOCK);
                let here = tile.samples(block, plane) + (row * 8 + column) as usize;
                tile.prepare_block(block);
                let old = tile.nearness[here];
                if (q > old || q == old && id > tile.id[here]) && q <= nearest {
                    tile.nearness[here] = q;
                    tile.id[here] = id;
                    tile.mark_dirty(block);
                }
            }
        }
    }
}

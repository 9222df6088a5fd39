//! The triangles of a cluster that may cover samples, sixteen at a time: most triangles of dense meshes face away or lie
//! between the samples.

use super::cluster::Vertices;
use super::tile::Tile;
use super::triangle::SUBPIXELS;
use crate::simd::{F, I, LANES, Simd, load, max, min, splat};

/// Longest side of the bounds of the triangles that are tested, in 1/256 pixel: twice their area has at most 24 bits, so
/// that it is exact in single precision. Larger triangles may cover samples.
const LONGEST: f32 = 2048.0;
/// Added to coordinates \[pixels\], which are above -16001, so that truncation rounds down. The sum has at most 15 bits
/// before the point and 8 behind it: it is exact.
const BIAS: f32 = 16384.0;

/// Returns the triangles that may cover a sample of the tile: bit k is set for triangle k of `corners`, of which there are
/// at most sixteen. No vertex must be clipped. Front faces only if `cull` is true.
#[inline(always)]
pub(super) fn candidates<S: Simd>(s: S, tile: &Tile, v: &Vertices, corners: &[[u8; 3]], cull: bool) -> u64 {
    let mut at = [[[0.0f32; LANES]; 2]; 3];
    for (lane, triangle) in corners.iter().enumerate().take(LANES) {
        for (at, &vertex) in at.iter_mut().zip(triangle) {
            at[0][lane] = v.grid[0][usize::from(vertex)];
            at[1][lane] = v.grid[1][usize::from(vertex)];
        }
    }
    let [[ax, ay], [bx, by], [cx, cy]] = [
        [load(s, &at[0][0]), load(s, &at[0][1])],
        [load(s, &at[1][0]), load(s, &at[1][1])],
        [load(s, &at[2][0]), load(s, &at[2][1])],
    ];
    let (low_x, high_x) = (min(min(ax, bx), cx), max(max(ax, bx), cx));
    let (low_y, high_y) = (min(min(ay, by), cy), max(max(ay, by), cy));
    let longest = splat(s, LONGEST);
    let is_large = !((high_x - low_x).simd_le(longest) & (high_y - low_y).simd_le(longest));
    let zero = splat(s, 0.0);
    // The image's y axis points down, so front faces are clockwise: negative area.
    let area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
    let is_seen = if cull { area.simd_lt(zero) } else { area.simd_lt(zero) | area.simd_gt(zero) };
    let pixel = 1.0 / SUBPIXELS;
    let (low_x, high_x, low_y, high_y) = (low_x * pixel, high_x * pixel, low_y * pixel, high_y * pixel);
    // Samples are at x + 0.5 + offset: those in the bounds are from low - 0.5 - offset, rounded up, to high - 0.5 - offset,
    // rounded down.
    let rounded = {
        #[inline(always)]
        |x: F<S>, add: f32, offset: i32| -> I<S> { (x + (add + BIAS - 0.5 - offset as f32 * pixel)).to_int() }
    };
    let up = (SUBPIXELS - 1.0) / SUBPIXELS;
    let mut covers = is_large;
    for &[x, y] in tile.offsets.iter().take(tile.planes) {
        covers |= rounded(high_x, 0.0, x).simd_ge(rounded(low_x, up, x))
            & rounded(high_y, 0.0, y).simd_ge(rounded(low_y, up, y));
    }
    (covers & (is_seen | is_large)).to_bitmask() & ((1 << corners.len().min(LANES)) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::tile::SAMPLES;
    use crate::simd::{all_levels, at_level};

    /// True if a sample of a plane lies in the bounds of a triangle, by looking at every sample nearby.
    fn has_sample(p: [[i32; 2]; 3], offset: [i32; 2]) -> bool {
        (0..2).all(|axis| {
            let (low, high) = p.iter().fold((i32::MAX, i32::MIN), |(l, h), p| (l.min(p[axis]), h.max(p[axis])));
            (low.div_euclid(256) - 2..=high.div_euclid(256) + 2)
                .any(|pixel| (low..=high).contains(&(256 * pixel + 128 + offset[axis])))
        })
    }

    /// Triangles of all sizes, anywhere inside of the guard band: found are those that have a sample in their bounds and face
    /// the camera, and all large ones. Some have no area.
    #[test]
    fn triangles_with_samples() {
        let mut rng = crate::geometry::TestRng(41);
        let (mut tile, mut vertices) = (Tile::default(), Vertices::default());
        tile.offsets = SAMPLES;
        let (mut found, mut left_out, mut large) = (0, 0, 0);
        for round in 0..600 {
            let size = [40.0, 120.0, 300.0, 1500.0, 9000.0][round % 5];
            let count = if round % 7 == 0 { 11 } else { LANES };
            tile.planes = if round % 2 == 0 { 1 } else { SAMPLES.len() };
            let triangles: [[[i32; 2]; 3]; LANES] = std::array::from_fn(|k| {
                let middle = rng.point(4_000_000.0);
                let mut corner = || {
                    let off = rng.point(size);
                    [0, 1].map(|axis| (middle[axis] + off[axis]).clamp(-4_096_000.0, 4_096_000.0) as i32)
                };
                let (a, b) = (corner(), corner());
                [a, b, if k == 3 { b } else { corner() }]
            });
            let corners: [[u8; 3]; LANES] = std::array::from_fn(|k| [0, 1, 2].map(|corner| (3 * k + corner) as u8));
            for (triangle, corners) in triangles.iter().zip(corners) {
                for (p, vertex) in triangle.iter().zip(corners) {
                    (0..2).for_each(|axis| vertices.grid[axis][usize::from(vertex)] = p[axis] as f32);
                }
            }
            for cull in [false, true] {
                let expected = |k: usize| {
                    let [a, b, c] = triangles[k].map(|p| p.map(i64::from));
                    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
                    let long = |axis: usize| {
                        let at = triangles[k].map(|p| p[axis]);
                        at.iter().max().zip(at.iter().min()).is_some_and(|(high, low)| high - low > 2048)
                    };
                    let faces = if cull { area < 0 } else { area != 0 };
                    (
                        long(0) || long(1),
                        faces && tile.offsets[..tile.planes].iter().any(|&o| has_sample(triangles[k], o)),
                    )
                };
                for level in all_levels() {
                    let bits = at_level!(level, s => candidates(s, &tile, &vertices, &corners[..count], cull));
                    for (k, triangle) in triangles.iter().enumerate() {
                        let (is_large, is_candidate) = expected(k);
                        let wanted = k < count && (is_large || is_candidate);
                        assert_eq!(bits >> k & 1 == 1, wanted, "{triangle:?}, {cull}, {level:?}");
                        large += usize::from(is_large);
                        *if wanted { &mut found } else { &mut left_out } += 1;
                    }
                }
            }
        }
        assert!(found > 1000 && left_out > 1000 && large > 1000, "{found} {left_out} {large}");
    }
}

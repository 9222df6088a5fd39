//! Colours of textures: bilinear within a level, and between two levels.
//!
//! Texels are blended as they are (sRGB bytes), which is four times as fast as in linear light; the levels themselves were
//! averaged in linear light.

use crate::lanes::{F, LANES, M, Simd, abs, load_i, max, min, select, splat};
use scene::material::Level;
use scene::{Texture, TextureKind};

/// The largest integer that is not larger. `floor()` would be a library call.
#[inline(always)]
fn floor(x: f32) -> i32 {
    let t = x as i32;
    t - i32::from((t as f32) > x)
}

/// Adding and subtracting this rounds to an integer (of less than 2^22).
const ROUND: f32 = 12_582_912.0;

/// The largest integer that is not larger.
#[inline(always)]
fn floor_lanes<S: Simd>(s: S, x: F<S>) -> F<S> {
    let r = (x + ROUND) - ROUND;
    r - select(r.simd_gt(x), splat(s, 1.0), splat(s, 0.0))
}

/// Colours (bytes, 0..=255) at (u, v), v upward, of surfaces where one pixel is `footprint` wide in texture coordinates.
///
/// Neighbouring pixels use the same two or three levels, so the loop is over levels, whose sizes all lanes share.
#[inline(always)]
pub(crate) fn sample<S: Simd>(s: S, texture: &Texture, u: F<S>, v: F<S>, footprint: F<S>, lanes: M<S>) -> [F<S>; 3] {
    let levels = texture.levels();
    let (zero, one, limit) = (splat(s, 0.0), splat(s, 1.0), splat(s, 1e6));
    let lanes = lanes & abs(u).simd_lt(limit) & abs(v).simd_lt(limit);
    let (u, v) = (select(lanes, u, zero), select(lanes, v, zero));
    let (u, v) = (u - floor_lanes(s, u), one - (v - floor_lanes(s, v)));
    let texels = footprint * levels[0].width().max(levels[0].height()) as f32;
    let mut out = [zero, zero, zero];
    // Level k is for pixels 2^k to 2^(k+1) texels wide. Up to 1.5 times 2^k it is enough alone: the four texels of a point
    // cover that; beyond it is blended with the next.
    let (mut from_last, mut left, mut width) = (zero, lanes, 1.0f32);
    let mut carried = false;
    for (k, level) in levels.iter().enumerate() {
        let last = k + 1 == levels.len();
        if !last && !carried && !(left & texels.simd_lt(splat(s, 2.0 * width))).any_true() {
            width *= 2.0;
            continue;
        }
        let here = if last { left } else { left & texels.simd_lt(splat(s, 2.0 * width)) };
        let to_next = if last { zero } else { min(max(texels * (2.0 / width) - 3.0, zero), one) };
        let to_next = select(here, to_next, zero);
        let weight = select(here, one - to_next, zero) + from_last;
        let wanted = weight.simd_gt(zero);
        if wanted.any_true() {
            let color = bilinear_lanes(s, level, u, v, wanted);
            out = [out[0] + color[0] * weight, out[1] + color[1] * weight, out[2] + color[2] * weight];
        }
        left &= !here;
        from_last = to_next;
        carried = from_last.simd_gt(zero).any_true();
        if !carried && !left.any_true() {
            break;
        }
        width *= 2.0;
    }
    out
}

/// The colours between four texels each. Coordinates are in 0..=1, rows from the top; the image repeats.
#[inline(always)]
fn bilinear_lanes<S: Simd>(s: S, level: &Level, u: F<S>, v: F<S>, lanes: M<S>) -> [F<S>; 3] {
    let (w, h) = (level.width() as f32, level.height() as f32);
    let (x, y) = (u * w - 0.5, v * h - 0.5);
    let (ix, iy) = (floor_lanes(s, x), floor_lanes(s, y));
    let (fx, fy) = (x - ix, y - iy);
    let stride = level.width() as i32 + 1;
    let at = wrap(s, iy, h).to_int() * stride + wrap(s, ix, w).to_int();
    let at: [i32; LANES] = at.array();
    // Bytes of two pixels, above and below.
    let (mut above, mut below) = ([[0i32; LANES]; 2], [[0i32; LANES]; 2]);
    let (bytes, bits, next_row) = (level.bytes(), lanes.to_bitmask(), 4 * stride as usize);
    let pair = |from: usize| match bytes.get(from..from + 8) {
        Some(&[a, b, c, d, e, f, g, h]) => u64::from_le_bytes([a, b, c, d, e, f, g, h]),
        _ => 0,
    };
    let mut put = |lane: usize| {
        let first = 4 * at[lane] as usize;
        let (upper, lower) = (pair(first), pair(first + next_row));
        (above[0][lane], above[1][lane]) = (upper as i32, (upper >> 32) as i32);
        (below[0][lane], below[1][lane]) = (lower as i32, (lower >> 32) as i32);
    };
    if bits == 0xffff {
        for lane in 0..LANES {
            put(lane);
        }
    } else {
        for lane in (0..LANES).filter(|lane| bits >> lane & 1 == 1) {
            put(lane);
        }
    }
    let (a, b) = (load_i(s, &above[0]).bytes(), load_i(s, &above[1]).bytes());
    let (c, d) = (load_i(s, &below[0]).bytes(), load_i(s, &below[1]).bytes());
    let mut out = a;
    for k in 0..3 {
        let (top, bottom) = (a[k] + (b[k] - a[k]) * fx, c[k] + (d[k] - c[k]) * fx);
        out[k] = top + (bottom - top) * fy;
    }
    out
}

/// Into 0..n, from -1..=n.
#[inline(always)]
fn wrap<S: Simd>(s: S, i: F<S>, n: f32) -> F<S> {
    let i = select(i.simd_lt(splat(s, 0.0)), i + n, i);
    let i = select(i.simd_ge(splat(s, n)), i - n, i);
    min(max(i, splat(s, 0.0)), splat(s, n - 1.0))
}

/// Colour (bytes, 0..=255) in a direction of a cube texture, where one pixel is `footprint` wide on a cube of half length 1.
#[inline(never)]
pub(crate) fn sample_cube(texture: &Texture, d: [f32; 3], footprint: f32) -> [f32; 4] {
    let a = d.map(f32::abs);
    let (face, major, u, v) = if a[0] >= a[1] && a[0] >= a[2] {
        if d[0] > 0.0 { (0, a[0], -d[2], -d[1]) } else { (1, a[0], d[2], -d[1]) }
    } else if a[1] >= a[2] {
        if d[1] > 0.0 { (2, a[1], d[0], d[2]) } else { (3, a[1], d[0], -d[2]) }
    } else if d[2] > 0.0 {
        (4, a[2], d[0], -d[1])
    } else {
        (5, a[2], -d[0], -d[1])
    };
    let k = 0.5 / if major > 0.0 { major } else { 1.0 };
    mix(texture, footprint * 0.5 * texture.levels()[0].width() as f32, |level| {
        let side = level.width() as i32;
        let at = |x: f32| (x * k + 0.5) * side as f32 - 0.5;
        bilinear(level, [at(u), at(v)], [face * side, (face + 1) * side])
    })
}

/// Between the two levels where a pixel is about one texel wide.
#[inline(always)]
fn mix(texture: &Texture, texels: f32, at: impl Fn(&Level) -> [f32; 4]) -> [f32; 4] {
    let levels = texture.levels();
    // Octaves without a logarithm: double a width until it covers the pixel.
    let (mut k, mut width) = (0, 1.0f32);
    while k + 1 < levels.len() && 2.0 * width <= texels {
        width *= 2.0;
        k += 1;
    }
    let mut color = at(&levels[k]);
    let weight = (texels / width - 1.0).clamp(0.0, 1.0);
    if weight > 0.0 && k + 1 < levels.len() {
        let far = at(&levels[k + 1]);
        for (near, far) in color.iter_mut().zip(far) {
            *near += (far - *near) * weight;
        }
    }
    color
}

/// The colour between four texels, in the rows `rows[0]..rows[1]`. The point is at most half a texel outside.
#[inline(always)]
fn bilinear(level: &Level, [x, y]: [f32; 2], rows: [i32; 2]) -> [f32; 4] {
    let (ix, iy) = (floor(x), floor(y));
    let (fx, fy) = (x - ix as f32, y - iy as f32);
    let wrap = |i: i32, n: i32| i.clamp(0, n - 1) as usize;
    let (width, height) = (level.width() as i32, rows[1] - rows[0]);
    let (x0, x1) = (wrap(ix, width) as u32, wrap(ix + 1, width) as u32);
    let row = |i: i32| (wrap(i, height) + rows[0] as usize) as u32;
    let (y0, y1) = (row(iy), row(iy + 1));
    let [a, b, c, d] = [level.pixel(x0, y0), level.pixel(x1, y0), level.pixel(x0, y1), level.pixel(x1, y1)];
    let mut out = [0.0; 4];
    for k in 0..4 {
        let (a, c) = (f32::from(a[k]), f32::from(c[k]));
        let (top, bottom) = (a + (f32::from(b[k]) - a) * fx, c + (f32::from(d[k]) - c) * fx);
        out[k] = top + (bottom - top) * fy;
    }
    out
}

/// The kind of a texture decides how it lies.
pub(crate) fn is_cube(texture: &Texture) -> bool {
    texture.kind() == TextureKind::Cube
}

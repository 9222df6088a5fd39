//! Colours of textures: bilinear within a level, and between two levels.

use scene::material::Level;
use scene::{Texture, TextureKind};

/// The largest integer that is not larger. `floor()` would be a library call.
#[inline(always)]
fn floor(x: f32) -> i32 {
    let t = x as i32;
    t - i32::from((t as f32) > x)
}

/// Linear colour at (u, v), v upward, of a surface where one pixel is `footprint` wide in texture coordinates. `table` is
/// linear light by byte.
#[inline(always)]
pub(crate) fn sample(texture: &Texture, table: &[f32; 256], u: f32, v: f32, footprint: f32) -> [f32; 3] {
    if !(u.abs() < 1e6 && v.abs() < 1e6) {
        return [0.5; 3];
    }
    let first = &texture.levels()[0];
    let (u, v) = (u - floor(u) as f32, 1.0 - (v - floor(v) as f32));
    mix(texture, footprint * first.width.max(first.height) as f32, |level| {
        let (w, h) = (level.width as f32, level.height as f32);
        bilinear(level, table, [u * w - 0.5, v * h - 0.5], [0, level.height as i32], true)
    })
}

/// Linear colour in a direction of a cube texture, where one pixel is `footprint` wide on a cube of half length 1.
#[inline(never)]
pub(crate) fn sample_cube(texture: &Texture, table: &[f32; 256], d: [f32; 3], footprint: f32) -> [f32; 3] {
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
    mix(texture, footprint * 0.5 * texture.levels()[0].width as f32, |level| {
        let side = level.width as i32;
        let at = |x: f32| (x * k + 0.5) * side as f32 - 0.5;
        bilinear(level, table, [at(u), at(v)], [face * side, (face + 1) * side], false)
    })
}

/// Between the two levels where a pixel is about one texel wide.
#[inline(always)]
fn mix(texture: &Texture, texels: f32, at: impl Fn(&Level) -> [f32; 3]) -> [f32; 3] {
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
fn bilinear(level: &Level, table: &[f32; 256], [x, y]: [f32; 2], rows: [i32; 2], repeat: bool) -> [f32; 3] {
    let (ix, iy) = (floor(x), floor(y));
    let (fx, fy) = (x - ix as f32, y - iy as f32);
    // Integer division would cost more than all the rest.
    let wrap = |i: i32, n: i32| {
        let (below, above) = if repeat { (i + n, i - n) } else { (0, n - 1) };
        let i = if i < 0 { below } else { i };
        let i = if i >= n { above } else { i };
        i.clamp(0, n - 1) as usize
    };
    let (width, height) = (level.width as i32, rows[1] - rows[0]);
    let (x0, x1) = (wrap(ix, width), wrap(ix + 1, width));
    let row = |i: i32| (wrap(i, height) + rows[0] as usize) * level.width as usize;
    let (y0, y1) = (row(iy), row(iy + 1));
    let [a, b, c, d] = [level.pixels[y0 + x0], level.pixels[y0 + x1], level.pixels[y1 + x0], level.pixels[y1 + x1]];
    let mut out = [0.0; 3];
    for k in 0..3 {
        let at = |p: [u8; 4]| table[usize::from(p[k])];
        let (a, c) = (at(a), at(c));
        let (top, bottom) = (a + (at(b) - a) * fx, c + (at(d) - c) * fx);
        out[k] = top + (bottom - top) * fy;
    }
    out
}

/// The kind of a texture decides how it lies.
pub(crate) fn is_cube(texture: &Texture) -> bool {
    texture.kind() == TextureKind::Cube
}

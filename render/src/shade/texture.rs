//! Texture sampling: bilinear within a mip level, and interpolated between two levels.
//!
//! There are two rules for the choice of levels. [`MipRule::Sharp`] uses one level for most pixels. [`MipRule::OpenGl`]
//! always blends two levels, by the logarithm of the pixel's width in texels.
//!
//! Texels are blended as sRGB bytes, which is four times as fast as in linear light; the levels themselves were
//! averaged in linear light.

use crate::simd::{F, LANES, M, Simd, V3, abs, halves, max, min, select, select_i, splat, splat_i};
use kinetoscope_scene::shape::Box;
use kinetoscope_scene::{LightingSpace, MipLevel, RenderScene, Texture, TextureKind};

/// Adding and subtracting this rounds to an integer (below 2^22).
const ROUND: f32 = 12_582_912.0;

/// Rule by which the mip levels of a pixel are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum MipRule {
    /// The sharper level alone for most pixels.
    #[default]
    Sharp,
    /// Two levels, as OpenGL's `GL_LINEAR_MIPMAP_LINEAR`.
    OpenGl,
    /// The same, and the width of a pixel on a cube texture is that on its face.
    OpenGlFaces,
}

impl MipRule {
    /// Rule of a scene: MuJoCo's renderer has OpenGL's rule.
    pub(crate) fn of(scene: &RenderScene) -> Self {
        match scene.lighting_space {
            LightingSpace::Linear => Self::Sharp,
            LightingSpace::Display if scene.opengl.is_none() => Self::OpenGl,
            LightingSpace::Display => Self::OpenGlFaces,
        }
    }
}

/// Rounds down to an integer.
#[inline(always)]
pub(crate) fn floor_lanes<S: Simd>(s: S, x: F<S>) -> F<S> {
    let r = (x + ROUND) - ROUND;
    r - select(r.simd_gt(x), splat(s, 1.0), splat(s, 0.0))
}

/// Colors (bytes, 0..=255) at (u, v), v upward, where one pixel is `footprint` wide in texture coordinates.
///
/// Compiled once for each instruction set, not in each of its callers.
#[inline(never)]
pub(crate) fn sample<S: Simd>(
    s: S,
    texture: &Texture,
    rule: MipRule,
    [u, v]: [F<S>; 2],
    footprint: F<S>,
    lanes: M<S>,
) -> [F<S>; 3] {
    s.vectorize(
        #[inline(always)]
        || {
            let first = &texture.mip_levels()[0];
            let (zero, one, limit) = (splat(s, 0.0), splat(s, 1.0), splat(s, 1e6));
            let lanes = lanes & abs(u).simd_lt(limit) & abs(v).simd_lt(limit);
            let (u, v) = (select(lanes, u, zero), select(lanes, v, zero));
            let (u, v) = (u - floor_lanes(s, u), one - (v - floor_lanes(s, v)));
            let texels = footprint * first.width().max(first.height()) as f32;
            sample_levels(
                s,
                texture,
                rule,
                texels,
                lanes,
                #[inline(always)]
                |level, wanted| {
                    let (w, h) = (level.width() as f32, level.height() as f32);
                    let (x, y) = (u * w - 0.5, v * h - 0.5);
                    let (ix, iy) = (floor_lanes(s, x), floor_lanes(s, y));
                    bilinear(s, level, [wrap(s, ix, w), wrap(s, iy, h)], [x - ix, y - iy], wanted)
                },
            )
        },
    )
}

/// Colors (bytes, 0..=255) in directions of a cube texture, where one pixel is `footprint` wide on a cube of half
/// length 1.
///
/// Compiled once for each instruction set, not in each of its callers.
#[inline(never)]
pub(crate) fn sample_cube<S: Simd>(
    s: S,
    texture: &Texture,
    rule: MipRule,
    d: V3<S>,
    footprint: F<S>,
    lanes: M<S>,
) -> [F<S>; 3] {
    s.vectorize(
        #[inline(always)]
        || {
            let zero = splat(s, 0.0);
            let (ax, ay, az) = (abs(d.x), abs(d.y), abs(d.z));
            let by_x = ax.simd_ge(ay) & ax.simd_ge(az);
            let by_y = !by_x & ay.simd_ge(az);
            let axis = {
                #[inline(always)]
                |x: F<S>, y: F<S>, z: F<S>| select(by_x, x, select(by_y, y, z))
            };
            let major = axis(ax, ay, az);
            // Faces +x, -x, +y, -y, +z, -z, from top to bottom of the image.
            let positive = axis(d.x, d.y, d.z).simd_gt(zero);
            let face = axis(zero, splat(s, 2.0), splat(s, 4.0)) + select(positive, zero, splat(s, 1.0));
            let turned = {
                #[inline(always)]
                |x: F<S>| select(positive, x, -x)
            };
            let (u, v) = (axis(-turned(d.z), d.x, turned(d.x)), axis(-d.y, turned(d.z), -d.y));
            let k = 0.5 / select(major.simd_gt(zero), major, splat(s, 1.0));
            let (u, v) = (u * k + 0.5, v * k + 0.5);
            let texels = footprint * (0.5 * texture.mip_levels()[0].width() as f32);
            sample_levels(
                s,
                texture,
                rule,
                texels,
                lanes,
                #[inline(always)]
                |level, wanted| {
                    let side = level.width() as f32;
                    // Clamped: texels are not blended across the edge of a face.
                    let inside = {
                        #[inline(always)]
                        |x: F<S>| min(max(x * side - 0.5, zero), splat(s, side - 1.0))
                    };
                    let (x, y) = (inside(u), inside(v));
                    let (ix, iy) = (floor_lanes(s, x), floor_lanes(s, y));
                    bilinear(s, level, [ix, iy + face * side], [x - ix, y - iy], wanted)
                },
            )
        },
    )
}

/// Width of pixels on the faces of a cube of half length 1. The pixels are `width` wide \[m\] on the surface, and the
/// direction `d` is the point of the surface times `scale`.
#[inline(always)]
pub(crate) fn face_footprint<S: Simd>(s: S, d: V3<S>, scale: [f32; 3], width: F<S>) -> F<S> {
    let (x, y, z) = (abs(d.x), abs(d.y), abs(d.z));
    let by_x = x.simd_ge(y) & x.simd_ge(z);
    let by_y = !by_x & y.simd_ge(z);
    let major = select(by_x, x, select(by_y, y, z));
    let [on_x, on_y, on_z] = [scale[1].max(scale[2]), scale[0].max(scale[2]), scale[0].max(scale[1])];
    let across = select(by_x, splat(s, on_x), select(by_y, splat(s, on_y), splat(s, on_z)));
    width * across / max(major, splat(s, 1e-6))
}

/// Texture coordinates on the faces of a box, and their number per meter: [`Box::face_coordinates`] for sixteen points.
#[inline(always)]
pub(crate) fn on_box_faces<S: Simd>(s: S, cuboid: &Box, images: [f32; 2], p: V3<S>) -> ([F<S>; 2], F<S>) {
    let half = cuboid.half;
    let (x, y, z) = (p.x * (1.0 / half[0]), p.y * (1.0 / half[1]), p.z * (1.0 / half[2]));
    let (ax, ay, az) = (abs(x), abs(y), abs(z));
    let by_x = ax.simd_ge(ay) & ax.simd_ge(az);
    let by_y = !by_x & ay.simd_ge(az);
    // The axes of `Box::FACE_AXES`.
    let (across, along) = (select(by_x, y, x), select(by_x | by_y, z, y));
    let per_meter = Box::FACE_AXES
        .map(|[across, along]| splat(s, ((images[0] * images[1]).abs() / (4.0 * half[across] * half[along])).sqrt()));
    let density = select(by_x, per_meter[0], select(by_y, per_meter[1], per_meter[2]));
    ([(across * 0.5 + 0.5) * images[0], 1.0 - (0.5 - along * 0.5) * images[1]], density)
}

/// Interpolates the colors of `at` between the mip levels for pixels `texels` wide.
///
/// Neighboring pixels use the same two or three levels, so the loop is over levels, whose sizes all lanes share.
#[inline(always)]
fn sample_levels<S: Simd>(
    s: S,
    texture: &Texture,
    rule: MipRule,
    texels: F<S>,
    lanes: M<S>,
    at: impl Fn(&MipLevel, M<S>) -> [F<S>; 3],
) -> [F<S>; 3] {
    let levels = texture.mip_levels();
    let (zero, one) = (splat(s, 0.0), splat(s, 1.0));
    let mut out = [zero, zero, zero];
    // Level k is for pixels 2^k to 2^(k+1) texels wide. Up to 1.75 times 2^k it is used alone: the four texels of a
    // point nearly cover that. Beyond, it is blended with the next level, which costs a second lookup.
    let (mut from_last, mut left, mut width) = (zero, lanes, 1.0f32);
    let mut carried = false;
    for (k, level) in levels.iter().enumerate() {
        let last = k + 1 == levels.len();
        if !last && !carried && !(left & texels.simd_lt(splat(s, 2.0 * width))).any_true() {
            width *= 2.0;
            continue;
        }
        let here = if last { left } else { left & texels.simd_lt(splat(s, 2.0 * width)) };
        let to_next = match rule {
            _ if last => zero,
            MipRule::Sharp => min(max(texels * (4.0 / width) - 7.0, zero), one),
            // The binary logarithm of 1..=2, with an error of 0.009.
            MipRule::OpenGl | MipRule::OpenGlFaces => {
                let x = min(max(texels * (1.0 / width) - 1.0, zero), one);
                x * (x * -0.3465 + 1.3465)
            }
        };
        let to_next = select(here, to_next, zero);
        let weight = select(here, one - to_next, zero) + from_last;
        let wanted = weight.simd_gt(zero);
        if wanted.any_true() {
            let color = at(level, wanted);
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

/// Two horizontally adjacent texels as eight bytes; 0 beyond the last texel. Both indices have 32 bits, so that their sum
/// needs no check.
#[inline(always)]
fn pair(bytes: &[u8], texel: i32, row: i32) -> u64 {
    let from = 4 * (texel as u32 as usize + row as u32 as usize);
    match bytes.get(from..from + 8) {
        Some(&[a, b, c, d, e, f, g, h]) => u64::from_le_bytes([a, b, c, d, e, f, g, h]),
        _ => 0,
    }
}

/// Bilinear interpolation: column and row of the upper left texel, and the fractions to the next ones.
#[inline(always)]
fn bilinear<S: Simd>(s: S, level: &MipLevel, [x, y]: [F<S>; 2], [fx, fy]: [F<S>; 2], lanes: M<S>) -> [F<S>; 3] {
    let stride = level.width() as i32 + 1;
    let at = select_i(lanes, y.to_int() * stride + x.to_int(), splat_i(s, 0));
    let at: [i32; LANES] = at.array();
    let bytes = level.bytes();
    // Written out: `from_fn` stays a call, and a loop goes through memory.
    macro_rules! pairs {
        ($row:expr, $($lane:literal)*) => { [$(pair(bytes, at[$lane], $row)),*] };
    }
    let above = pairs!(0, 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15);
    let below = pairs!(stride, 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15);
    let ([a, b], [c, d]) = (halves(s, &above), halves(s, &below));
    let (a, b, c, d) = (a.bytes(), b.bytes(), c.bytes(), d.bytes());
    let mut out = a;
    for k in 0..3 {
        let (top, bottom) = (a[k] + (b[k] - a[k]) * fx, c[k] + (d[k] - c[k]) * fx);
        out[k] = top + (bottom - top) * fy;
    }
    out
}

/// Wraps -1..=n to 0..n.
#[inline(always)]
fn wrap<S: Simd>(s: S, i: F<S>, n: f32) -> F<S> {
    let i = select(i.simd_lt(splat(s, 0.0)), i + n, i);
    let i = select(i.simd_ge(splat(s, n)), i - n, i);
    min(max(i, splat(s, 0.0)), splat(s, n - 1.0))
}

/// True for a cube texture.
pub(crate) fn is_cube(texture: &Texture) -> bool {
    texture.kind() == TextureKind::Cube
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::TestRng;
    use crate::simd::{all_levels, at_level, load};

    /// Coordinates on the faces of a box of sixteen points are those of [`Box::face_coordinates`].
    #[test]
    fn faces_of_boxes() {
        let mut rng = TestRng(7);
        for _ in 0..100 {
            let cuboid = Box { half: rng.point(0.5).map(|x| 0.6 + x as f32) };
            let images = [2.5f32, 1.5];
            let mut points = [[0.0f32; 3]; LANES];
            for (k, point) in points.iter_mut().enumerate() {
                // Well inside of a face: at an edge, rounding decides on the face.
                *point = rng.point(1.0).map(|x| 0.9 * x as f32);
                point[k % 3] = if k % 2 == 0 { 1.0 } else { -1.0 };
                *point = [0, 1, 2].map(|axis| point[axis] * cuboid.half[axis]);
            }
            let axes: [[f32; LANES]; 3] = std::array::from_fn(|axis| points.map(|point| point[axis]));
            for level in all_levels() {
                at_level!(level, s => {
                    let [x, y, z] = axes.each_ref().map(|axis| load(s, axis));
                    let ([u, v], density) = on_box_faces(s, &cuboid, images, V3 { x, y, z });
                    let (u, v, density) = (u.array(), v.array(), density.array());
                    for (k, point) in points.iter().enumerate() {
                        let (uv, expected) = cuboid.face_coordinates(point.map(f64::from), images);
                        let found = [u[k], v[k], density[k]].map(f64::from);
                        let off = [found[0] - uv[0], found[1] - uv[1], found[2] / expected - 1.0];
                        assert!(off.iter().all(|x| x.abs() < 1e-5), "{point:?} {found:?} {uv:?} {expected}");
                    }
                });
            }
        }
    }
}

//! Texture lookup at one point: bilinear within the mip level of the footprint.

use kinetoscope_scene::MipLevel;
use kinetoscope_scene::Texture;
use kinetoscope_scene::vector::V3;

/// Linear color of a repeating texture at (u, v), v upward. `footprint` is the width of the pixel footprint as a
/// fraction of the longer side of the texture.
pub(super) fn at(texture: &Texture, [u, v]: [f64; 2], footprint: f64) -> V3 {
    let first = &texture.mip_levels()[0];
    let level = level(texture, footprint * f64::from(first.width().max(first.height())));
    let part = |x: f64| if x.abs() < 1e6 { x - x.floor() } else { 0.0 };
    let (w, h) = (f64::from(level.width()), f64::from(level.height()));
    let wrap = |x: f64, n: f64| if x < 0.0 { x + n } else { x };
    bilinear(level, wrap(part(u) * w - 0.5, w), wrap((1.0 - part(v)) * h - 0.5, h))
}

/// Linear color in a direction of a cube texture, for a footprint on a cube of half length 1.
pub(super) fn at_cube(texture: &Texture, d: V3, footprint: f64) -> V3 {
    let level = level(texture, footprint * 0.5 * f64::from(texture.mip_levels()[0].width()));
    let [ax, ay, az] = d.map(f64::abs);
    let (axis, major) = if ax >= ay && ax >= az {
        (0, ax)
    } else if ay >= az {
        (1, ay)
    } else {
        (2, az)
    };
    let front = d[axis] > 0.0;
    let turned = |x: f64| if front { x } else { -x };
    // Faces +x, -x, +y, -y, +z, -z, from top to bottom of the image.
    let (u, v) = match axis {
        0 => (-turned(d[2]), -d[1]),
        1 => (d[0], turned(d[2])),
        _ => (turned(d[0]), -d[1]),
    };
    let face = 2 * axis + usize::from(!front);
    let k = if major > 0.0 { 0.5 / major } else { 0.0 };
    let side = f64::from(level.width());
    // Clamped: texels are not blended across the edge of a face.
    let inside = |x: f64| ((x * k + 0.5) * side - 0.5).clamp(0.0, side - 1.0);
    bilinear(level, inside(u), inside(v) + face as f64 * side)
}

/// The mip level whose texels are as wide as the footprint, or the next finer one.
fn level(texture: &Texture, texels: f64) -> &MipLevel {
    let levels = texture.mip_levels();
    let mut k = 0;
    let mut width = 2.0;
    while k + 1 < levels.len() && texels >= width {
        (k, width) = (k + 1, 2.0 * width);
    }
    &levels[k]
}

/// Blends four texels in sRGB, as the rasterizer does.
fn bilinear(level: &MipLevel, x: f64, y: f64) -> V3 {
    let (ix, iy) = (x as usize, y as usize);
    let (fx, fy) = (x - ix as f64, y - iy as f64);
    let stride = level.width() as usize + 1;
    let byte =
        |x: usize, y: usize, c: usize| level.bytes().get(4 * (y * stride + x) + c).map_or(0.0, |&b| f64::from(b));
    [0, 1, 2].map(|c| {
        let mix = |y: usize| byte(ix, y, c) + (byte(ix + 1, y, c) - byte(ix, y, c)) * fx;
        let between = mix(iy) + (mix(iy + 1) - mix(iy)) * fy;
        linear(between / 255.0)
    })
}

/// Linear light of an sRGB value in 0..=1: the polynomial of the rasterizer's textures
/// ([`decode_bytes`](crate::shade::tone::decode_bytes)), because `powf` differs from machine to machine.
fn linear(x: f64) -> f64 {
    (((x * -0.156_114_5 + 0.615_823_9) * x + 0.494_052_83) * x + 0.045_749_872) * x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{all_levels, at_level, splat};
    use kinetoscope_scene::TextureKind;

    /// Within 0.0005 of the standard, and equal to the rasterizer to single precision.
    #[test]
    fn brightness() {
        for byte in 0..=255u8 {
            let texture = Texture::new(TextureKind::TwoD, 1, 1, 3, &[byte; 3]).unwrap();
            let [light, ..] = at(&texture, [0.3, 0.7], 0.0);
            let standard = f64::from(kinetoscope_scene::decode_srgb(f32::from(byte) / 255.0));
            assert!((light - standard).abs() < 5e-4, "{byte}: {light}, not {standard}");
            for level in all_levels() {
                let raster = at_level!(level, s => {
                    crate::shade::tone::decode_bytes(splat(s, f32::from(byte))).array()[0]
                });
                assert!((light - f64::from(raster)).abs() < 1e-6, "{byte}: {light}, not {raster}");
            }
        }
    }
}

//! Denoising by an edge-avoiding à-trous wavelet filter: several passes of a small filter with holes, each twice as
//! wide as the one before. It does not blend across edges of normals, of depth, or of light that differs by more than
//! its noise. Albedo is divided out before, so that textures stay sharp. Where some of the light is mirrored, which
//! albedo does not tint, edges of albedo are edges too.
//!
//! Sources: Dammertz et al., Edge-avoiding à-trous wavelet transform for fast global illumination filtering, HPG 2010;
//! the weights by the variance of light after Schied et al., Spatiotemporal variance-guided filtering, HPG 2017, with
//! polynomials in place of exponentials, which differ from machine to machine.

use super::accumulator::Pixel;
use super::{PixelEstimate, brightness};

/// Number of passes: the last one reaches 2 * 2^4 pixels.
pub(crate) const FILTER_PASSES: u32 = 5;
/// Weights of a pixel and of those one and two steps away: a cubic B-spline.
const KERNEL: [f32; 3] = [0.375, 0.25, 0.0625];
/// Relative difference of distance per pixel within one surface.
const DISTANCE_TOLERANCE: f32 = 0.016;
/// Tolerated difference of light, in standard deviations of its noise.
const NOISE_TOLERANCE: f32 = 4.0;
/// Additional tolerated difference, after exposure: far below visibility.
const LIGHT_TOLERANCE: f32 = 1e-4;
/// Relative difference of albedo at which glossy surfaces count as different.
const ALBEDO_TOLERANCE: f32 = 0.2;

/// Features of a pixel that guide the filter.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DenoiseGuide {
    /// Albedo, never 0.
    pub(crate) albedo: [f32; 3],
    /// Mirrored fraction of the reflected light.
    pub(crate) gloss: f32,
    pub(crate) normal: [f32; 3],
    /// Distance \[m\]; 0 for the sky.
    pub(crate) distance: f32,
}

impl DenoiseGuide {
    pub(super) fn new(found: &PixelEstimate) -> Self {
        Self {
            albedo: found.albedo.map(|x| (x as f32).max(0.02)),
            gloss: found.gloss as f32,
            normal: found.normal.map(|x| x as f32),
            distance: found.distance as f32,
        }
    }
}

/// Estimates the variance of pixels from their neighborhood, for images of one path per pixel, which have no other
/// estimate. Writes some rows, beginning at `first`. Source: Schied et al. 2017, section 4.2.
pub(crate) fn estimate_variance([width, first]: [usize; 2], from: &[Pixel], guides: &[DenoiseGuide], to: &mut [Pixel]) {
    let height = from.len() / width.max(1);
    for (k, to) in to.iter_mut().enumerate() {
        let [x, y] = [k % width, first + k / width];
        let at = y * width + x;
        let (mut whole, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for py in y.saturating_sub(2)..(y + 3).min(height) {
            for px in x.saturating_sub(2)..(x + 3).min(width) {
                let other = py * width + px;
                let reach = px.abs_diff(x).max(py.abs_diff(y)) as f32;
                let weight = if other == at { 1.0 } else { similarity(&guides[at], &guides[other], reach) };
                let bright = light(&from[other]);
                whole += weight;
                sum += weight * bright;
                squares += weight * bright * bright;
            }
        }
        let mean = sum / whole;
        *to = Pixel { variance: (squares / whole - mean * mean).max(0.0), ..from[at] };
    }
}

/// One filter pass over some rows, beginning at `first`; `pass` counts from 0. Light will be multiplied by `exposure`.
pub(crate) fn filter_pass(
    [width, first]: [usize; 2],
    pass: u32,
    exposure: f32,
    from: &[Pixel],
    guides: &[DenoiseGuide],
    to: &mut [Pixel],
) {
    let step = 1isize << pass;
    let height = from.len() / width.max(1);
    for (k, to) in to.iter_mut().enumerate() {
        let (x, y) = ((k % width) as isize, (first + k / width) as isize);
        let at = y as usize * width + x as usize;
        let (center, guide) = (from[at], guides[at]);
        let mut sum = Pixel::default();
        let mut whole = 0.0;
        let bright = light(&center);
        let noise = NOISE_TOLERANCE * mean_variance(from, [width, height], [x, y]).sqrt() + LIGHT_TOLERANCE / exposure;
        for j in -2isize..=2 {
            for i in -2isize..=2 {
                let (px, py) = (x + i * step, y + j * step);
                if px < 0 || py < 0 || px >= width as isize || py >= height as isize {
                    continue;
                }
                let other = py as usize * width + px as usize;
                let (pixel, beside) = (from[other], guides[other]);
                let reach = step as f32 * (i.unsigned_abs().max(j.unsigned_abs()) as f32);
                let apart = (light(&pixel) - bright) / noise;
                // The pixel itself always counts, even if its mean normal is almost 0.
                let surface = if i == 0 && j == 0 { 1.0 } else { similarity(&guide, &beside, reach) };
                let weight = KERNEL[i.unsigned_abs()]
                    * KERNEL[j.unsigned_abs()]
                    * surface
                    * (1.0 / (1.0 + apart * apart * apart * apart));
                whole += weight;
                for c in 0..3 {
                    sum.color[c] += weight * pixel.color[c];
                }
                sum.variance += weight * weight * pixel.variance;
            }
        }
        // The pixel's own weight is positive, so `whole` is.
        *to = Pixel { color: sum.color.map(|x| x / whole), variance: sum.variance / (whole * whole) };
    }
}

fn light(pixel: &Pixel) -> f32 {
    brightness(pixel.color.map(f64::from)) as f32
}

/// Mean variance of a pixel and its neighbors: the variance of one pixel is itself noisy.
fn mean_variance(from: &[Pixel], [width, height]: [usize; 2], [x, y]: [isize; 2]) -> f32 {
    let (mut sum, mut count) = (0.0, 0.0);
    for j in -1..=1 {
        for i in -1..=1 {
            let (px, py) = (x + i, y + j);
            if px >= 0 && py >= 0 && px < width as isize && py < height as isize {
                sum += from[py as usize * width + px as usize].variance;
                count += 1.0;
            }
        }
    }
    sum / count
}

/// Similarity of two pixels' surfaces, 0..=1, at a distance of `reach` pixels.
fn similarity(a: &DenoiseGuide, b: &DenoiseGuide, reach: f32) -> f32 {
    if (a.distance == 0.0) != (b.distance == 0.0) {
        return 0.0;
    }
    let cosine = a.normal.iter().zip(b.normal).map(|(x, y)| x * y).sum::<f32>().max(0.0);
    // To the 64th power; the sky has no normal.
    let facing = if a.distance == 0.0 { 1.0 } else { (0..6).fold(cosine, |x, _| x * x) };
    let depth = (a.distance - b.distance).abs() / (DISTANCE_TOLERANCE * a.distance.max(1e-6) * reach.max(1.0));
    let near = (1.0 - depth * depth).max(0.0);
    let tint = (0..3).map(|c| (a.albedo[c] - b.albedo[c]).abs() / (a.albedo[c] + b.albedo[c])).fold(0.0, f32::max);
    let same = 1.0 - a.gloss.max(b.gloss) * (tint / ALBEDO_TOLERANCE).min(1.0);
    facing * near * near * same * same
}

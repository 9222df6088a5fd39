//! Accumulator of path-traced images: one row of memory per row of pixels, so that threads share it.

use super::denoise::DenoiseGuide;
use super::{PathTracer, PixelEstimate, SceneLights};
use crate::geometry::bvh::TraversalStack;
use crate::progress::RenderProgress;
use crate::shade::tone::{ToneCurve, encode};
use crate::simd::{LANES, Simd, SimdLevel, at_level, load};

/// Limit of radiance: sums of several dozen of its squares are finite in single precision.
const MAX_RADIANCE: f32 = 1e18;

/// Accumulator of an image in linear light; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Accumulator {
    pub(crate) width: usize,
    pub(crate) lights: SceneLights,
    /// Radiance; with denoising, radiance divided by albedo until it is encoded.
    pub(crate) pixels: Vec<Pixel>,
    /// Pixels of the next denoising pass.
    pub(crate) next: Vec<Pixel>,
    /// Denoising guides; empty without denoising.
    pub(crate) guides: Vec<DenoiseGuide>,
}

/// A pixel of the accumulator.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pixel {
    pub(crate) color: [f32; 3],
    /// Variance of the mean brightness; with denoising, relative to the squared brightness of the albedo.
    pub(crate) variance: f32,
}

/// Rows of an image that one thread works on.
#[derive(Debug)]
pub(crate) struct AccumulatorRows<'a> {
    /// The first row.
    pub(crate) first: usize,
    pub(crate) pixels: &'a mut [Pixel],
    pub(crate) guides: &'a mut [DenoiseGuide],
}

impl Accumulator {
    /// Memory per pixel of an image \[bytes\]; `smooth` is true with denoising.
    pub const fn bytes_per_pixel(smooth: bool) -> usize {
        if smooth { 2 * size_of::<Pixel>() + size_of::<DenoiseGuide>() } else { size_of::<Pixel>() }
    }

    pub(crate) fn bytes(&self) -> usize {
        (self.pixels.capacity() + self.next.capacity()) * size_of::<Pixel>()
            + self.guides.capacity() * size_of::<DenoiseGuide>()
            + self.lights.bytes()
    }

    /// Resizes the memory to an image of `width` by `height` pixels; `smooth` is true with denoising. Existing values
    /// are not cleared.
    pub(crate) fn resize(&mut self, [width, height]: [usize; 2], smooth: bool) {
        self.width = width;
        let count = width * height;
        self.pixels.resize(count, Pixel::default());
        self.guides.resize(if smooth { count } else { 0 }, DenoiseGuide::default());
        self.next.resize(if smooth { count } else { 0 }, Pixel::default());
    }

    /// The image in bands of `rows` rows, and its lights.
    pub(crate) fn rows(&mut self, rows: usize) -> (&SceneLights, impl Iterator<Item = AccumulatorRows<'_>>) {
        let size = (self.width * rows).max(1);
        let (parts, mut guides) = (self.pixels.chunks_mut(size).enumerate(), self.guides.chunks_mut(size));
        let part =
            move |(k, pixels)| AccumulatorRows { first: k * rows, pixels, guides: guides.next().unwrap_or_default() };
        (&self.lights, parts.map(part))
    }
}

impl AccumulatorRows<'_> {
    /// Traces the paths of all pixels; returns false if rendering was canceled. With `smooth`, radiance is divided by
    /// albedo.
    pub(crate) fn path_trace(
        &mut self,
        level: SimdLevel,
        paths: &PathTracer<'_>,
        smooth: bool,
        stack: &mut TraversalStack,
        progress: &RenderProgress,
    ) -> bool {
        at_level!(level, s => self.path_trace_lanes(s, paths, smooth, stack, progress))
    }

    fn path_trace_lanes<S: Simd>(
        &mut self,
        s: S,
        paths: &PathTracer<'_>,
        smooth: bool,
        stack: &mut TraversalStack,
        progress: &RenderProgress,
    ) -> bool {
        let width = paths.camera_rays.projection.width;
        for (k, pixel) in self.pixels.iter_mut().enumerate() {
            if progress.is_canceled() {
                return false;
            }
            let at = [k % width, self.first + k / width];
            let found @ PixelEstimate { color, variance, rays, .. } = s.vectorize(
                #[inline(always)]
                || paths.pixel(s, at, stack),
            );
            progress.add(paths.samples.into(), rays);
            let mut by = [1.0; 3];
            if let Some(guide) = self.guides.get_mut(k).filter(|_| smooth) {
                *guide = DenoiseGuide::new(&found);
                by = guide.albedo;
            }
            let mean = super::brightness(by.map(f64::from));
            *pixel = Pixel {
                color: [0, 1, 2].map(|c| (color[c] as f32 / by[c]).min(MAX_RADIANCE)),
                variance: ((variance / (mean * mean)) as f32).min(MAX_RADIANCE * MAX_RADIANCE),
            };
            #[cfg(test)]
            assert!(found.albedo.iter().all(|x| x.is_finite()), "{:?}", found.albedo);
        }
        true
    }
}

/// Converts radiance to sRGB bytes: multiplies it by `exposure` before the tone curve, and with guides by the albedo.
pub(crate) fn tonemap(
    level: SimdLevel,
    exposure: f32,
    curve: ToneCurve,
    pixels: &[Pixel],
    guides: &[DenoiseGuide],
    out: &mut [u8],
) {
    at_level!(level, s => tonemap_lanes(s, exposure, curve, pixels, guides, out));
}

fn tonemap_lanes<S: Simd>(
    s: S,
    exposure: f32,
    curve: ToneCurve,
    pixels: &[Pixel],
    guides: &[DenoiseGuide],
    out: &mut [u8],
) {
    for (group, (pixels, out)) in pixels.chunks(LANES).zip(out.chunks_mut(4 * LANES)).enumerate() {
        for c in 0..3 {
            let mut linear = [0.0f32; LANES];
            for ((to, pixel), k) in linear.iter_mut().zip(pixels).zip(group * LANES..) {
                *to = pixel.color[c] * guides.get(k).map_or(1.0, |guide| guide.albedo[c]);
            }
            let mut bytes = [0i32; LANES];
            // Loads stay inside of this closure: outside, wide registers of some instruction sets are spilled to a
            // stack that is not aligned for them.
            s.vectorize(
                #[inline(always)]
                || bytes = encode(s, curve, load(s, &linear) * exposure).to_int().array(),
            );
            for (to, byte) in out.chunks_exact_mut(4).zip(bytes) {
                (to[c], to[3]) = (byte as u8, 255);
            }
        }
    }
}

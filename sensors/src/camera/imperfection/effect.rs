//! Traits of imperfections, and the image and pixel that they work on.

use crate::error::SensorError;
use kinetoscope_render::RngKey;
use kinetoscope_render::View;
use kinetoscope_render::lens::LensRays;

/// An imperfection of light, applied to each pixel.
pub(super) trait RadianceEffect {
    /// Checks the parameters.
    fn check(&self) -> Result<(), SensorError>;

    /// Modifies the linear RGB radiance of a pixel.
    fn apply(&self, light: &mut [f64; 3], context: &PixelContext<'_>);
}

/// An imperfection of measured depth, applied to an image.
pub(super) trait DepthEffect {
    /// Checks the parameters.
    fn check(&self) -> Result<(), SensorError>;

    /// Modifies an image of clip depths \[m\], row by row; misses are infinite. The clip depth is the depth along the
    /// optical axis, or the distance along the ray if not all rays of the lens go forward.
    fn apply(&self, depths: &mut [f32], image: &ImageContext<'_>);
}

/// View, lens and random key of an image.
#[derive(Clone, Copy, Debug)]
pub(in crate::camera) struct ImageContext<'a> {
    pub(in crate::camera) view: &'a View,
    /// Rays of the lens; `None` is a pinhole.
    pub(in crate::camera) rays: Option<&'a LensRays>,
    pub(in crate::camera) rng_key: &'a RngKey,
}

/// A pixel of an image.
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelContext<'a> {
    pub(super) image: ImageContext<'a>,
    /// Pixel index, row by row from the top left.
    pub(super) pixel: usize,
}

impl ImageContext<'_> {
    /// Returns the ray through the center of a pixel in the optical frame, scaled to depth 1 if all rays go forward,
    /// else to length 1; 0 if the lens has no ray there.
    pub(super) fn ray(&self, pixel: usize) -> [f64; 3] {
        let View { width, fx, fy, cx, cy, .. } = *self.view;
        let [column, row] = [pixel % width, pixel / width];
        if let Some(rays) = self.rays {
            return rays.direction(0, [column, row]).map(f64::from);
        }
        let (u, v) = (column as f64 + 0.5, row as f64 + 0.5);
        [(u - f64::from(cx)) / f64::from(fx), (v - f64::from(cy)) / f64::from(fy), 1.0]
    }

    /// Returns true if not all rays go forward: the clip depth is then the distance, not the depth.
    pub(super) fn clips_by_distance(&self) -> bool {
        self.rays.is_some_and(|rays| !rays.is_forward())
    }

    /// Returns the distance of a point at depth 1 if all rays go forward, else the depth of a point at distance 1.
    pub(super) fn clip_depth_conversion(&self, pixel: usize) -> f64 {
        let [x, y, z] = self.ray(pixel);
        if self.clips_by_distance() { z } else { (x * x + y * y + z * z).sqrt() }
    }

    /// Returns the irradiance of a pixel relative to the optical axis: see `Vignetting`.
    pub(super) fn falloff(&self, pixel: usize) -> f64 {
        match self.rays {
            None => self.clip_depth_conversion(pixel).powi(-4),
            Some(rays) => rays.falloff([pixel % self.view.width, pixel / self.view.width]),
        }
    }
}

/// Checks that `field` of an imperfection is from `range[0]` to `range[1]`; `expected` states the range in the error.
pub(super) fn within(
    field: &'static str,
    value: f64,
    range: [f64; 2],
    expected: &'static str,
) -> Result<(), SensorError> {
    if (range[0]..=range[1]).contains(&value) {
        return Ok(());
    }
    Err(SensorError::OutOfRange { field: field.into(), value, expected })
}

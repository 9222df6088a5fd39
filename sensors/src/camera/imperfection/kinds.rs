//! Traits of imperfections, and the image and pixel that they work on.

use crate::error::SensorError;
use kinetoscope_render::Ticket;
use kinetoscope_render::View;
use kinetoscope_render::lens::LensRays;

/// An imperfection of light, applied to each pixel.
pub(super) trait OfLight {
    /// Checks the parameters.
    fn check(&self) -> Result<(), SensorError>;

    /// Modifies the linear RGB radiance of a pixel.
    fn spoil(&self, light: &mut [f64; 3], place: &Place<'_>);
}

/// An imperfection of measured depth, applied to an image.
pub(super) trait OfDepth {
    /// Checks the parameters.
    fn check(&self) -> Result<(), SensorError>;

    /// Modifies an image of reaches \[m\], row by row; misses are infinite. The reach is the depth, or the distance
    /// along the ray if rays of the lens do not all go forward.
    fn spoil(&self, depths: &mut [f32], picture: &Picture<'_>);
}

/// View, lens and random key of an image.
#[derive(Clone, Copy, Debug)]
pub(in crate::camera) struct Picture<'a> {
    pub(in crate::camera) view: &'a View,
    /// Rays of the lens; `None` is a pinhole.
    pub(in crate::camera) rays: Option<&'a LensRays>,
    pub(in crate::camera) ticket: &'a Ticket,
}

/// A pixel of an image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place<'a> {
    pub(super) picture: Picture<'a>,
    /// Pixel index, row by row from the top left.
    pub(super) pixel: usize,
}

impl Picture<'_> {
    /// Returns the ray through the center of a pixel, scaled to reach 1; 0 if the lens has no ray there.
    pub(super) fn ray(&self, pixel: usize) -> [f64; 3] {
        let View { width, fx, fy, cx, cy, .. } = *self.view;
        let [column, row] = [pixel % width, pixel / width];
        if let Some(rays) = self.rays {
            return rays.direction(0, [column, row]).map(f64::from);
        }
        let (u, v) = (column as f64 + 0.5, row as f64 + 0.5);
        [(u - f64::from(cx)) / f64::from(fx), (v - f64::from(cy)) / f64::from(fy), 1.0]
    }

    /// Returns true if rays do not all go forward: the reach is then the distance, not the depth.
    pub(super) fn reaches_aside(&self) -> bool {
        self.rays.is_some_and(|rays| !rays.is_forward())
    }

    /// Returns the distance of a point at depth 1 if all rays go forward, else the depth of a point at distance 1.
    pub(super) fn other_than_reach(&self, pixel: usize) -> f64 {
        let [x, y, z] = self.ray(pixel);
        if self.reaches_aside() { z } else { (x * x + y * y + z * z).sqrt() }
    }

    /// Returns the irradiance of a pixel relative to the optical axis: see `Vignetting`.
    pub(super) fn falloff(&self, pixel: usize) -> f64 {
        match self.rays {
            None => self.other_than_reach(pixel).powi(-4),
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

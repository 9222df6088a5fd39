//! The traits of imperfections, and the image and pixel that they are told of.

use crate::error::SensorError;
use kinetoscope_render::Ticket;
use kinetoscope_render::View;
use kinetoscope_render::lens::LensRays;

/// An imperfection of light.
pub(super) trait OfLight {
    /// Checks its numbers.
    fn check(&self) -> Result<(), SensorError>;

    /// Spoils the linear light (red, green, blue) of a pixel.
    fn spoil(&self, light: &mut [f64; 3], place: &Place<'_>);
}

/// An imperfection of measured depth.
pub(super) trait OfDepth {
    /// Checks its numbers.
    fn check(&self) -> Result<(), SensorError>;

    /// Spoils a picture of reaches \[m\], row by row; where nothing is measured they are infinite.
    fn spoil(&self, depths: &mut [f32], picture: &Picture<'_>);
}

/// An image and its lens.
#[derive(Clone, Copy, Debug)]
pub(in crate::camera) struct Picture<'a> {
    pub(in crate::camera) view: &'a View,
    /// The rays of its lens; `None` is a pinhole.
    pub(in crate::camera) rays: Option<&'a LensRays>,
    pub(in crate::camera) ticket: &'a Ticket,
}

/// A pixel of a picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place<'a> {
    pub(super) picture: Picture<'a>,
    /// Counted row by row from the top left.
    pub(super) pixel: usize,
}

impl Picture<'_> {
    /// The direction through the centre of a pixel whose reach is 1; 0 where the lens sees nothing.
    pub(super) fn ray(&self, pixel: usize) -> [f64; 3] {
        let View { width, fx, fy, cx, cy, .. } = *self.view;
        let [column, row] = [pixel % width, pixel / width];
        if let Some(rays) = self.rays {
            return rays.direction(0, [column, row]).map(f64::from);
        }
        let (u, v) = (column as f64 + 0.5, row as f64 + 0.5);
        [(u - f64::from(cx)) / f64::from(fx), (v - f64::from(cy)) / f64::from(fy), 1.0]
    }

    /// True if rays go aside, so that reach is distance, not depth.
    pub(super) fn reaches_aside(&self) -> bool {
        self.rays.is_some_and(|rays| !rays.is_forward())
    }

    /// Distance of what has depth 1, where rays go forward; depth of what has distance 1, where they go aside.
    pub(super) fn other_than_reach(&self, pixel: usize) -> f64 {
        let [x, y, z] = self.ray(pixel);
        if self.reaches_aside() { z } else { (x * x + y * y + z * z).sqrt() }
    }

    /// How much of the light of the optical axis falls on a pixel: see `Vignetting`.
    pub(super) fn falloff(&self, pixel: usize) -> f64 {
        match self.rays {
            None => self.other_than_reach(pixel).powi(-4),
            Some(rays) => rays.falloff([pixel % self.view.width, pixel / self.view.width]),
        }
    }
}

/// Checks that `field` of an imperfection is from `range[0]` to `range[1]`; `expected` says so in the error.
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

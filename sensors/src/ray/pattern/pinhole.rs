//! One ray through every pixel of a pinhole camera.

use super::{PatternImpl, UnnormalizedRay};
use crate::ray::RayError;
use kinetoscope_render::Intrinsics;
use serde::{Deserialize, Serialize};

/// One ray through the center of every pixel of a pinhole camera that looks along x with z up, row by row from the top
/// left.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Pinhole {
    /// Image width \[pixels\].
    pub width: usize,
    /// Image height \[pixels\].
    pub height: usize,
    /// Focal lengths and principal point.
    pub intrinsics: Intrinsics,
}

impl Default for Pinhole {
    /// 64 by 48 pixels with Isaac's default intrinsics.
    fn default() -> Self {
        Self { width: 64, height: 48, intrinsics: Intrinsics::ISAAC }
    }
}

impl PatternImpl for Pinhole {
    fn count(&self) -> f64 {
        self.width as f64 * self.height as f64
    }

    fn rays(&self) -> Result<Vec<UnnormalizedRay>, RayError> {
        let lens = self.intrinsics.to_pixels(self.width, self.height)?;
        let ray = |u: usize, v: usize| {
            // Offsets from the optical axis, to the right and down, at a depth of 1.
            let (right, below) = ((u as f64 + 0.5 - lens.cx) / lens.fx, (v as f64 + 0.5 - lens.cy) / lens.fy);
            ([0.0; 3], [1.0, -right, -below])
        };
        Ok((0..self.height).flat_map(|v| (0..self.width).map(move |u| ray(u, v))).collect())
    }
}

//! Read noise of the electronics.

use super::{PixelContext, RadianceEffect, within};
use crate::error::SensorError;
use kinetoscope_render::RngStream;
use serde::{Deserialize, Serialize};

/// Normally distributed noise of the electronics, the same at every brightness and independent for red, green and blue.
/// Negative radiance becomes black.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReadNoise {
    /// Standard deviation in linear radiance (1 is a fully lit white surface, as exposed), 0 to 100: electrons of read
    /// noise divided by [`ShotNoise::electrons`](super::ShotNoise::electrons).
    pub std: f64,
}

impl Default for ReadNoise {
    /// 10 electrons of 5000.
    fn default() -> Self {
        Self { std: 0.002 }
    }
}

impl RadianceEffect for ReadNoise {
    fn check(&self) -> Result<(), SensorError> {
        within("std of the read noise", self.std, [0.0, 100.0], "it must be 0 to 100")
    }

    fn apply(&self, light: &mut [f64; 3], context: &PixelContext<'_>) {
        let normals = context.image.rng_key.normals(RngStream::READ, context.pixel as u32);
        for (light, normal) in light.iter_mut().zip(normals) {
            *light += self.std * normal;
        }
    }
}

//! Exposure compensation.

use super::{PixelContext, RadianceEffect, within};
use crate::error::SensorError;
use serde::{Deserialize, Serialize};

/// Exposure compensation. At 0 stops, a fully lit white surface has radiance 1.
///
/// The renderers multiply radiance by 2 to the power of `stops` before the tone curve
/// ([`ImageRenderer::exposure_compensation`](kinetoscope_render::ImageRenderer::exposure_compensation)), so highlights
/// that clip at 0 stops keep their detail at negative stops. All other imperfections are applied after it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Exposure {
    /// Stops, -20 to 20: radiance is multiplied by 2 to this power.
    pub stops: f64,
}

impl RadianceEffect for Exposure {
    fn check(&self) -> Result<(), SensorError> {
        within("stops of the exposure", self.stops, [-20.0, 20.0], "it must be -20 to 20")
    }

    /// Does nothing: the renderer has applied the exposure.
    fn apply(&self, _light: &mut [f64; 3], _context: &PixelContext<'_>) {}
}

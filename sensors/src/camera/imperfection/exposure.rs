//! Exposure compensation.

use super::{PixelContext, RadianceEffect, within};
use crate::error::SensorError;
use serde::{Deserialize, Serialize};

/// Longer or shorter exposure, relative to the exposure at which a fully lit white surface has radiance 1.
///
/// The renderers multiply radiance by this factor before the tone curve
/// ([`ImageRenderer::exposure_compensation`](kinetoscope_render::ImageRenderer::exposure_compensation)), so highlights
/// that clip at 0 stops keep their detail at fewer stops. All other imperfections are applied after it.
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

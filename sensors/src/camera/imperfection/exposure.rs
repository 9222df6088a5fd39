//! Longer or shorter exposure.

use super::{OfLight, Place, within};
use crate::error::SensorError;
use serde::{Deserialize, Serialize};

/// Longer or shorter exposure than that in which a white surface in full light is 1.
///
/// The renderers multiply light by it before the tone curve ([`Rasterizer::stops`](kinetoscope_render::Rasterizer::stops)): what is
/// white on the screen at 0 stops is told apart at less. All other imperfections come after it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Exposure {
    /// Stops, -20 to 20: light is multiplied by 2 to this power.
    pub stops: f64,
}

impl OfLight for Exposure {
    fn check(&self) -> Result<(), SensorError> {
        within("stops of the exposure", self.stops, [-20.0, 20.0], "it must be -20 to 20")
    }

    /// The light that comes here was multiplied already.
    fn spoil(&self, _light: &mut [f64; 3], _place: &Place<'_>) {}
}

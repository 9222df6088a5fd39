//! Longer or shorter exposure.

use super::{OfLight, Place, within};
use crate::error::SensorError;
use serde::{Deserialize, Serialize};

/// Longer or shorter exposure than that in which a white surface in full light is 1.
///
/// It acts on the finished picture: what was white on the screen is known to be bright, and not how bright.
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

    fn spoil(&self, light: &mut [f64; 3], _place: &Place<'_>) {
        let factor = self.stops.exp2();
        *light = light.map(|light| factor * light);
    }
}

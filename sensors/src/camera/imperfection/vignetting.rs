//! Less light away from the optical axis.

use super::{OfLight, Place, within};
use crate::error::SensorError;
use serde::{Deserialize, Serialize};

/// Less light away from the optical axis: a thin lens in front of a flat sensor lets through the fourth power of the cosine of
/// the angle between a pixel's ray and the axis. Source: Horn 1986, "Robot Vision", chapter 10. Light is multiplied by
/// `1 + strength (cos⁴ - 1)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Vignetting {
    /// How much of the law holds: 0 for nothing of it, 1 (as by default) for a plain thin lens.
    pub strength: f64,
}

impl Default for Vignetting {
    fn default() -> Self {
        Self { strength: 1.0 }
    }
}

impl OfLight for Vignetting {
    fn check(&self) -> Result<(), SensorError> {
        within("strength of the vignetting", self.strength, [0.0, 1.0], "it must be 0 to 1")
    }

    fn spoil(&self, light: &mut [f64; 3], place: &Place<'_>) {
        let factor = 1.0 + self.strength * (place.picture.cosine(place.pixel).powi(4) - 1.0);
        *light = light.map(|light| factor * light);
    }
}

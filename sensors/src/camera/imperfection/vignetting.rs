//! Light falloff away from the optical axis.

use super::{PixelContext, RadianceEffect, within};
use crate::error::SensorError;
use serde::{Deserialize, Serialize};

/// Light falloff away from the optical axis. Radiance is multiplied by `1 + strength (falloff - 1)`.
///
/// For a uniformly bright scene, the irradiance of a pixel is proportional to two factors. One is its solid angle. The
/// other is the projected area of the aperture, which is the cosine of the angle theta between ray and axis. The
/// falloff is their product, normalized to 1 on the axis, and 0 beyond a right angle:
///
/// | lens | falloff |
/// |---|---|
/// | pinhole | cos⁴ theta (Horn 1986, "Robot Vision", chapter 10) |
/// | equidistant fisheye | cos theta sin theta / theta |
/// | equisolid | cos theta |
/// | orthographic | 1 |
/// | stereographic | cos theta cos⁴(theta / 2) |
///
/// For other lenses it follows from their mapping. It exceeds 1 if a barrel distortion gives a pixel a larger solid
/// angle than on the axis. A panorama has no optical axis, and is rejected.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Vignetting {
    /// Strength, from 0 for no falloff to 1 (the default) for a plain thin lens.
    pub strength: f64,
}

impl Default for Vignetting {
    fn default() -> Self {
        Self { strength: 1.0 }
    }
}

impl RadianceEffect for Vignetting {
    fn check(&self) -> Result<(), SensorError> {
        within("strength of the vignetting", self.strength, [0.0, 1.0], "it must be 0 to 1")
    }

    fn apply(&self, light: &mut [f64; 3], context: &PixelContext<'_>) {
        let factor = 1.0 + self.strength * (context.image.falloff(context.pixel) - 1.0);
        *light = light.map(|light| factor * light);
    }
}

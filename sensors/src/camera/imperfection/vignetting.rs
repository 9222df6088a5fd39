//! Less light away from the optical axis.

use super::{OfLight, Place, within};
use crate::error::SensorError;
use serde::{Deserialize, Serialize};

/// Less light away from the optical axis. Light is multiplied by `1 + strength (falloff - 1)`.
///
/// Of what is equally bright, the light on a pixel is proportional to the solid angle that it sees times the area of the
/// aperture as seen from there, which is as the cosine of the angle theta between the pixel's ray and the axis; the falloff is
/// that product, 1 on the axis, and 0 beyond a right angle. So it is cos⁴ theta of a pinhole (Horn 1986, "Robot Vision",
/// chapter 10), cos theta sin theta / theta of the equidistant fisheye, cos theta of the equisolid one, 1 of the orthographic
/// one, cos theta cos⁴(theta / 2) of the stereographic one, and of others what their mapping makes of it: more than 1 where a
/// barrel distortion crowds more of the view into a pixel than it has on the axis. A panorama has no optical axis, and is
/// refused.
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
        let factor = 1.0 + self.strength * (place.picture.falloff(place.pixel) - 1.0);
        *light = light.map(|light| factor * light);
    }
}

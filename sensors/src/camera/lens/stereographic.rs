//! The stereographic fisheye, which keeps angles: r = 2 f tan(theta / 2).

use super::{CameraError, Domain, LensModel, angle_up_to, radial};
use serde::{Deserialize, Serialize};

/// The largest angle \[rad\]: pi would be infinitely far out.
const MOST: f64 = 3.1;

/// The stereographic fisheye, which keeps angles: r = 2 f tan(theta / 2).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Stereographic {
    /// Nothing is seen farther from the optical axis than this angle \[rad\]: above 0, at most 3.1 (pi is infinitely far out).
    pub max_angle: f64,
}

impl Default for Stereographic {
    /// As far as it goes.
    fn default() -> Self {
        Self { max_angle: MOST }
    }
}

/// Radius in the normalised picture of an angle with the optical axis \[rad\].
fn radius(angle: f64) -> f64 {
    2.0 * (0.5 * angle).tan()
}

impl LensModel for Stereographic {
    const NAME: &'static str = "stereographic";
    const ALIASES: &'static [&'static str] = &["fisheye_stereographic", "fisheyeStereographic"];

    fn max_angle(&self) -> Option<f64> {
        Some(self.max_angle)
    }

    fn validate(&self) -> Result<(), CameraError> {
        angle_up_to(self.max_angle, MOST, "above 0, at most 3.1 (pi is infinitely far out)")
    }

    fn domain(&self) -> Domain {
        Domain { angle: self.max_angle, radius: radius(self.max_angle), folds: false }
    }

    fn project(&self, domain: &Domain, direction: [f64; 3]) -> Option<[f64; 2]> {
        radial::project(direction, domain.angle, radius)
    }

    fn unproject(&self, domain: &Domain, point: [f64; 2]) -> Option<[f64; 3]> {
        radial::unproject(point, domain.angle, |radius| Some(2.0 * (0.5 * radius).atan()))
    }
}

//! The orthographic fisheye: r = f sin(theta).

use super::{CameraError, Domain, LensModel, angle_up_to, radial};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

/// The orthographic fisheye: r = f sin(theta).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Orthographic {
    /// Nothing is seen farther from the optical axis than this angle \[rad\]: above 0, at most pi / 2.
    pub max_angle: f64,
}

impl Default for Orthographic {
    /// Half of everything: no orthographic fisheye sees more.
    fn default() -> Self {
        Self { max_angle: FRAC_PI_2 }
    }
}

/// Radius in the normalised picture of an angle with the optical axis \[rad\].
fn radius(angle: f64) -> f64 {
    angle.sin()
}

impl LensModel for Orthographic {
    const NAME: &'static str = "orthographic";
    const ALIASES: &'static [&'static str] = &["fisheye_orthographic", "fisheyeOrthographic"];

    fn max_angle(&self) -> Option<f64> {
        Some(self.max_angle)
    }

    fn validate(&self) -> Result<(), CameraError> {
        angle_up_to(self.max_angle, FRAC_PI_2, "above 0, at most pi / 2")
    }

    fn domain(&self) -> Domain {
        Domain { angle: self.max_angle, radius: radius(self.max_angle), folds: false }
    }

    fn project(&self, domain: &Domain, direction: [f64; 3]) -> Option<[f64; 2]> {
        radial::project(direction, domain.angle, radius)
    }

    fn unproject(&self, domain: &Domain, point: [f64; 2]) -> Option<[f64; 3]> {
        radial::unproject(point, domain.angle, |radius| (radius <= 1.0).then(|| radius.asin()))
    }
}

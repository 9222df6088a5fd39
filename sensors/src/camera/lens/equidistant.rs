//! The equidistant fisheye: r = f theta.

use super::{CameraError, Domain, LensModel, angle_up_to, radial};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// The equidistant fisheye: r = f theta.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Equidistant {
    /// Nothing is seen farther from the optical axis than this angle \[rad\]: above 0, at most pi.
    pub max_angle: f64,
}

impl Default for Equidistant {
    /// All around.
    fn default() -> Self {
        Self { max_angle: PI }
    }
}

/// Radius in the normalised picture of an angle with the optical axis \[rad\].
fn radius(angle: f64) -> f64 {
    angle
}

impl LensModel for Equidistant {
    const NAME: &'static str = "equidistant";
    const ALIASES: &'static [&'static str] = &["fisheye_equidistant", "fisheyeEquidistant", "linear"];

    fn max_angle(&self) -> Option<f64> {
        Some(self.max_angle)
    }

    fn validate(&self) -> Result<(), CameraError> {
        angle_up_to(self.max_angle, PI, "above 0, at most pi")
    }

    fn domain(&self) -> Domain {
        Domain { angle: self.max_angle, radius: radius(self.max_angle), folds: false }
    }

    fn project(&self, domain: &Domain, direction: [f64; 3]) -> Option<[f64; 2]> {
        radial::project(direction, domain.angle, radius)
    }

    fn unproject(&self, domain: &Domain, point: [f64; 2]) -> Option<[f64; 3]> {
        radial::unproject(point, domain.angle, Some)
    }
}

//! The equirectangular panorama.

use super::{Domain, LensModel, OpticsError};
use crate::intrinsics::Intrinsics;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The equirectangular panorama: x is the longitude from the optical axis to the right, atan2(X, Z), and y the latitude
/// downward, atan2(Y, hypot(X, Z)) \[rad\]. So fx and fy are pixels per radian; [`intrinsics`](Self::intrinsics)
/// returns those of a full panorama.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Panorama {}

impl Panorama {
    /// Intrinsics of an image of all directions: 2 pi along a row, pi along a column, straight ahead at the center.
    pub fn intrinsics(width: usize, height: usize) -> Intrinsics {
        let (w, h) = (width as f64, height as f64);
        Intrinsics::Pixels { fx: w / TAU, fy: h / PI, cx: 0.5 * w, cy: 0.5 * h }
    }
}

impl LensModel for Panorama {
    const NAME: &'static str = "panorama";
    const ALIASES: &'static [&'static str] = &["equirectangular", "omnidirectional", "spherical"];
    const HAS_AXIS: bool = false;

    fn max_angle(&self) -> Option<f64> {
        None
    }

    fn validate(&self) -> Result<(), OpticsError> {
        Ok(())
    }

    /// Returns the domain of all directions: angles up to pi.
    fn domain(&self) -> Domain {
        Domain::new(PI, PI, false)
    }

    fn project(&self, _: &Domain, [x, y, z]: [f64; 3]) -> Option<[f64; 2]> {
        let across = x.hypot(z);
        (across.hypot(y) > 0.0).then(|| [x.atan2(z), y.atan2(across)])
    }

    fn unproject(&self, _: &Domain, [longitude, latitude]: [f64; 2]) -> Option<[f64; 3]> {
        if !(longitude.abs() <= PI && latitude.abs() <= FRAC_PI_2) {
            return None;
        }
        let ((sx, cx), (sy, cy)) = (longitude.sin_cos(), latitude.sin_cos());
        Some([sx * cy, sy, cx * cy])
    }
}

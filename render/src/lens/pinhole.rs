//! The pinhole: straight lines stay straight.

use super::{Domain, LensModel, OpticsError};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

/// The pinhole, without distortion: (x, y) = (X / Z, Y / Z).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pinhole {}

impl LensModel for Pinhole {
    const NAME: &'static str = "pinhole";
    const ALIASES: &'static [&'static str] = &["perspective", "none"];
    const FORWARD: bool = true;

    fn is_pinhole(&self) -> bool {
        true
    }

    fn max_angle(&self) -> Option<f64> {
        None
    }

    fn validate(&self) -> Result<(), OpticsError> {
        Ok(())
    }

    fn domain(&self) -> Domain {
        Domain::new(FRAC_PI_2, f64::INFINITY, false)
    }

    fn project(&self, _: &Domain, [x, y, z]: [f64; 3]) -> Option<[f64; 2]> {
        (z > 0.0).then(|| [x / z, y / z])
    }

    fn unproject(&self, _: &Domain, [x, y]: [f64; 2]) -> Option<[f64; 3]> {
        Some([x, y, 1.0])
    }
}

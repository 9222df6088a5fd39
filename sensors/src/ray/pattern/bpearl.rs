//! The hemispherical lidar RS-Bpearl.

use super::{PatternImpl, UnnormalizedRay, check_finite, check_positive};
use crate::ray::RayError;
use serde::{Deserialize, Serialize};

/// Elevations of the beams \[deg\]. Source: Isaac Lab's `BpearlPatternCfg`.
const VERTICAL_DEG: [f64; 32] = [
    89.5, 86.6875, 83.875, 81.0625, 78.25, 75.4375, 72.625, 69.8125, 67.0, 64.1875, 61.375, 58.5625, 55.75, 52.9375,
    50.125, 47.3125, 44.5, 41.6875, 38.875, 36.0625, 33.25, 30.4375, 27.625, 24.8125, 22.0, 19.1875, 16.375, 13.5625,
    10.75, 7.9375, 5.125, 2.3125,
];

/// The hemispherical lidar RS-Bpearl, with its dome along z (on robots it is mounted upside down or tilted: rotate the
/// sensor). There are 32 beams at each azimuth; the beams of an azimuth are consecutive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Bpearl {
    /// Span of azimuths about -x (backward), as in Isaac Lab; the last azimuth is excluded \[deg\].
    pub horizontal_fov_deg: f64,
    /// Angle between neighboring azimuths \[deg\].
    pub horizontal_resolution_deg: f64,
    /// Elevations of the beams \[deg\]: 0 is in the xy plane, 90 is along +z.
    pub vertical_deg: Vec<f64>,
}

impl Default for Bpearl {
    /// A full turn in steps of 10 degrees: 1152 rays.
    fn default() -> Self {
        Self { horizontal_fov_deg: 360.0, horizontal_resolution_deg: 10.0, vertical_deg: VERTICAL_DEG.to_vec() }
    }
}

impl Bpearl {
    /// Returns the number of azimuths from -fov / 2 to below fov / 2.
    fn azimuths(&self) -> f64 {
        (self.horizontal_fov_deg / self.horizontal_resolution_deg - 1e-9).ceil().max(0.0)
    }
}

impl PatternImpl for Bpearl {
    fn count(&self) -> f64 {
        let step = self.horizontal_resolution_deg;
        let valid = step > 0.0 && step.is_finite() && self.horizontal_fov_deg > 0.0;
        if valid { self.azimuths() * self.vertical_deg.len() as f64 } else { f64::NAN }
    }

    fn rays(&self) -> Result<Vec<UnnormalizedRay>, RayError> {
        check_positive("bpearl", "horizontal_resolution_deg", self.horizontal_resolution_deg)?;
        check_positive("bpearl", "horizontal_fov_deg", self.horizontal_fov_deg)?;
        for &angle in &self.vertical_deg {
            check_finite("bpearl", "vertical_deg", angle)?;
        }
        let ray = |azimuth: usize, vertical: f64| {
            let yaw = (-0.5 * self.horizontal_fov_deg + azimuth as f64 * self.horizontal_resolution_deg).to_radians();
            let pitch = (vertical + 90.0).to_radians();
            ([0.0; 3], [-pitch.sin() * yaw.cos(), -pitch.sin() * yaw.sin(), -pitch.cos()])
        };
        Ok((0..self.azimuths() as usize).flat_map(|a| self.vertical_deg.iter().map(move |&v| ray(a, v))).collect())
    }
}

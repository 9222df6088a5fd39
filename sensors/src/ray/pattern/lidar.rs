//! Spinning lidar.

use super::{PatternImpl, UnnormalizedRay, check_finite, check_positive};
use crate::ray::RayError;
use serde::{Deserialize, Serialize};

/// A spinning lidar with channels at equal steps of elevation. Each channel is a ring of rays at equal steps of
/// azimuth. The rays are ordered by channel, and the azimuth changes fastest.
///
/// For a full turn, the last azimuth is excluded, because it equals the first one. Otherwise it is included if it falls
/// on the grid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Lidar {
    /// Number of elevations; a single one is the first of `vertical_fov_deg`.
    pub channels: usize,
    /// Elevations of the first and the last channel, positive above the horizon \[deg\].
    pub vertical_fov_deg: [f64; 2],
    /// First and last azimuth, from x toward y \[deg\].
    pub horizontal_fov_deg: [f64; 2],
    /// Angle between neighboring azimuths \[deg\].
    pub horizontal_resolution_deg: f64,
}

impl Default for Lidar {
    /// 16 channels from -15 to 15 degrees, a ray every 0.4 degrees, all around.
    fn default() -> Self {
        Self {
            channels: 16,
            vertical_fov_deg: [-15.0, 15.0],
            horizontal_fov_deg: [-180.0, 180.0],
            horizontal_resolution_deg: 0.4,
        }
    }
}

impl Lidar {
    /// Returns the number of rays per channel.
    fn azimuths(&self) -> f64 {
        let [first, last] = self.horizontal_fov_deg;
        let steps = (last - first) / self.horizontal_resolution_deg;
        // Decimal degrees are not exact: an almost whole number of steps counts as whole.
        let whole = (steps + 1e-6).floor();
        let is_turn = (last - first - 360.0).abs() < 1e-6;
        let ends_on_grid = (steps - whole).abs() < 1e-6;
        if is_turn && ends_on_grid { whole } else { whole + 1.0 }
    }
}

impl PatternImpl for Lidar {
    fn count(&self) -> f64 {
        let [first, last] = self.horizontal_fov_deg;
        let step = self.horizontal_resolution_deg;
        let valid = step > 0.0 && step.is_finite() && first <= last && last - first < 360.0 + 1e-6;
        if valid { self.channels as f64 * self.azimuths() } else { f64::NAN }
    }

    fn rays(&self) -> Result<Vec<UnnormalizedRay>, RayError> {
        check_positive("lidar", "horizontal_resolution_deg", self.horizontal_resolution_deg)?;
        let [first, last] = self.horizontal_fov_deg;
        check_finite("lidar", "horizontal_fov_deg", first)?;
        check_finite("lidar", "horizontal_fov_deg", last)?;
        if !(first <= last && last - first < 360.0 + 1e-6) {
            let (what, allowed) = ("the span of horizontal_fov_deg", "between 0 and 360 degrees");
            return Err(RayError::Number { what, owner: "lidar", value: last - first, allowed });
        }
        let [low, high] = self.vertical_fov_deg;
        for value in [low, high] {
            if !(-90.0..=90.0).contains(&value) {
                let (what, allowed) = ("vertical_fov_deg", "between -90 and 90 degrees");
                return Err(RayError::Number { what, owner: "lidar", value, allowed });
            }
        }
        let azimuths = self.azimuths() as usize;
        let ray = |channel: usize, azimuth: usize| {
            let part = if self.channels > 1 { channel as f64 / (self.channels - 1) as f64 } else { 0.0 };
            let v = (low + part * (high - low)).to_radians();
            let h = (first + azimuth as f64 * self.horizontal_resolution_deg).to_radians();
            ([0.0; 3], [v.cos() * h.cos(), v.cos() * h.sin(), v.sin()])
        };
        Ok((0..self.channels).flat_map(|c| (0..azimuths).map(move |a| ray(c, a))).collect())
    }
}

//! Parallel rays over a rectangle.

use super::{PatternImpl, UnnormalizedRay, check_finite, check_positive};
use crate::ray::RayError;
use serde::{Deserialize, Serialize};

/// Order of the rays of a grid: the axis that changes fastest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum GridOrder {
    /// x changes fastest: all points of the smallest y come first. Isaac's `"xy"`.
    #[default]
    Xy,
    /// y changes fastest. Isaac's `"yx"`.
    Yx,
}

/// Parallel rays over a rectangle in the xy plane around the sensor, as in height scanners.
///
/// Along an axis of length L there are ceil((L + 1e-9) / resolution) rays, the first one at -L / 2, as in Isaac Lab. If
/// the length is not a multiple of the resolution, the rays are off center, unless [`centered`](Self::centered).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Grid {
    /// Distance between neighboring rays \[m\].
    pub resolution: f64,
    /// Lengths along x and y \[m\].
    pub size: [f64; 2],
    /// Direction of the rays in the axes of the sensor, of any length except zero.
    pub direction: [f64; 3],
    /// Order of the rays.
    pub order: GridOrder,
    /// If true, the rays are centered at the sensor, even if a length is not a multiple of the resolution.
    pub centered: bool,
}

impl Default for Grid {
    /// The height scanner of Isaac's locomotion tasks: 17 by 11 rays, 0.1 m apart, straight down.
    fn default() -> Self {
        Self { resolution: 0.1, size: [1.6, 1.0], direction: [0.0, 0.0, -1.0], order: GridOrder::Xy, centered: false }
    }
}

impl Grid {
    /// Number of rays along x and y.
    pub fn shape(&self) -> [usize; 2] {
        self.counts().map(|n| n as usize)
    }

    fn counts(&self) -> [f64; 2] {
        self.size.map(|length| ((length + 1e-9) / self.resolution).ceil())
    }
}

impl PatternImpl for Grid {
    fn count(&self) -> f64 {
        let step = self.resolution;
        let valid = step > 0.0 && step.is_finite() && self.size.iter().all(|&l| l >= 0.0);
        if valid { self.counts()[0] * self.counts()[1] } else { f64::NAN }
    }

    fn rays(&self) -> Result<Vec<UnnormalizedRay>, RayError> {
        check_positive("grid", "resolution", self.resolution)?;
        for (what, length) in ["size along x", "size along y"].into_iter().zip(self.size) {
            check_finite("grid", what, length)?;
            if length < 0.0 {
                return Err(RayError::Number { what, owner: "grid", value: length, allowed: "0 or positive" });
            }
        }
        let counts = self.shape();
        let at = |axis: usize, k: usize| {
            let length = match self.centered {
                true => (counts[axis] - 1) as f64 * self.resolution,
                false => self.size[axis],
            };
            -0.5 * length + k as f64 * self.resolution
        };
        let [nx, ny] = counts;
        let point = |k: usize| match self.order {
            GridOrder::Xy => [at(0, k % nx), at(1, k / nx), 0.0],
            GridOrder::Yx => [at(0, k / ny), at(1, k % ny), 0.0],
        };
        Ok((0..nx * ny).map(|k| (point(k), self.direction)).collect())
    }
}

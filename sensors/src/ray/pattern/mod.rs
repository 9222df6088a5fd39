//! Ray patterns of ray casters: one pattern per file, all of them listed in [`RayPattern`].
//!
//! Rays are in the frame of the sensor (x forward, y left, z up); all directions have length 1.

mod pattern_impl;

pub use grid::GridOrder;
use pattern_impl::{PatternImpl, UnnormalizedRay};

use super::RayError;
use kinetoscope_scene::Ray;
use kinetoscope_scene::vector::normalize;
use serde::{Deserialize, Serialize};

/// Declares the patterns: one module and one type each.
macro_rules! patterns {
    ($($(#[$doc:meta])* $module:ident :: $Name:ident,)*) => {
        $(mod $module; pub use $module::$Name;)*

        /// Pattern of the rays of a ray caster.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        #[non_exhaustive]
        pub enum RayPattern {
            $($(#[$doc])* $Name($Name),)*
        }

        impl RayPattern {
            /// Name of the pattern.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$Name(_) => stringify!($module),)* }
            }

            fn inner(&self) -> &dyn PatternImpl {
                match self { $(Self::$Name(pattern) => pattern,)* }
            }
        }

        $(impl From<$Name> for RayPattern {
            fn from(pattern: $Name) -> Self {
                Self::$Name(pattern)
            }
        })*
    };
}

patterns! {
    /// Parallel rays over a rectangle.
    grid::Grid,
    /// Spinning lidar: rings of rays.
    lidar::Lidar,
    /// The hemispherical lidar RS-Bpearl.
    bpearl::Bpearl,
    /// One ray through every pixel of a pinhole camera.
    pinhole::Pinhole,
    /// User-defined rays.
    custom::Custom,
}

impl RayPattern {
    /// Maximum number of rays of a pattern.
    pub const MAX_RAYS: usize = 1 << 24;

    /// Returns the number of rays without generating them; 0 for invalid parameters.
    pub(crate) fn count(&self) -> usize {
        // NaN converts to 0.
        self.inner().count() as usize
    }

    /// Generates the rays in the frame of the sensor, with unit directions.
    ///
    /// # Errors
    ///
    /// [`RayError`] for invalid parameters, no rays, or more than [`MAX_RAYS`](Self::MAX_RAYS).
    pub fn rays(&self) -> Result<Vec<Ray>, RayError> {
        let (pattern, inner) = (self.name(), self.inner());
        let count = inner.count();
        let possible = |count: f64| (1.0..=Self::MAX_RAYS as f64).contains(&count);
        // NaN stands for invalid parameters, which the pattern reports below.
        if !possible(count) && !count.is_nan() {
            return Err(RayError::Count { pattern, count, limit: Self::MAX_RAYS });
        }
        let rays = inner.rays()?;
        if !possible(rays.len() as f64) {
            return Err(RayError::Count { pattern, count: rays.len() as f64, limit: Self::MAX_RAYS });
        }
        let ray = |(index, (start, direction)): (usize, UnnormalizedRay)| {
            let finite = start.iter().chain(&direction).all(|x| x.is_finite());
            normalize(direction)
                .filter(|_| finite)
                .map(|direction| Ray { origin: start, direction })
                .ok_or(RayError::Ray { pattern, ray: index, start, direction })
        };
        rays.into_iter().enumerate().map(ray).collect()
    }
}

/// Checks that a number is positive and finite, and returns it.
fn check_positive(owner: &'static str, what: &'static str, value: f64) -> Result<f64, RayError> {
    if value > 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(RayError::Number { what, owner, value, allowed: "positive and finite" })
}

/// Checks that a number is finite, and returns it.
fn check_finite(owner: &'static str, what: &'static str, value: f64) -> Result<f64, RayError> {
    if value.is_finite() { Ok(value) } else { Err(RayError::Number { what, owner, value, allowed: "finite" }) }
}

#[cfg(test)]
mod tests;

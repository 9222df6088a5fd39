//! How the rays of a ray caster are laid out: one pattern per file, all of them in one list.
//!
//! Rays are in the frame of the sensor (x forward, y left, z up); all directions have length 1.

mod pattern_impl;

pub use grid::GridOrder;
use pattern_impl::{Line, PatternImpl};

use super::RayError;
use kinetoscope_scene::Ray;
use kinetoscope_scene::vector::unit;
use serde::{Deserialize, Serialize};

/// Declares the patterns: a module with a type of its own each.
macro_rules! patterns {
    ($($(#[$doc:meta])* $module:ident :: $Name:ident,)*) => {
        $(mod $module; pub use $module::$Name;)*

        /// How the rays are laid out.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        #[non_exhaustive]
        pub enum RayPattern {
            $($(#[$doc])* $Name($Name),)*
        }

        impl RayPattern {
            /// The name of the kind.
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
    /// A spinning laser: rings of rays.
    lidar::Lidar,
    /// The hemispherical laser RS-Bpearl.
    bpearl::Bpearl,
    /// A ray through every pixel of a camera.
    pinhole::Pinhole,
    /// Any rays.
    custom::Custom,
}

impl RayPattern {
    /// The most rays of a pattern.
    pub const MAX_RAYS: usize = 1 << 24;

    /// How many rays there are, without making them; 0 where the numbers make no sense.
    pub(crate) fn count(&self) -> usize {
        // A number that is none becomes 0.
        self.inner().count() as usize
    }

    /// The rays, directions of length 1.
    ///
    /// # Errors
    ///
    /// [`RayError`]: numbers that make no sense, no rays or more than [`MAX_RAYS`](Self::MAX_RAYS).
    pub fn rays(&self) -> Result<Vec<Ray>, RayError> {
        let (pattern, inner) = (self.name(), self.inner());
        let count = inner.count();
        let possible = |count: f64| (1.0..=Self::MAX_RAYS as f64).contains(&count);
        // A number that is none is named by the pattern itself.
        if !possible(count) && !count.is_nan() {
            return Err(RayError::Count { pattern, count, limit: Self::MAX_RAYS });
        }
        let rays = inner.rays()?;
        if !possible(rays.len() as f64) {
            return Err(RayError::Count { pattern, count: rays.len() as f64, limit: Self::MAX_RAYS });
        }
        let ray =
            |(index, (start, direction)): (usize, Line)| {
                let finite = start.iter().chain(&direction).all(|x| x.is_finite());
                unit(direction)
                    .filter(|_| finite)
                    .map(|direction| Ray { origin: start, direction })
                    .ok_or(RayError::Ray { pattern, ray: index, start, direction })
            };
        rays.into_iter().enumerate().map(ray).collect()
    }
}

/// A number that must be positive.
fn positive(of: &'static str, what: &'static str, value: f64) -> Result<f64, RayError> {
    if value > 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(RayError::Number { what, of, value, allowed: "positive and finite" })
}

/// A number that must be one.
fn finite(of: &'static str, what: &'static str, value: f64) -> Result<f64, RayError> {
    if value.is_finite() { Ok(value) } else { Err(RayError::Number { what, of, value, allowed: "finite" }) }
}

#[cfg(test)]
mod tests;

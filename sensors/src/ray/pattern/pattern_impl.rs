//! Trait of ray patterns.

use crate::ray::RayError;

/// Origin \[m\] and direction of a ray in the frame of the sensor; the direction has any length.
pub(super) type UnnormalizedRay = ([f64; 3], [f64; 3]);

/// Operations of a ray pattern.
pub(super) trait PatternImpl {
    /// Returns the number of rays before they are generated; NaN for parameters that `rays` rejects.
    fn count(&self) -> f64;

    /// Generates the rays, or returns an error for invalid parameters.
    fn rays(&self) -> Result<Vec<UnnormalizedRay>, RayError>;
}

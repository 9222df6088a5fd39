//! The trait of patterns of rays.

use crate::ray::RayError;

/// A start, and a direction of any length.
pub(super) type Line = ([f64; 3], [f64; 3]);

/// The operations of a pattern.
pub(super) trait PatternImpl {
    /// How many rays there are, before they are made; the numbers were not checked yet.
    fn count(&self) -> f64;

    /// The rays; called where the count is possible.
    fn rays(&self) -> Result<Vec<Line>, RayError>;
}

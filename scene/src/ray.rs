//! [`Ray`]: a half-line.

use crate::PoseF64;
use crate::vector::add_scaled;

/// A half-line with a unit direction. Origin and direction are in the same frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Origin \[m\].
    pub origin: [f64; 3],
    /// Direction, a unit vector.
    pub direction: [f64; 3],
}

impl Ray {
    /// Point at a distance along the ray, in the frame of the ray \[m\].
    #[inline]
    pub fn at(&self, distance: f64) -> [f64; 3] {
        add_scaled(self.origin, distance, self.direction)
    }

    /// Returns the ray in the frame that `pose` maps from.
    #[inline(always)]
    pub fn inverse_transformed_by(&self, pose: &PoseF64) -> Self {
        Self { origin: pose.apply_inverse(self.origin), direction: pose.rotate_inverse(self.direction) }
    }

    /// Returns the ray in the frame that `pose` maps to.
    pub fn transformed_by(&self, pose: &PoseF64) -> Self {
        Self { origin: pose.apply(self.origin), direction: pose.rotate(self.direction) }
    }

    /// True if all numbers are finite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.origin.iter().chain(&self.direction).all(|x| x.is_finite())
    }
}

//! [`AreaSampling`]: random points of a surface.

use crate::vector::V3;

/// A point of a surface, in the frame of the shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position \[m\].
    pub position: V3,
    /// Unit normal, out of the body.
    pub normal: V3,
    /// Index of the triangle; 0 for a closed form.
    pub triangle: u32,
}

/// Sampling of points of a surface, uniformly by area.
pub trait AreaSampling {
    /// Area of the surface \[m²\].
    fn area(&self) -> f64;

    /// A point of the surface by three uniform numbers in 0..1: one for the side, two for the place on it.
    fn sample(&self, side: f64, at: [f64; 2]) -> SurfacePoint;

    /// A point that may be visible from `from`, and the density of its direction \[1/sr\] if it was not sampled by area.
    /// `None` if the numbers give no point.
    fn sample_from(&self, _from: V3, side: f64, at: [f64; 2]) -> Option<(SurfacePoint, Option<f64>)> {
        Some((self.sample(side, at), None))
    }

    /// Density of directions from `from` \[1/sr\], if [`sample_from`](Self::sample_from) does not sample by area there.
    fn density_from(&self, _from: V3) -> Option<f64> {
        None
    }
}

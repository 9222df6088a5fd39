//! [`AreaSampling`]: random points on a surface.

use crate::vector::V3;

/// A point on a surface, in the frame of the shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position \[m\].
    pub position: V3,
    /// Unit normal, pointing outward; for a triangle, toward the side from which its corners are counter-clockwise.
    pub normal: V3,
    /// Index of the triangle; 0 for a shape without triangles.
    pub triangle: u32,
}

/// Sampling of points on a surface, uniformly by area.
pub trait AreaSampling {
    /// Area of the surface \[m²\].
    fn area(&self) -> f64;

    /// Returns a surface point for three uniform numbers in 0..1: `side` selects a face or triangle, `at` a point on
    /// it.
    fn sample(&self, side: f64, at: [f64; 2]) -> SurfacePoint;

    /// Returns a point that may be visible from `from`, in the frame of the shape, and the pdf of its direction
    /// \[1/sr\]. The pdf is `None` if the point was sampled by area as in [`sample`](Self::sample). Returns `None` if
    /// the numbers give no point.
    fn sample_from(&self, _from: V3, side: f64, at: [f64; 2]) -> Option<(SurfacePoint, Option<f64>)> {
        Some((self.sample(side, at), None))
    }

    /// Pdf of the directions of [`sample_from`](Self::sample_from) \[1/sr\]; `None` if it samples by area there.
    fn pdf_from(&self, _from: V3) -> Option<f64> {
        None
    }
}

//! [`Triangulated`]: the geometry of shapes that are made of triangles.

use super::area_sampling::{AreaSampling, SurfacePoint};
use super::render_mesh::RenderMesh;
use crate::vector::{V3, add_scaled, cross, dot, normalize, scale, sub, to_f64};
use std::sync::Arc;

/// A shape made of triangles.
pub trait Triangulated {
    /// Prepared triangles.
    fn mesh(&self) -> &Arc<RenderMesh>;

    /// Sizes \[m\] that must be positive and finite.
    fn sizes(&self) -> Vec<f32>;

    /// Area sampling of the surface, for shapes that emit light.
    ///
    /// With `None`, only paths that hit the shape by chance find its light, which is unbiased but noisy.
    fn area_sampling(&self) -> Option<TriangleSampling>;
}

/// Area sampling of triangles.
#[derive(Clone, Debug)]
pub struct TriangleSampling {
    mesh: Arc<RenderMesh>,
    /// Cumulative areas of the triangles \[m²\].
    sums: Vec<f64>,
}

impl TriangleSampling {
    /// Computes the cumulative areas of a mesh.
    pub fn new(mesh: &Arc<RenderMesh>) -> Self {
        let areas = (0..mesh.triangles().len()).scan(0.0, |sum, k| {
            let [a, b, c] = corners(mesh, k);
            let across = cross(sub(b, a), sub(c, a));
            *sum += 0.5 * dot(across, across).sqrt();
            Some(*sum)
        });
        Self { mesh: Arc::clone(mesh), sums: areas.collect() }
    }

    /// Triangles of the shape, prepared for rendering.
    pub fn mesh(&self) -> &Arc<RenderMesh> {
        &self.mesh
    }

    /// Heap memory \[bytes\], without the shared mesh.
    pub fn bytes(&self) -> usize {
        self.sums.capacity() * size_of::<f64>()
    }
}

impl AreaSampling for TriangleSampling {
    fn area(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    fn sample(&self, side: f64, [a, b]: [f64; 2]) -> SurfacePoint {
        let place = side * self.area();
        let k = self.sums.partition_point(|&sum| sum <= place).min(self.sums.len().saturating_sub(1));
        let [p, q, r] = corners(&self.mesh, k);
        // Source: Turk, Generating random points in triangles, Graphics Gems, 1990.
        let root = a.sqrt();
        let position = add_scaled(add_scaled(scale(p, 1.0 - root), root * (1.0 - b), q), root * b, r);
        let normal = normalize(cross(sub(q, p), sub(r, p))).unwrap_or([0.0, 0.0, 1.0]);
        SurfacePoint { position, normal, triangle: k as u32 }
    }
}

fn corners(mesh: &RenderMesh, triangle: usize) -> [V3; 3] {
    mesh.triangles()[triangle].map(|i| to_f64(mesh.positions()[i as usize]))
}

//! A stretched ball.

use super::sphere::Sphere;
use super::{ShapeImpl, norm};
use crate::mesh::TriMesh;

/// A ball stretched along its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Half lengths along x, y and z \[m\].
    pub radii: [f32; 3],
}

impl ShapeImpl for Ellipsoid {
    fn tessellate(&self, segments: usize) -> TriMesh {
        Sphere { radius: 1.0 }.tessellate(segments).scaled(self.radii.map(f64::from))
    }

    fn aabb(&self) -> [[f32; 3]; 2] {
        [self.radii.map(|r| -r), self.radii]
    }

    fn support(&self, direction: [f64; 3]) -> f64 {
        norm([0, 1, 2].map(|k| f64::from(self.radii[k]) * direction[k]))
    }

    fn sizes(&self) -> Vec<f32> {
        self.radii.to_vec()
    }
}

//! A ball.

use super::grid::{arc, revolve};
use super::{ShapeImpl, norm};
use crate::mesh::TriMesh;

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Radius \[m\].
    pub radius: f32,
}

impl ShapeImpl for Sphere {
    fn tessellate(&self, segments: usize) -> TriMesh {
        let quarter = std::f64::consts::FRAC_PI_2;
        revolve(&arc(self.radius.into(), 0.0, -quarter, quarter, segments.div_ceil(2)), segments)
    }

    fn aabb(&self) -> [[f32; 3]; 2] {
        [[-self.radius; 3], [self.radius; 3]]
    }

    fn support(&self, direction: [f64; 3]) -> f64 {
        f64::from(self.radius) * norm(direction)
    }

    fn sizes(&self) -> Vec<f32> {
        vec![self.radius]
    }
}

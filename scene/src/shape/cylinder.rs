//! A cylinder.

use super::ShapeImpl;
use super::grid::revolve;
use crate::mesh::TriMesh;

/// A cylinder along z with flat ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// Radius \[m\].
    pub radius: f32,
    /// Half its length \[m\].
    pub half_length: f32,
}

impl ShapeImpl for Cylinder {
    fn tessellate(&self, segments: usize) -> TriMesh {
        let (r, h) = (f64::from(self.radius), f64::from(self.half_length));
        revolve(&[[0., -h], [r, -h], [r, h], [0., h]], segments)
    }

    fn aabb(&self) -> [[f32; 3]; 2] {
        let (r, h) = (self.radius, self.half_length);
        [[-r, -r, -h], [r, r, h]]
    }

    fn support(&self, direction: [f64; 3]) -> f64 {
        let [x, y, z] = direction;
        f64::from(self.radius) * x.hypot(y) + f64::from(self.half_length) * z.abs()
    }

    fn sizes(&self) -> Vec<f32> {
        vec![self.radius, self.half_length]
    }
}

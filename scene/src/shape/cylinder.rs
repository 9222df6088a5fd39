//! A cylinder.

use super::grid::revolve;
use super::ShapeImpl;
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

    fn sizes(&self) -> Vec<f32> {
        vec![self.radius, self.half_length]
    }
}

//! A cylinder with round ends.

use super::grid::{arc, revolve};
use super::{ShapeImpl, norm};
use crate::mesh::TriMesh;

/// A cylinder along z with half a ball on each end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// Radius \[m\].
    pub radius: f32,
    /// Half the length of the cylindrical part \[m\].
    pub half_length: f32,
}

impl ShapeImpl for Capsule {
    fn tessellate(&self, segments: usize) -> TriMesh {
        let (r, h) = (f64::from(self.radius), f64::from(self.half_length));
        let (quarter, steps) = (std::f64::consts::FRAC_PI_2, segments.div_ceil(4));
        let mut profile = arc(r, -h, -quarter, 0.0, steps);
        profile.extend(arc(r, h, 0.0, quarter, steps));
        revolve(&profile, segments)
    }

    fn aabb(&self) -> [[f32; 3]; 2] {
        let (r, z) = (self.radius, self.radius + self.half_length);
        [[-r, -r, -z], [r, r, z]]
    }

    fn support(&self, direction: [f64; 3]) -> f64 {
        f64::from(self.radius) * norm(direction) + f64::from(self.half_length) * direction[2].abs()
    }

    fn sizes(&self) -> Vec<f32> {
        vec![self.radius, self.half_length]
    }
}

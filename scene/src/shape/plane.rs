//! A plane.

use super::ShapeImpl;
use crate::mesh::TriMesh;

/// The plane z = 0, seen from +z only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Half lengths along x and y \[m\]; 0 means infinite.
    pub half: [f32; 2],
}

impl Plane {
    /// Infinite in both directions.
    pub const INFINITE: Self = Self { half: [0.0, 0.0] };
}

impl ShapeImpl for Plane {
    fn tessellate(&self, _segments: usize) -> TriMesh {
        let [x, y] = self.half.map(|h| if h == 0.0 { 100.0 } else { h });
        let positions = vec![[-x, -y, 0.], [x, -y, 0.], [x, y, 0.], [-x, y, 0.]];
        TriMesh::from_triangles(positions, vec![[0, 1, 2], [0, 2, 3]])
    }

    fn aabb(&self) -> [[f32; 3]; 2] {
        let [x, y] = self.half.map(|h| if h == 0.0 { f32::INFINITY } else { h });
        [[-x, -y, 0.], [x, y, 0.]]
    }

    fn support(&self, direction: [f64; 3]) -> f64 {
        let along = |k: usize| match (f64::from(self.half[k]), direction[k].abs()) {
            (_, 0.0) => 0.0,
            (0.0, _) => f64::INFINITY,
            (half, along) => half * along,
        };
        along(0) + along(1)
    }

    fn sizes(&self) -> Vec<f32> {
        self.half.iter().copied().filter(|&h| h != 0.0).collect()
    }
}

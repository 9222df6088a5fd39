//! A box.

use super::ShapeImpl;
use crate::mesh::TriMesh;

/// A box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Box {
    /// Half lengths along x, y and z \[m\].
    pub half: [f32; 3],
}

impl ShapeImpl for Box {
    fn tessellate(&self, _segments: usize) -> TriMesh {
        let sign = |corner: usize, axis: usize| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
        let positions = (0..8).map(|c| [0, 1, 2].map(|k| sign(c, k) * self.half[k])).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|q: &[u32; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
        TriMesh::from_triangles(positions, triangles)
    }

    fn aabb(&self) -> [[f32; 3]; 2] {
        [self.half.map(|h| -h), self.half]
    }

    fn support(&self, direction: [f64; 3]) -> f64 {
        (0..3).map(|k| f64::from(self.half[k]) * direction[k].abs()).sum()
    }

    fn sizes(&self) -> Vec<f32> {
        self.half.to_vec()
    }
}

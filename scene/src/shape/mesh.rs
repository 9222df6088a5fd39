//! Triangles as a shape.

use super::{RenderMesh, ShapeImpl, largest};
use crate::mesh::TriMesh;
use std::sync::Arc;

/// Triangles, prepared for drawing once and shared.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// The prepared triangles.
    pub mesh: Arc<RenderMesh>,
}

impl ShapeImpl for Mesh {
    fn tessellate(&self, _segments: usize) -> TriMesh {
        self.mesh.to_tri_mesh()
    }

    fn aabb(&self) -> [[f32; 3]; 2] {
        self.mesh.bounds()
    }

    fn support(&self, direction: [f64; 3]) -> f64 {
        largest(self.mesh.positions(), direction)
    }

    fn sizes(&self) -> Vec<f32> {
        Vec::new()
    }
}

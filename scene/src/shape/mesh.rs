//! Triangle meshes as shapes.

use super::render_mesh::RenderMesh;
use super::triangulated::{TriangleSampling, Triangulated};
use std::sync::Arc;

/// A triangle mesh, prepared for rendering once and shared.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Prepared triangles.
    pub mesh: Arc<RenderMesh>,
}

impl Triangulated for Mesh {
    fn mesh(&self) -> &Arc<RenderMesh> {
        &self.mesh
    }

    fn sizes(&self) -> Vec<f32> {
        Vec::new()
    }

    fn area_sampling(&self) -> Option<TriangleSampling> {
        Some(TriangleSampling::new(&self.mesh))
    }
}

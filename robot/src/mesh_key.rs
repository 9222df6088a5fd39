//! Keys of mesh files in caches.

use nalgebra::Vector3;
use std::path::{Path, PathBuf};

/// Key of a mesh file at a scale.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct MeshKey {
    /// Path of the mesh file.
    pub path: PathBuf,
    /// Bit patterns of the scale factors, so that keys are comparable and ordered.
    scale: [u64; 3],
}

impl MeshKey {
    /// Creates the key of `path` at `scale`.
    pub fn new(path: &Path, scale: &Vector3<f64>) -> Self {
        Self { path: path.to_path_buf(), scale: [scale.x.to_bits(), scale.y.to_bits(), scale.z.to_bits()] }
    }

    /// Scale factors along x, y and z of the mesh file.
    pub fn scale(&self) -> [f64; 3] {
        self.scale.map(f64::from_bits)
    }
}

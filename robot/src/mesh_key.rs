//! Keys of mesh files.

use nalgebra::Vector3;
use std::path::{Path, PathBuf};

/// A mesh file at a scale.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct MeshKey {
    /// The file.
    pub path: PathBuf,
    /// Bits of the scale.
    scale: [u64; 3],
}

impl MeshKey {
    /// The key of `path` at `scale`.
    pub fn new(path: &Path, scale: &Vector3<f64>) -> Self {
        Self { path: path.to_path_buf(), scale: [scale.x.to_bits(), scale.y.to_bits(), scale.z.to_bits()] }
    }

    /// The scale.
    pub fn scale(&self) -> [f64; 3] {
        self.scale.map(f64::from_bits)
    }
}

//! Point clouds as PLY files, which MeshLab, CloudCompare and Open3D read.

use super::Result;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Writes points \[m\] with their colours, binary, little-endian.
///
/// # Errors
/// The file cannot be written.
pub(crate) fn write_ply(path: &Path, points: &[([f32; 3], [u8; 3])]) -> Result {
    let write = || -> std::io::Result<()> {
        let mut file = BufWriter::new(File::create(path)?);
        writeln!(file, "ply\nformat binary_little_endian 1.0\nelement vertex {}", points.len())?;
        for axis in ["x", "y", "z"] {
            writeln!(file, "property float {axis}")?;
        }
        for color in ["red", "green", "blue"] {
            writeln!(file, "property uchar {color}")?;
        }
        writeln!(file, "end_header")?;
        for (point, color) in points {
            for x in point {
                file.write_all(&x.to_le_bytes())?;
            }
            file.write_all(color)?;
        }
        file.flush()
    };
    write().map_err(|e| format!("{}: {e}", path.display()).into())
}

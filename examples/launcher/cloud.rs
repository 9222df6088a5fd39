//! Point clouds as PLY files, which MeshLab, CloudCompare and Open3D read.

use super::Result;
use kinetoscope::ndarray::Array3;
use kinetoscope::scene::pose::from_row;
use nalgebra::Point3;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Writes points \[m\] with their RGB colors as binary little-endian PLY.
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

/// The largest reprojection error of a camera's point cloud: the distance of a point's projection from the center of
/// its pixel \[pixels\].
///
/// `map` has shape (H, W, 3), world frame \[m\]; `intrinsics` is (fx, fy, cx, cy) \[pixels\]; `pose` is the camera's
/// pose row in the ROS convention.
pub(crate) fn reprojection_error(map: &Array3<f32>, [fx, fy, cx, cy]: [f64; 4], pose: &[f64; 7]) -> f64 {
    let camera_from_world = from_row(pose).inverse();
    let mut worst = 0.0_f64;
    for (v, line) in map.outer_iter().enumerate() {
        for (u, point) in line.outer_iter().enumerate().filter(|(_, point)| point[0].is_finite()) {
            let at = camera_from_world * Point3::new(point[0], point[1], point[2]).cast::<f64>();
            let apart = [fx * at.x / at.z + cx - (u as f64 + 0.5), fy * at.y / at.z + cy - (v as f64 + 0.5)];
            worst = worst.max(apart[0].abs()).max(apart[1].abs());
        }
    }
    worst
}

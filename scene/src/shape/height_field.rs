//! Height fields.

use super::render_mesh::RenderMesh;
use super::triangulated::{TriangleSampling, Triangulated};
use crate::mesh::TriMesh;
use std::sync::Arc;

/// A height field: heights over a regular grid, with walls and a floor below.
#[derive(Clone, Debug)]
pub struct HeightField {
    size: [f64; 4],
    rows: usize,
    columns: usize,
    elevation: Arc<[f32]>,
    mesh: Arc<RenderMesh>,
}

impl HeightField {
    /// Creates a height field with MuJoCo's parameters.
    ///
    /// `size` is the half length along x, half length along y, height of elevation 1, and depth of the floor below zero
    /// \[m\]. `elevation` holds `rows` rows (along y, from -y) of `columns` numbers (along x, from -x), usually in
    /// 0..=1.
    ///
    /// Returns `None` for fewer than two rows or columns, another number of elevations than grid points, and an
    /// elevation that is negative or not finite. Sizes are not checked.
    pub fn new(size: [f64; 4], rows: usize, columns: usize, elevation: &[f32]) -> Option<Self> {
        let elevations = elevation.iter().all(|e| e.is_finite() && *e >= 0.0);
        if rows < 2 || columns < 2 || elevation.len() != rows.checked_mul(columns)? || !elevations {
            return None;
        }
        let [x, y, top, bottom] = size.map(|x| x as f32);
        let at = |r: usize, c: usize, z: f32| {
            [x * (2.0 * c as f32 / (columns - 1) as f32 - 1.0), y * (2.0 * r as f32 / (rows - 1) as f32 - 1.0), z]
        };
        let index = |r: usize, c: usize| (r * columns + c) as u32;
        let around = 2 * (rows + columns - 2);
        let mut positions = Vec::with_capacity(elevation.len() + around);
        for r in 0..rows {
            positions.extend((0..columns).map(|c| at(r, c, top * elevation[r * columns + c])));
        }
        let mut triangles = Vec::with_capacity(2 * (rows - 1) * (columns - 1) + 3 * around);
        for r in 0..rows - 1 {
            for c in 0..columns - 1 {
                let (a, b, d, e) = (index(r, c), index(r, c + 1), index(r + 1, c), index(r + 1, c + 1));
                triangles.extend([[a, b, e], [a, e, d]]);
            }
        }
        let mut rim: Vec<(usize, usize)> = (0..columns - 1).map(|c| (0, c)).collect();
        rim.extend((0..rows - 1).map(|r| (r, columns - 1)));
        rim.extend((1..columns).rev().map(|c| (rows - 1, c)));
        rim.extend((1..rows).rev().map(|r| (r, 0)));
        let first = positions.len() as u32;
        positions.extend(rim.iter().map(|&(r, c)| at(r, c, -bottom)));
        let count = rim.len();
        for k in 0..count {
            let next = (k + 1) % count;
            let (a, b) = (index(rim[k].0, rim[k].1), index(rim[next].0, rim[next].1));
            let (c, d) = (first + k as u32, first + next as u32);
            triangles.extend([[c, d, b], [c, b, a]]);
            if k >= 1 && k + 1 < count {
                triangles.push([first, d, c]);
            }
        }
        let mesh = TriMesh::from_triangles(positions, triangles);
        // With a floor, the rim is below all heights, so the surface is closed.
        let prepare = if bottom > 0.0 { RenderMesh::from_closed } else { RenderMesh::new };
        let mesh = Arc::new(prepare(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE));
        Some(Self { size, rows, columns, elevation: elevation.into(), mesh })
    }

    /// Half length along x, half length along y, height of elevation 1, depth of the floor below zero \[m\].
    pub fn size(&self) -> [f64; 4] {
        self.size
    }

    /// Number of rows of the grid, along y.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns of the grid, along x.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Elevations as given to [`new`](Self::new), row by row from -y.
    pub fn elevation(&self) -> &Arc<[f32]> {
        &self.elevation
    }

    /// Triangles, prepared for rendering.
    pub fn mesh(&self) -> &Arc<RenderMesh> {
        &self.mesh
    }
}

impl Triangulated for HeightField {
    fn mesh(&self) -> &Arc<RenderMesh> {
        &self.mesh
    }

    fn sizes(&self) -> Vec<f32> {
        self.size.iter().map(|&x| x as f32).collect()
    }

    fn area_sampling(&self) -> Option<TriangleSampling> {
        None
    }
}

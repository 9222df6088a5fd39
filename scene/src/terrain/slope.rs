//! An inclined plane.

use super::{TerrainError, finite, grid_size};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// An inclined plane: height 0 at the center, rising along x and y.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Slope {
    /// Lengths along x and y \[m\].
    pub size: [f64; 2],
    /// Distance of neighboring points \[m\].
    pub cell: f64,
    /// Rise per meter along x and y: the tangent of the angle.
    pub gradient: [f64; 2],
}

impl Default for Slope {
    /// 8 m by 8 m, rising by 0.2 m per meter along x.
    fn default() -> Self {
        Self { size: [8.0, 8.0], cell: 0.5, gradient: [0.2, 0.0] }
    }
}

impl Slope {
    /// Heights \[m\], rows along y, columns along x.
    ///
    /// # Errors
    /// A horizontal length is not positive, a number is not finite, a side is not a whole number of cells, or there are
    /// too many points.
    pub fn heights(&self) -> Result<Array2<f64>, TerrainError> {
        const NAME: &str = "slope";
        let [columns, rows] = grid_size(NAME, self.size, self.cell)?;
        let [gx, gy] = self.gradient;
        finite(NAME, "gradient", gx)?;
        finite(NAME, "gradient", gy)?;
        let at = |k: usize, n: usize, length: f64| length * (k as f64 / (n - 1) as f64 - 0.5);
        Ok(Array2::from_shape_fn((rows, columns), |(r, c)| {
            gx * at(c, columns, self.size[0]) + gy * at(r, rows, self.size[1])
        }))
    }
}

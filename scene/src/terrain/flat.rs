//! Flat ground.

use super::{TerrainError, grid_size};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// Flat ground at height 0, as a height field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Flat {
    /// Lengths along x and y \[m\].
    pub size: [f64; 2],
    /// Distance of neighboring points \[m\].
    pub cell: f64,
}

impl Default for Flat {
    /// 8 m by 8 m, points every 1 m.
    fn default() -> Self {
        Self { size: [8.0, 8.0], cell: 1.0 }
    }
}

impl Flat {
    /// Heights \[m\], rows along y, columns along x.
    ///
    /// # Errors
    /// A number is not positive or not finite, a side is not a whole number of cells, or there are too many points.
    pub fn heights(&self) -> Result<Array2<f64>, TerrainError> {
        let [columns, rows] = grid_size("flat ground", self.size, self.cell)?;
        Ok(Array2::zeros((rows, columns)))
    }
}

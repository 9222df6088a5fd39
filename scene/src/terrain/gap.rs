//! A trench around a platform.

use super::{TerrainError, check_platform, finite, from_rim, grid_size, positive};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// A square trench around a platform at the center: the robot on the platform has to step across.
///
/// A height field has no vertical walls, so each wall of the trench is inclined over one cell, inside the trench.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Gap {
    /// Lengths along x and y \[m\].
    pub size: [f64; 2],
    /// Distance of neighboring points \[m\].
    pub cell: f64,
    /// Width of the trench \[m\], rounded to whole cells, of which fewer than 2 are an error.
    pub width: f64,
    /// Depth of the trench \[m\].
    pub depth: f64,
    /// Shorter side of the platform \[m\].
    pub platform: f64,
}

impl Default for Gap {
    /// 8 m by 8 m, a trench of 0.4 m, 1 m deep, around a platform of 2 m.
    fn default() -> Self {
        Self { size: [8.0, 8.0], cell: 0.1, width: 0.4, depth: 1.0, platform: 2.0 }
    }
}

impl Gap {
    /// Heights \[m\], 0 outside the trench; rows along y, columns along x.
    ///
    /// # Errors
    /// A horizontal length is not positive, a number is not finite, a side is not a whole number of cells, there are
    /// too many points, the trench is narrower than two cells, or the platform and the trench do not fit into the
    /// field.
    pub fn heights(&self) -> Result<Array2<f64>, TerrainError> {
        const NAME: &str = "gap";
        let [columns, rows] = grid_size(NAME, self.size, self.cell)?;
        positive(NAME, "width", self.width)?;
        finite(NAME, "depth", self.depth)?;
        let smaller = check_platform(NAME, self.size, self.platform)?;
        let number = |field, value, expected| Err(TerrainError::Number { terrain: NAME, field, value, expected });
        let cells = (self.width / self.cell).round();
        if cells < 2.0 {
            return number("width", self.width, "it must be at least two cells: one for each wall");
        }
        // The inner edge, counted in cells from the rim.
        let inner = (0.5 * (smaller - self.platform) / self.cell).round();
        if inner < cells {
            return number("width", self.width, "the platform and the gap around it must fit into the field");
        }
        Ok(Array2::from_shape_fn((rows, columns), |(r, c)| {
            let distance = (from_rim([r, c], [rows, columns], self.cell) / self.cell).round();
            if inner - cells < distance && distance < inner { -self.depth } else { 0.0 }
        }))
    }
}

//! Stairs around a platform.

use super::{TerrainError, finite, grid_size, positive};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// Stairs from all four sides up (or down) to a platform at the center, which is square if the field is.
///
/// A height field has no vertical walls, so each riser is inclined over one cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PyramidStairs {
    /// Lengths along x and y \[m\].
    pub size: [f64; 2],
    /// Distance of neighboring points \[m\].
    pub cell: f64,
    /// Height of a step \[m\]; negative heights lead down.
    pub step_height: f64,
    /// Depth of a tread, including its riser \[m\].
    pub tread: f64,
    /// Smallest side of the platform \[m\]. The platform is larger if the rest is not a whole number of treads.
    pub platform: f64,
}

impl Default for PyramidStairs {
    /// 8 m by 8 m, steps of 10 cm every 40 cm, up to a platform of 1.6 m.
    fn default() -> Self {
        Self { size: [8.0, 8.0], cell: 0.1, step_height: 0.1, tread: 0.4, platform: 1.6 }
    }
}

impl PyramidStairs {
    /// Heights \[m\], 0 at the rim; rows along y, columns along x.
    ///
    /// # Errors
    /// A horizontal length is not positive, a number is not finite, a side is not a whole number of cells, there are
    /// too many points, treads are less than two cells deep, or the platform is larger than the field.
    pub fn heights(&self) -> Result<Array2<f64>, TerrainError> {
        const NAME: &str = "stairs";
        let [columns, rows] = grid_size(NAME, self.size, self.cell)?;
        finite(NAME, "step_height", self.step_height)?;
        positive(NAME, "tread", self.tread)?;
        positive(NAME, "platform", self.platform)?;
        let number = |field, value, expected| TerrainError::Number { terrain: NAME, field, value, expected };
        if self.tread < (2.0 - 1e-6) * self.cell {
            return Err(number("tread", self.tread, "it must be at least two cells: one for the riser"));
        }
        let smaller = self.size[0].min(self.size[1]);
        if self.platform > smaller {
            return Err(number("platform", self.platform, "it must fit into the field"));
        }
        // A step begins where the distance from the rim is a multiple of the tread, up to the platform.
        let last = ((0.5 * (smaller - self.platform)) / self.tread + 1e-6).floor();
        let from_rim = |k: usize, n: usize| k.min(n - 1 - k) as f64 * self.cell;
        Ok(Array2::from_shape_fn((rows, columns), |(r, c)| {
            let distance = from_rim(r, rows).min(from_rim(c, columns));
            (distance / self.tread + 1e-6).floor().min(last) * self.step_height
        }))
    }
}

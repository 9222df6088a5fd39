//! Stepping stones.

use super::{TerrainError, check_platform, check_range, finite, from_center, grid_size, whole_cells};
use crate::KeyedRng;
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// A grid of square stones over a deep ground, and a platform of height 0 at the center. Each stone has its own random
/// height.
///
/// A height field has no vertical walls: the walls of a stone are inclined over one cell, outside the stone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SteppingStones {
    /// Lengths along x and y \[m\].
    pub size: [f64; 2],
    /// Distance of neighboring points \[m\].
    pub cell: f64,
    /// Side of a stone \[m\], rounded to whole cells; 0 cells are an error.
    pub stone: f64,
    /// Gap between two stones \[m\], rounded to whole cells, of which fewer than 2 are an error.
    pub distance: f64,
    /// Depth of the ground between the stones \[m\].
    pub depth: f64,
    /// Lowest and highest height of the stones \[m\], uniformly distributed.
    pub range: [f64; 2],
    /// Side of the platform \[m\].
    pub platform: f64,
    /// Seed. Equal seeds give the same heights, bit for bit, on every machine.
    pub seed: u64,
}

impl Default for SteppingStones {
    /// 8 m by 8 m, stones of 40 cm with gaps of 20 cm, 1 m deep, a platform of 2 m.
    fn default() -> Self {
        Self {
            size: [8.0, 8.0],
            cell: 0.1,
            stone: 0.4,
            distance: 0.2,
            depth: 1.0,
            range: [0.0, 0.0],
            platform: 2.0,
            seed: 0,
        }
    }
}

impl SteppingStones {
    /// Heights \[m\], rows along y, columns along x. The first stone begins at the negative ends.
    ///
    /// # Errors
    /// A horizontal length is not positive, a number is not finite, a side is not a whole number of cells, there are
    /// too many points, the range is not in order, stones or gaps have too few cells, or the platform is larger than
    /// the field.
    pub fn heights(&self) -> Result<Array2<f64>, TerrainError> {
        const NAME: &str = "stepping stones";
        let [columns, rows] = grid_size(NAME, self.size, self.cell)?;
        finite(NAME, "depth", self.depth)?;
        let [low, high] = check_range(NAME, "range", self.range)?;
        check_platform(NAME, self.size, self.platform)?;
        let stone = whole_cells(NAME, "stone", self.stone, self.cell, 1)?;
        let period = stone + whole_cells(NAME, "distance", self.distance, self.cell, 2)?;
        let mut random = KeyedRng::keyed(self.seed, 0, NAME);
        let stones = Array2::from_shape_simple_fn((rows.div_ceil(period), columns.div_ceil(period)), || {
            random.uniform_range(low, high)
        });
        Ok(Array2::from_shape_fn((rows, columns), |(r, c)| {
            if from_center([r, c], [rows, columns], self.cell) <= 0.5 * self.platform + 1e-9 {
                0.0
            } else if r % period <= stone && c % period <= stone {
                stones[(r / period, c / period)]
            } else {
                -self.depth
            }
        }))
    }
}

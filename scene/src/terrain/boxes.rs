//! Boxes with random heights.

use super::{TerrainError, check_platform, check_range, from_center, grid_size, whole_cells};
use crate::KeyedRng;
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// A grid of square boxes with independent random heights, and a platform of height 0 at the center.
///
/// Isaac's name is random grid. A height field has no vertical walls: the walls between two boxes are inclined over one
/// cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Boxes {
    /// Lengths along x and y \[m\].
    pub size: [f64; 2],
    /// Distance of neighboring points \[m\].
    pub cell: f64,
    /// Side of a box \[m\], with the wall to the next one; rounded to whole cells, of which fewer than 2 are an error.
    pub side: f64,
    /// Lowest and highest height \[m\], uniformly distributed.
    pub range: [f64; 2],
    /// Side of the platform \[m\].
    pub platform: f64,
    /// Seed. Equal seeds give the same heights, bit for bit, on every machine.
    pub seed: u64,
}

impl Default for Boxes {
    /// 8 m by 8 m, boxes of 50 cm up to 10 cm high and deep, a platform of 2 m.
    fn default() -> Self {
        Self { size: [8.0, 8.0], cell: 0.1, side: 0.5, range: [-0.1, 0.1], platform: 2.0, seed: 0 }
    }
}

impl Boxes {
    /// Heights \[m\], rows along y, columns along x.
    ///
    /// # Errors
    /// A horizontal length is not positive, a number is not finite, a side is not a whole number of cells, there are
    /// too many points, the range is not in order, boxes are smaller than two cells, or the platform is larger than the
    /// field.
    pub fn heights(&self) -> Result<Array2<f64>, TerrainError> {
        const NAME: &str = "boxes";
        let [columns, rows] = grid_size(NAME, self.size, self.cell)?;
        let [low, high] = check_range(NAME, "range", self.range)?;
        check_platform(NAME, self.size, self.platform)?;
        let side = whole_cells(NAME, "side", self.side, self.cell, 2)?;
        let mut random = KeyedRng::keyed(self.seed, 0, NAME);
        let boxes = Array2::from_shape_simple_fn((rows.div_ceil(side), columns.div_ceil(side)), || {
            random.uniform_range(low, high)
        });
        Ok(Array2::from_shape_fn((rows, columns), |(r, c)| {
            let is_platform = from_center([r, c], [rows, columns], self.cell) <= 0.5 * self.platform + 1e-9;
            if is_platform { 0.0 } else { boxes[(r / side, c / side)] }
        }))
    }
}

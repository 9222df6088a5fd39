//! Terrain with random heights.

use super::{TerrainError, finite, grid_size, positive};
use crate::KeyedRng;
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// Terrain with independent random heights at its points. Every multiple of `step` within the range is equally likely.
///
/// In Isaac Lab, this is the random uniform terrain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RoughTerrain {
    /// Lengths along x and y \[m\].
    pub size: [f64; 2],
    /// Distance of neighboring points \[m\].
    pub cell: f64,
    /// Lowest and highest height \[m\].
    pub range: [f64; 2],
    /// Step between heights \[m\]; all heights are multiples of it.
    pub step: f64,
    /// Seed. Equal seeds give the same heights, bit for bit, on every machine.
    pub seed: u64,
}

impl Default for RoughTerrain {
    /// 8 m by 8 m, points every 0.2 m, 0 to 6 cm high in steps of 2 cm.
    fn default() -> Self {
        Self { size: [8.0, 8.0], cell: 0.2, range: [0.0, 0.06], step: 0.02, seed: 0 }
    }
}

impl RoughTerrain {
    /// Heights \[m\], rows along y, columns along x.
    ///
    /// # Errors
    /// A side, the cell or the step is not positive, a number is not finite, a side is not a whole number of cells, or
    /// there are too many points. Also if the range contains no multiple of the step, or more than 1e15.
    pub fn heights(&self) -> Result<Array2<f64>, TerrainError> {
        const NAME: &str = "rough terrain";
        let [columns, rows] = grid_size(NAME, self.size, self.cell)?;
        positive(NAME, "step", self.step)?;
        let [low, high] = self.range;
        finite(NAME, "range", low)?;
        finite(NAME, "range", high)?;
        // Ends of the range may be multiples of the step up to rounding.
        const ROUNDING: f64 = 1e-9;
        let first = (low / self.step - ROUNDING).ceil();
        let levels = (high / self.step + ROUNDING).floor() - first + 1.0;
        if levels.is_nan() || levels < 1.0 {
            return Err(TerrainError::NoHeightInRange { low, high, step: self.step });
        }
        let mut random = KeyedRng::keyed(self.seed, 0, "rough terrain");
        // Beyond this limit, neighboring multiples are the same number.
        const MOST_LEVELS: f64 = 1e15;
        if levels > MOST_LEVELS {
            let expected = "it must not divide the range into more than 1e15 levels";
            return Err(TerrainError::Number { terrain: NAME, field: "step", value: self.step, expected });
        }
        // uniform() is below 1, but its product may round up to the number of levels.
        let mut level = || first + (random.uniform() * levels).floor().min(levels - 1.0);
        Ok(Array2::from_shape_simple_fn((rows, columns), || level() * self.step))
    }
}

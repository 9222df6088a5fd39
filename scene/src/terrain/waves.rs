//! Waves along x and y.

use super::{TerrainError, finite, grid_size, positive};
use ndarray::Array2;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Waves along x and y: the height is `amplitude` (sin(2 pi `waves` x / length) + sin(2 pi `waves` y / width)) / 2, with
/// x and y from the negative ends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Waves {
    /// Lengths along x and y \[m\].
    pub size: [f64; 2],
    /// Distance of neighboring points \[m\].
    pub cell: f64,
    /// Largest height above and below 0 \[m\].
    pub amplitude: f64,
    /// Number of waves along each side.
    pub waves: f64,
}

impl Default for Waves {
    /// 8 m by 8 m, four waves of 10 cm along each side.
    fn default() -> Self {
        Self { size: [8.0, 8.0], cell: 0.1, amplitude: 0.1, waves: 4.0 }
    }
}

impl Waves {
    /// Heights \[m\], rows along y, columns along x.
    ///
    /// # Errors
    /// A side, the cell or the number of waves is not positive, a number is not finite, a side is not a whole number of
    /// cells, there are too many points, or the waves are shorter than four cells.
    pub fn heights(&self) -> Result<Array2<f64>, TerrainError> {
        const NAME: &str = "waves";
        let [columns, rows] = grid_size(NAME, self.size, self.cell)?;
        finite(NAME, "amplitude", self.amplitude)?;
        positive(NAME, "waves", self.waves)?;
        let shortest = self.size[0].min(self.size[1]) / self.waves;
        if shortest < (4.0 - 1e-6) * self.cell {
            let expected = "a wave must be at least four cells long";
            return Err(TerrainError::Number { terrain: NAME, field: "waves", value: self.waves, expected });
        }
        let wave = |k: usize, n: usize| (TAU * self.waves * k as f64 / (n - 1) as f64).sin();
        Ok(Array2::from_shape_fn((rows, columns), |(r, c)| 0.5 * self.amplitude * (wave(c, columns) + wave(r, rows))))
    }
}

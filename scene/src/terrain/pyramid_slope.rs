//! Slopes around a platform.

use super::{TerrainError, check_platform, finite, from_rim, grid_size};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// Slopes from all four sides up (or down) to a platform at the center, which is square if the field is.
///
/// At a distance d from the rim, the height is `gradient` min(d, (s - `platform`) / 2), where s is the shorter side.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PyramidSlope {
    /// Lengths along x and y \[m\].
    pub size: [f64; 2],
    /// Distance of neighboring points \[m\].
    pub cell: f64,
    /// Rise per meter: the tangent of the angle; negative slopes lead down.
    pub gradient: f64,
    /// Shorter side of the platform \[m\].
    pub platform: f64,
}

impl Default for PyramidSlope {
    /// 8 m by 8 m, rising by 0.2 m per meter up to a platform of 2 m.
    fn default() -> Self {
        Self { size: [8.0, 8.0], cell: 0.1, gradient: 0.2, platform: 2.0 }
    }
}

impl PyramidSlope {
    /// Heights \[m\], 0 at the rim; rows along y, columns along x.
    ///
    /// # Errors
    /// A horizontal length is not positive, a number is not finite, a side is not a whole number of cells, there are
    /// too many points, or the platform is larger than the field.
    pub fn heights(&self) -> Result<Array2<f64>, TerrainError> {
        const NAME: &str = "pyramid slope";
        let [columns, rows] = grid_size(NAME, self.size, self.cell)?;
        finite(NAME, "gradient", self.gradient)?;
        let smaller = check_platform(NAME, self.size, self.platform)?;
        let width = 0.5 * (smaller - self.platform);
        Ok(Array2::from_shape_fn((rows, columns), |(r, c)| {
            self.gradient * from_rim([r, c], [rows, columns], self.cell).min(width)
        }))
    }
}

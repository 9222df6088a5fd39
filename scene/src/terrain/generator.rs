//! [`TerrainGenerator`]: any generator, as named in configuration files.

use super::{PyramidStairs, RoughTerrain, Slope, TerrainError};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// A terrain generator. In a file, it is a table with its name: `rough = { seed = 7 }`, `slope = {}`,
/// `pyramid_stairs = { tread = 0.3 }`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum TerrainGenerator {
    /// Random heights.
    Rough(RoughTerrain),
    /// An inclined plane.
    Slope(Slope),
    /// Stairs around a platform.
    PyramidStairs(PyramidStairs),
}

impl TerrainGenerator {
    /// Heights \[m\], rows along y, columns along x, from the negative ends.
    ///
    /// # Errors
    /// Those of the generator.
    pub fn heights(&self) -> Result<Array2<f64>, TerrainError> {
        match self {
            Self::Rough(rough) => rough.heights(),
            Self::Slope(slope) => slope.heights(),
            Self::PyramidStairs(stairs) => stairs.heights(),
        }
    }

    /// Lengths along x and y \[m\].
    pub fn size(&self) -> [f64; 2] {
        match self {
            Self::Rough(rough) => rough.size,
            Self::Slope(slope) => slope.size,
            Self::PyramidStairs(stairs) => stairs.size,
        }
    }
}

impl From<RoughTerrain> for TerrainGenerator {
    fn from(rough: RoughTerrain) -> Self {
        Self::Rough(rough)
    }
}

impl From<Slope> for TerrainGenerator {
    fn from(slope: Slope) -> Self {
        Self::Slope(slope)
    }
}

impl From<PyramidStairs> for TerrainGenerator {
    fn from(stairs: PyramidStairs) -> Self {
        Self::PyramidStairs(stairs)
    }
}

//! [`TerrainGenerator`]: any generator, as named in configuration files.

use super::{
    Boxes, DiscreteObstacles, Flat, Gap, PyramidSlope, PyramidStairs, RoughTerrain, Slope, SteppingStones,
    TerrainError, TerrainGrid, Waves,
};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// Declares the generators: the variant, its name in files, and its type.
macro_rules! generators {
    ($($(#[$doc:meta])* $Variant:ident, $name:literal, $Type:ident, $heights:expr, $size:expr;)*) => {
        /// A terrain generator. In a file, it is a table with its name: `rough = { seed = 7 }`, `slope = {}`,
        /// `pyramid_stairs = { tread = 0.3 }`.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case", deny_unknown_fields)]
        #[non_exhaustive]
        pub enum TerrainGenerator {
            $($(#[$doc])* $Variant($Type),)*
        }

        impl TerrainGenerator {
            /// Names of the generators in files.
            pub const NAMES: &'static [&'static str] = &[$($name),*];

            /// Heights \[m\], rows along y, columns along x, from the negative ends.
            ///
            /// # Errors
            /// Those of the generator.
            pub fn heights(&self) -> Result<Array2<f64>, TerrainError> {
                match self {
                    $(Self::$Variant(of) => { let heights: fn(&$Type) -> _ = $heights; heights(of) })*
                }
            }

            /// Lengths along x and y \[m\].
            pub fn size(&self) -> [f64; 2] {
                match self {
                    $(Self::$Variant(of) => { let size: fn(&$Type) -> [f64; 2] = $size; size(of) })*
                }
            }
        }

        $(impl From<$Type> for TerrainGenerator {
            fn from(of: $Type) -> Self {
                Self::$Variant(of)
            }
        })*
    };
}

generators! {
    /// Random heights.
    Rough, "rough", RoughTerrain, |of| of.heights(), |of| of.size;
    /// An inclined plane.
    Slope, "slope", Slope, |of| of.heights(), |of| of.size;
    /// Stairs around a platform.
    PyramidStairs, "pyramid_stairs", PyramidStairs, |of| of.heights(), |of| of.size;
    /// Flat ground.
    Flat, "flat", Flat, |of| of.heights(), |of| of.size;
    /// Slopes around a platform.
    PyramidSlope, "pyramid_slope", PyramidSlope, |of| of.heights(), |of| of.size;
    /// Boxes with random heights.
    Boxes, "boxes", Boxes, |of| of.heights(), |of| of.size;
    /// Stones over a deep ground.
    SteppingStones, "stepping_stones", SteppingStones, |of| of.heights(), |of| of.size;
    /// A trench around a platform.
    Gap, "gap", Gap, |of| of.heights(), |of| of.size;
    /// Waves along x and y.
    Waves, "waves", Waves, |of| of.heights(), |of| of.size;
    /// Separate obstacles on flat ground.
    DiscreteObstacles, "discrete_obstacles", DiscreteObstacles, |of| of.heights(), |of| of.size;
    /// Tiles of several types, in rows of increasing difficulty.
    Grid, "grid", TerrainGrid, |of| of.heights(), |of| of.size();
}

//! Types of tiles of a terrain grid, with their difficulty.

use super::{
    Boxes, DiscreteObstacles, Flat, Gap, PyramidSlope, PyramidStairs, RoughTerrain, SteppingStones, TerrainError, Waves,
};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// Sizes of a tile that do not depend on its type.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TileCfg {
    /// Lengths along x and y \[m\].
    pub size: [f64; 2],
    /// Distance of neighboring points \[m\].
    pub cell: f64,
    /// Side of the platform at the center \[m\], where robots start.
    pub platform: f64,
    /// Seed of random heights.
    pub seed: u64,
}

/// A type of tile. Pairs of numbers are \[easiest, hardest\]; a difficulty from 0 to 1 interpolates between them.
///
/// In a file, it is a table with the name of the type: `{ stairs_up = { step_height = [0.05, 0.2] } }`, `{ flat = {} }`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum TerrainTile {
    /// Flat ground.
    Flat {},
    /// Random heights ([`RoughTerrain`]).
    Rough(RoughTile),
    /// Slopes up to a platform ([`PyramidSlope`]).
    SlopeUp(SlopeTile),
    /// Slopes down to a platform ([`PyramidSlope`]).
    SlopeDown(SlopeTile),
    /// Stairs up to a platform ([`PyramidStairs`]).
    StairsUp(StairsTile),
    /// Stairs down to a platform ([`PyramidStairs`]).
    StairsDown(StairsTile),
    /// Boxes with random heights ([`Boxes`]).
    Boxes(BoxesTile),
    /// Stones over a deep ground ([`SteppingStones`]).
    SteppingStones(SteppingStonesTile),
    /// A trench around a platform ([`Gap`]).
    Gap(GapTile),
    /// Waves ([`Waves`]).
    Waves(WavesTile),
    /// Separate obstacles ([`DiscreteObstacles`]).
    DiscreteObstacles(ObstaclesTile),
}

/// Parameters of a rough tile. Pairs are \[easiest, hardest\].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RoughTile {
    /// Largest height above and below 0 \[m\].
    pub amplitude: [f64; 2],
    /// Step between heights, which are its multiples \[m\].
    pub step: f64,
}

impl Default for RoughTile {
    fn default() -> Self {
        Self { amplitude: [0.02, 0.1], step: 0.01 }
    }
}

/// Parameters of a tile of slopes. Pairs are \[easiest, hardest\].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SlopeTile {
    /// Rise per meter: the tangent of the angle.
    pub gradient: [f64; 2],
}

impl Default for SlopeTile {
    fn default() -> Self {
        Self { gradient: [0.0, 0.4] }
    }
}

/// Parameters of a tile of stairs. Pairs are \[easiest, hardest\].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StairsTile {
    /// Height of a step \[m\].
    pub step_height: [f64; 2],
    /// Depth of a tread, including its riser \[m\].
    pub tread: f64,
}

impl Default for StairsTile {
    fn default() -> Self {
        Self { step_height: [0.05, 0.23], tread: 0.3 }
    }
}

/// Parameters of a tile of boxes. Pairs are \[easiest, hardest\].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BoxesTile {
    /// Largest height above and below 0 \[m\].
    pub height: [f64; 2],
    /// Side of a box \[m\].
    pub side: f64,
}

impl Default for BoxesTile {
    fn default() -> Self {
        Self { height: [0.05, 0.2], side: 0.45 }
    }
}

/// Parameters of a tile of stepping stones. Pairs are \[easiest, hardest\].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SteppingStonesTile {
    /// Side of a stone \[m\].
    pub stone: [f64; 2],
    /// Gap between two stones \[m\].
    pub distance: [f64; 2],
    /// Depth of the ground between the stones \[m\].
    pub depth: f64,
}

impl Default for SteppingStonesTile {
    fn default() -> Self {
        Self { stone: [0.8, 0.3], distance: [0.2, 0.4], depth: 1.0 }
    }
}

/// Parameters of a tile with a trench. Pairs are \[easiest, hardest\].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GapTile {
    /// Width of the trench \[m\].
    pub width: [f64; 2],
    /// Depth of the trench \[m\].
    pub depth: f64,
}

impl Default for GapTile {
    fn default() -> Self {
        Self { width: [0.2, 0.8], depth: 1.0 }
    }
}

/// Parameters of a tile of waves. Pairs are \[easiest, hardest\].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WavesTile {
    /// Largest height above and below 0 \[m\].
    pub amplitude: [f64; 2],
    /// Number of waves along each side.
    pub waves: f64,
}

impl Default for WavesTile {
    fn default() -> Self {
        Self { amplitude: [0.02, 0.2], waves: 4.0 }
    }
}

/// Parameters of a tile of obstacles. The height is \[easiest, hardest\].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObstaclesTile {
    /// Height of the obstacles \[m\].
    pub height: [f64; 2],
    /// Shortest and longest side of an obstacle \[m\].
    pub sides: [f64; 2],
    /// Number of obstacles.
    pub count: u32,
}

impl Default for ObstaclesTile {
    fn default() -> Self {
        Self { height: [0.05, 0.2], sides: [0.3, 1.0], count: 40 }
    }
}

impl TerrainTile {
    /// One tile of each type, with the default numbers.
    pub fn all() -> Vec<Self> {
        vec![
            Self::Flat {},
            Self::Rough(RoughTile::default()),
            Self::SlopeUp(SlopeTile::default()),
            Self::SlopeDown(SlopeTile::default()),
            Self::StairsUp(StairsTile::default()),
            Self::StairsDown(StairsTile::default()),
            Self::Boxes(BoxesTile::default()),
            Self::SteppingStones(SteppingStonesTile::default()),
            Self::Gap(GapTile::default()),
            Self::Waves(WavesTile::default()),
            Self::DiscreteObstacles(ObstaclesTile::default()),
        ]
    }

    /// Name of the type in files.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Flat {} => "flat",
            Self::Rough(_) => "rough",
            Self::SlopeUp(_) => "slope_up",
            Self::SlopeDown(_) => "slope_down",
            Self::StairsUp(_) => "stairs_up",
            Self::StairsDown(_) => "stairs_down",
            Self::Boxes(_) => "boxes",
            Self::SteppingStones(_) => "stepping_stones",
            Self::Gap(_) => "gap",
            Self::Waves(_) => "waves",
            Self::DiscreteObstacles(_) => "discrete_obstacles",
        }
    }

    /// Heights \[m\] of a tile with a difficulty from 0 to 1, rows along y, columns along x.
    ///
    /// # Errors
    /// Those of the generator of this type.
    pub fn heights(&self, difficulty: f64, tile: TileCfg) -> Result<Array2<f64>, TerrainError> {
        let TileCfg { size, cell, platform, seed } = tile;
        let at = |[easy, hard]: [f64; 2]| easy + (hard - easy) * difficulty;
        let slope = |gradient| PyramidSlope { size, cell, gradient, platform }.heights();
        let stairs = |step_height, tread| PyramidStairs { size, cell, step_height, tread, platform }.heights();
        match self {
            Self::Flat {} => Flat { size, cell }.heights(),
            Self::Rough(RoughTile { amplitude, step }) => {
                let range = [-at(*amplitude), at(*amplitude)];
                RoughTerrain { size, cell, range, step: *step, seed }.heights()
            }
            Self::SlopeUp(SlopeTile { gradient }) => slope(at(*gradient)),
            Self::SlopeDown(SlopeTile { gradient }) => slope(-at(*gradient)),
            Self::StairsUp(StairsTile { step_height, tread }) => stairs(at(*step_height), *tread),
            Self::StairsDown(StairsTile { step_height, tread }) => stairs(-at(*step_height), *tread),
            Self::Boxes(BoxesTile { height, side }) => {
                Boxes { size, cell, side: *side, range: [-at(*height), at(*height)], platform, seed }.heights()
            }
            Self::SteppingStones(SteppingStonesTile { stone, distance, depth }) => {
                let (stone, distance, depth) = (at(*stone), at(*distance), *depth);
                SteppingStones { size, cell, stone, distance, depth, range: [0.0; 2], platform, seed }.heights()
            }
            Self::Gap(GapTile { width, depth }) => {
                Gap { size, cell, width: at(*width), depth: *depth, platform }.heights()
            }
            Self::Waves(WavesTile { amplitude, waves }) => {
                Waves { size, cell, amplitude: at(*amplitude), waves: *waves }.heights()
            }
            Self::DiscreteObstacles(ObstaclesTile { height, sides, count }) => {
                let range = [at(*height); 2];
                DiscreteObstacles { size, cell, count: *count, sides: *sides, range, platform, seed }.heights()
            }
        }
    }
}

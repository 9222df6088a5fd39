//! Terrain generators: height fields of uneven ground, one generator per file.
//!
//! Each generator returns an array of heights \[m\] over a regular grid: rows along y, columns along x, both starting
//! at the negative end. Generators are independent of MuJoCo; `kinetoscope_sim::TerrainCfg` takes their result.

mod boxes;
mod flat;
mod gap;
mod generator;
mod grid;
mod obstacles;
mod pyramid_slope;
mod rough;
mod slope;
mod stairs;
mod stepping_stones;
mod tile;
mod waves;

pub use boxes::Boxes;
pub use flat::Flat;
pub use gap::Gap;
pub use generator::TerrainGenerator;
pub use grid::{TerrainGrid, TileShare};
pub use obstacles::DiscreteObstacles;
pub use pyramid_slope::PyramidSlope;
pub use rough::RoughTerrain;
pub use slope::Slope;
pub use stairs::PyramidStairs;
pub use stepping_stones::SteppingStones;
pub use tile::{
    BoxesTile, GapTile, ObstaclesTile, RoughTile, SlopeTile, StairsTile, SteppingStonesTile, TerrainTile, TileCfg,
    WavesTile,
};
pub use waves::Waves;

use thiserror::Error;

/// Largest number of points of a height field. Rendering needs about 200 bytes of memory per point.
pub const MAX_POINTS: usize = 1 << 22;

/// Error of a terrain generator.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum TerrainError {
    /// A number is out of range.
    #[error("{terrain}: {field} is {value:?}; {expected}")]
    Number {
        /// Name of the generator.
        terrain: &'static str,
        /// Name of the field.
        field: &'static str,
        /// The given value.
        value: f64,
        /// Accepted values.
        expected: &'static str,
    },
    /// A side is not a whole number of cells.
    #[error(
        "{terrain}: a side of {side} m is not a whole number of cells of {cell} m; the nearest valid side is {nearest} \
         m"
    )]
    Cells {
        /// Name of the generator.
        terrain: &'static str,
        /// The side \[m\].
        side: f64,
        /// The cell \[m\].
        cell: f64,
        /// Nearest side that is a whole number of cells \[m\].
        nearest: f64,
    },
    /// A height field has more than [`MAX_POINTS`] points.
    #[error(
        "{terrain}: {columns} by {rows} points are too many; at most {MAX_POINTS} are supported: choose larger cells"
    )]
    TooMany {
        /// Name of the generator.
        terrain: &'static str,
        /// Number of points along x.
        columns: f64,
        /// Number of points along y.
        rows: f64,
    },
    /// A tile of a grid is invalid.
    #[error("terrain grid, row {row}, column {column} ({tile}): {error}")]
    Tile {
        /// Row of the tile.
        row: usize,
        /// Column of the tile.
        column: usize,
        /// Name of its type.
        tile: &'static str,
        /// Error of its generator.
        error: Box<TerrainError>,
    },
    /// A grid has no tile with a share above 0.
    #[error("terrain grid: {field} is empty; name at least one type of tile with a share above 0")]
    NoTiles {
        /// Name of the field.
        field: &'static str,
    },
    /// The range contains no multiple of the step.
    #[error(
        "rough terrain: no multiple of the step {step} m lies between {low} m and {high} m; widen the range, for \
         example to 0 m .. {step} m"
    )]
    NoHeightInRange {
        /// Lowest height \[m\].
        low: f64,
        /// Highest height \[m\].
        high: f64,
        /// Step \[m\].
        step: f64,
    },
}

/// Returns an error for a number that is not positive and finite.
fn positive(terrain: &'static str, field: &'static str, value: f64) -> Result<(), TerrainError> {
    let fine = value.is_finite() && value > 0.0;
    if fine { Ok(()) } else { Err(TerrainError::Number { terrain, field, value, expected: "it must be above 0 m" }) }
}

/// Returns an error for a number that is not finite.
fn finite(terrain: &'static str, field: &'static str, value: f64) -> Result<(), TerrainError> {
    let error = || TerrainError::Number { terrain, field, value, expected: "it must be finite" };
    value.is_finite().then_some(()).ok_or_else(error)
}

/// Number of points along x and y of a field of `size` \[m\]. An error for a side that is not a whole number of cells,
/// and for more than [`MAX_POINTS`] points.
fn grid_size(terrain: &'static str, size: [f64; 2], cell: f64) -> Result<[usize; 2], TerrainError> {
    positive(terrain, "cell", cell)?;
    for side in size {
        positive(terrain, "size", side)?;
    }
    let cells = size.map(|side| (side / cell).round());
    let [columns, rows] = cells.map(|n| n + 1.0);
    if columns * rows > MAX_POINTS as f64 {
        return Err(TerrainError::TooMany { terrain, columns, rows });
    }
    for (side, n) in size.into_iter().zip(cells) {
        // Sides and cells are decimal numbers, so quotients are whole up to a few rounding errors.
        if n < 1.0 || (side / cell - n).abs() > 1e-6 {
            return Err(TerrainError::Cells { terrain, side, cell, nearest: n.max(1.0) * cell });
        }
    }
    Ok([columns as usize, rows as usize])
}

/// Checks that a platform at the center fits into a field, and returns the shorter side of the field.
fn check_platform(terrain: &'static str, size: [f64; 2], platform: f64) -> Result<f64, TerrainError> {
    positive(terrain, "platform", platform)?;
    let smaller = size[0].min(size[1]);
    if platform > smaller {
        let expected = "it must fit into the field";
        return Err(TerrainError::Number { terrain, field: "platform", value: platform, expected });
    }
    Ok(smaller)
}

/// Returns the range; an error if an end is not finite, or if the first end is above the second.
fn check_range(terrain: &'static str, field: &'static str, range: [f64; 2]) -> Result<[f64; 2], TerrainError> {
    finite(terrain, field, range[0])?;
    finite(terrain, field, range[1])?;
    if range[0] > range[1] {
        let expected = "the first number must be at most the second one";
        return Err(TerrainError::Number { terrain, field, value: range[0], expected });
    }
    Ok(range)
}

/// Number of cells in a length, rounded; an error if they are fewer than `least`.
fn whole_cells(
    terrain: &'static str,
    field: &'static str,
    length: f64,
    cell: f64,
    least: usize,
) -> Result<usize, TerrainError> {
    positive(terrain, field, length)?;
    let cells = (length / cell).round().min(MAX_POINTS as f64) as usize;
    if cells < least {
        let expected = if least == 1 { "it must be at least one cell" } else { "it must be at least two cells" };
        return Err(TerrainError::Number { terrain, field, value: length, expected });
    }
    Ok(cells)
}

/// Distance of a point (row, column) from the rim of a field with `points` rows and columns \[m\].
fn from_rim(at: [usize; 2], points: [usize; 2], cell: f64) -> f64 {
    let distance = |k: usize, n: usize| k.min(n - 1 - k) as f64 * cell;
    distance(at[0], points[0]).min(distance(at[1], points[1]))
}

/// Larger one of the distances along x and y of a point (row, column) from the center of the field \[m\].
fn from_center(at: [usize; 2], points: [usize; 2], cell: f64) -> f64 {
    let distance = |k: usize, n: usize| (k as f64 - 0.5 * (n - 1) as f64).abs() * cell;
    distance(at[0], points[0]).max(distance(at[1], points[1]))
}

#[cfg(test)]
mod tests;

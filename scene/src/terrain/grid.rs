//! A grid of tiles with rows of increasing difficulty.

use super::{TerrainError, TerrainTile, TileCfg, finite, grid_size, positive, whole_cells};
use crate::KeyedRng;
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// A grid of terrain tiles: a type for each column, a difficulty for each row, for curricula of walking robots.
///
/// Rows are along x and columns along y, both from the negative ends. Row 0 has the first difficulty, by default the
/// easiest. All tiles meet at height 0: the points between two tiles, and those of a flat border around the grid, have
/// this height.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TerrainGrid {
    /// Lengths of a tile along x and y \[m\].
    pub tile_size: [f64; 2],
    /// Distance of neighboring points \[m\].
    pub cell: f64,
    /// Number of rows, each with a difficulty.
    pub rows: usize,
    /// Number of columns, each with a type of tile.
    pub columns: usize,
    /// Types of the tiles, with their shares of the columns.
    pub tiles: Vec<TileShare>,
    /// Difficulties of the first and the last row, from 0 to 1; the rows between them have equal steps.
    pub difficulty: [f64; 2],
    /// Side of the platform at the center of a tile \[m\], where robots start.
    pub platform: f64,
    /// Width of the flat border around the grid \[m\]; 0 for no border.
    pub border: f64,
    /// Seed of random heights. Equal seeds give the same heights, bit for bit, on every machine.
    pub seed: u64,
}

/// A type of tile, and its share of the columns of a grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TileShare {
    /// The type.
    pub tile: TerrainTile,
    /// Share of the columns, relative to the other shares; 1 in files without this number.
    #[serde(default = "one")]
    pub share: f64,
}

fn one() -> f64 {
    1.0
}

impl From<TerrainTile> for TileShare {
    fn from(tile: TerrainTile) -> Self {
        Self { tile, share: 1.0 }
    }
}

impl Default for TerrainGrid {
    /// Ten rows of tiles of 8 m by 8 m with points every 0.1 m, one column for each type of [`TerrainTile::all`],
    /// platforms of 2 m, a border of 2 m.
    fn default() -> Self {
        let tiles: Vec<TileShare> = TerrainTile::all().into_iter().map(TileShare::from).collect();
        Self {
            tile_size: [8.0, 8.0],
            cell: 0.1,
            rows: 10,
            columns: tiles.len(),
            tiles,
            difficulty: [0.0, 1.0],
            platform: 2.0,
            border: 2.0,
            seed: 0,
        }
    }
}

const NAME: &str = "terrain grid";

impl TerrainGrid {
    /// Heights \[m\] of the whole grid with its border; rows of the array along y, columns along x.
    ///
    /// # Errors
    /// A number is out of range, a side of a tile is not a whole number of cells, there are too many points, or the
    /// generator of a tile fails ([`TerrainError::Tile`]).
    pub fn heights(&self) -> Result<Array2<f64>, TerrainError> {
        self.check()?;
        let [columns, rows] = grid_size(NAME, self.size(), self.cell)?;
        let [wide, deep] = grid_size(NAME, self.tile_size, self.cell)?.map(|points| points - 1);
        let border = self.border_cells()?;
        let mut heights = Array2::zeros((rows, columns));
        for row in 0..self.rows {
            for column in 0..self.columns {
                let tile = self.tile(column);
                let cfg = TileCfg {
                    size: self.tile_size,
                    cell: self.cell,
                    platform: self.platform,
                    seed: self.tile_seed(row, column),
                };
                let of_tile = tile.heights(self.row_difficulty(row), cfg).map_err(|error| TerrainError::Tile {
                    row,
                    column,
                    tile: tile.name(),
                    error: Box::new(error),
                })?;
                let (x, y) = (border + row * wide, border + column * deep);
                // Rim points are shared with the neighbors and stay at 0.
                for (r, c) in (1..deep).flat_map(|r| (1..wide).map(move |c| (r, c))) {
                    heights[(y + r, x + c)] = of_tile[(r, c)];
                }
            }
        }
        Ok(heights)
    }

    /// Lengths of the grid along x and y, with its border \[m\].
    pub fn size(&self) -> [f64; 2] {
        [
            self.rows as f64 * self.tile_size[0] + 2.0 * self.border,
            self.columns as f64 * self.tile_size[1] + 2.0 * self.border,
        ]
    }

    /// Center of a tile \[m\], in the frame of the terrain; rows and columns beyond the grid are continued.
    pub fn tile_center(&self, row: usize, column: usize) -> [f64; 2] {
        let at = |k: usize, n: usize, side: f64| (k as f64 - 0.5 * (n as f64 - 1.0)) * side;
        [at(row, self.rows, self.tile_size[0]), at(column, self.columns, self.tile_size[1])]
    }

    /// Highest point of the platform of each tile \[m\], shape (rows, columns). The points of a platform include those
    /// nearest to the center of the tile, also for a platform smaller than a cell.
    ///
    /// # Errors
    /// Those of [`heights`](Self::heights).
    pub fn platform_heights(&self) -> Result<Array2<f64>, TerrainError> {
        let (heights, size) = (self.heights()?, self.size());
        let half = 0.5 * self.platform.min(self.tile_size[0]).min(self.tile_size[1]);
        Ok(Array2::from_shape_fn((self.rows, self.columns), |(row, column)| {
            let center = self.tile_center(row, column);
            // First and last point within half a platform of the center. The points on both sides of the center belong to
            // every platform.
            let [(x, last_x), (y, last_y)] = [0, 1].map(|axis| {
                let at = |distance: f64| (center[axis] + 0.5 * size[axis] + distance) / self.cell;
                let (below, above) = ((at(0.0) + 1e-6).floor(), (at(0.0) - 1e-6).ceil());
                let (first, last) = ((at(-half) - 1e-6).ceil().min(below), (at(half) + 1e-6).floor().max(above));
                (first as usize, last as usize)
            });
            let points = (y..=last_y).flat_map(|r| (x..=last_x).map(move |c| (r, c)));
            points.map(|point| heights[point]).fold(f64::NEG_INFINITY, f64::max)
        }))
    }

    /// Row and column of the tile at (x, y) \[m\] in the frame of the terrain; `None` outside the tiles.
    pub fn tile_at(&self, [x, y]: [f64; 2]) -> Option<[usize; 2]> {
        let index = |at: f64, n: usize, side: f64| {
            let k = (at / side + 0.5 * n as f64).floor();
            (k >= 0.0 && k < n as f64).then_some(k as usize)
        };
        Some([index(x, self.rows, self.tile_size[0])?, index(y, self.columns, self.tile_size[1])?])
    }

    /// Type of the tiles of a column. The shares divide the width of the grid in the order of `tiles`; the middle of
    /// the column selects the type.
    ///
    /// # Panics
    /// There are no tiles.
    pub fn tile(&self, column: usize) -> &TerrainTile {
        let total: f64 = self.tiles.iter().map(|tile| tile.share).sum();
        let middle = (column as f64 + 0.5) / self.columns as f64 * total;
        let mut sum = 0.0;
        let found = self.tiles.iter().find(|tile| {
            sum += tile.share;
            middle < sum
        });
        &found.unwrap_or_else(|| &self.tiles[self.tiles.len() - 1]).tile
    }

    /// Difficulty of a row: linear from the first to the second number of `difficulty` over the rows; the first for one
    /// row.
    pub fn row_difficulty(&self, row: usize) -> f64 {
        let [first, last] = self.difficulty;
        if self.rows < 2 { first } else { first + (last - first) * row as f64 / (self.rows - 1) as f64 }
    }

    /// Seed of a tile's generator, the same for any number of rows.
    pub fn tile_seed(&self, row: usize, column: usize) -> u64 {
        let mut random = KeyedRng::keyed(self.seed, column as u64, &format!("terrain grid/{row}"));
        (random.uniform() * 2f64.powi(53)) as u64
    }

    /// Checks the numbers of the grid: rows, columns, sizes and difficulties. Those of the tiles are checked when the
    /// heights are computed.
    ///
    /// # Errors
    /// A number is not in its range.
    pub fn check(&self) -> Result<(), TerrainError> {
        let number = |field, value, expected| Err(TerrainError::Number { terrain: NAME, field, value, expected });
        for (field, count) in [("rows", self.rows), ("columns", self.columns)] {
            if !(1..=10_000).contains(&count) {
                return number(field, count as f64, "it must be 1 to 10000");
            }
        }
        if let Some(tile) = self.tiles.iter().find(|tile| !(tile.share.is_finite() && tile.share >= 0.0)) {
            return number("share", tile.share, "it must be at least 0");
        }
        if self.tiles.iter().all(|tile| tile.share == 0.0) {
            return Err(TerrainError::NoTiles { field: "tiles" });
        }
        for difficulty in self.difficulty {
            if !(0.0..=1.0).contains(&difficulty) {
                return number("difficulty", difficulty, "it must be 0 to 1");
            }
        }
        positive(NAME, "platform", self.platform)
    }

    /// Width of the border in cells; an error unless it is a whole number.
    fn border_cells(&self) -> Result<usize, TerrainError> {
        finite(NAME, "border", self.border)?;
        if self.border == 0.0 {
            return Ok(0);
        }
        let cells = whole_cells(NAME, "border", self.border, self.cell, 1)?;
        let nearest = cells as f64 * self.cell;
        if (nearest - self.border).abs() > 1e-6 * self.cell {
            return Err(TerrainError::Cells { terrain: NAME, side: self.border, cell: self.cell, nearest });
        }
        Ok(cells)
    }
}

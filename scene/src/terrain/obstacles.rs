//! Separate obstacles on flat ground.

use super::{TerrainError, check_platform, check_range, from_center, grid_size, positive};
use crate::KeyedRng;
use ndarray::Array2;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Rectangular obstacles at random places on flat ground, and a free platform at the center. Where obstacles overlap, the
/// later one replaces the earlier one.
///
/// Isaac's name is discrete obstacles. A height field has no vertical walls: the walls of an obstacle are inclined over
/// one cell, outside the obstacle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DiscreteObstacles {
    /// Lengths along x and y \[m\].
    pub size: [f64; 2],
    /// Distance of neighboring points \[m\].
    pub cell: f64,
    /// Number of obstacles, at most one for each point, and at most 100,000.
    pub count: u32,
    /// Shortest and longest side of an obstacle \[m\], uniformly distributed.
    pub sides: [f64; 2],
    /// Lowest and highest height of an obstacle \[m\], uniformly distributed; negative heights are holes.
    pub range: [f64; 2],
    /// Side of the platform \[m\].
    pub platform: f64,
    /// Seed. Equal seeds give the same heights, bit for bit, on every machine.
    pub seed: u64,
}

impl Default for DiscreteObstacles {
    /// 8 m by 8 m, 40 obstacles of 0.3 to 1 m, 5 to 20 cm high, a platform of 2 m.
    fn default() -> Self {
        Self { size: [8.0, 8.0], cell: 0.1, count: 40, sides: [0.3, 1.0], range: [0.05, 0.2], platform: 2.0, seed: 0 }
    }
}

impl DiscreteObstacles {
    /// Heights \[m\], 0 beside the obstacles; rows along y, columns along x.
    ///
    /// # Errors
    /// A horizontal length is not positive, a number is not finite, a side is not a whole number of cells, there are
    /// too many points, a range is not in order, an obstacle or the platform is larger than the field, or there are
    /// more than 100,000 obstacles, or more obstacles than points.
    pub fn heights(&self) -> Result<Array2<f64>, TerrainError> {
        const NAME: &str = "discrete obstacles";
        let [columns, rows] = grid_size(NAME, self.size, self.cell)?;
        let [low, high] = check_range(NAME, "range", self.range)?;
        let smaller = check_platform(NAME, self.size, self.platform)?;
        let [shortest, longest] = check_range(NAME, "sides", self.sides)?;
        positive(NAME, "sides", shortest)?;
        let number = |field, value, expected| Err(TerrainError::Number { terrain: NAME, field, value, expected });
        if longest > smaller {
            return number("sides", longest, "an obstacle must fit into the field");
        }
        if self.count > 100_000 {
            return number("count", f64::from(self.count), "it must be at most 100000");
        }
        // Grids of many small tiles would otherwise have up to 100,000 obstacles on each of them.
        if self.count as usize > rows * columns {
            return number("count", f64::from(self.count), "it must be at most one for each point of the field");
        }
        let mut random = KeyedRng::keyed(self.seed, 0, NAME);
        let obstacles: Vec<Obstacle> = (0..self.count)
            .map(|_| {
                let height = random.uniform_range(low, high);
                let mut extent = |points: usize| {
                    let cells = points - 1;
                    let side = ((random.uniform_range(shortest, longest) / self.cell).round() as usize).clamp(1, cells);
                    let first = (random.uniform() * (cells - side + 1) as f64) as usize;
                    let first = first.min(cells - side);
                    first..first + side + 1
                };
                let (columns, rows) = (extent(columns), extent(rows));
                Obstacle { columns, rows, height }
            })
            .collect();
        let mut heights = place(&obstacles, [rows, columns]);
        heights.indexed_iter_mut().for_each(|((r, c), height)| {
            if from_center([r, c], [rows, columns], self.cell) <= 0.5 * self.platform + 1e-9 {
                *height = 0.0;
            }
        });
        Ok(heights)
    }
}

/// An obstacle: its points, and its height \[m\].
struct Obstacle {
    columns: Range<usize>,
    rows: Range<usize>,
    height: f64,
}

/// Heights of a field with obstacles. A later obstacle replaces earlier ones.
///
/// The last obstacle is placed first, and every point is set once: large obstacles that overlap would otherwise set
/// all points again for each of them.
fn place(obstacles: &[Obstacle], [rows, columns]: [usize; 2]) -> Array2<f64> {
    let mut heights = Array2::zeros((rows, columns));
    // For each point, and for the end of each row, a column from which on to search for the next unset point of the
    // row; the column itself if the point is unset, or for the end.
    let mut next_unset = Array2::from_shape_fn((rows, columns + 1), |(_, c)| c);
    for obstacle in obstacles.iter().rev() {
        for r in obstacle.rows.clone() {
            let (mut heights, mut next_unset) = (heights.row_mut(r), next_unset.row_mut(r));
            let mut c = obstacle.columns.start;
            loop {
                while next_unset[c] != c {
                    // Shortens later searches: the path of a search is halved.
                    next_unset[c] = next_unset[next_unset[c]];
                    c = next_unset[c];
                }
                if c >= obstacle.columns.end {
                    break;
                }
                heights[c] = obstacle.height;
                next_unset[c] = c + 1;
            }
        }
    }
    heights
}

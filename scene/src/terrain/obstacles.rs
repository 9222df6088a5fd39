//! Separate obstacles on flat ground.

use super::{TerrainError, check_platform, check_range, from_center, grid_size, positive};
use crate::KeyedRng;
use ndarray::Array2;
use serde::{Deserialize, Serialize};

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
    /// Number of obstacles.
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
    /// more than 100,000 obstacles.
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
        let mut heights = Array2::zeros((rows, columns));
        let mut random = KeyedRng::keyed(self.seed, 0, NAME);
        for _ in 0..self.count {
            let height = random.uniform_range(low, high);
            let mut extent = |points: usize| {
                let cells = points - 1;
                let side = ((random.uniform_range(shortest, longest) / self.cell).round() as usize).clamp(1, cells);
                let first = (random.uniform() * (cells - side + 1) as f64) as usize;
                (first.min(cells - side), side)
            };
            let ((column, width), (row, depth)) = (extent(columns), extent(rows));
            for (r, c) in (row..=row + depth).flat_map(|r| (column..=column + width).map(move |c| (r, c))) {
                heights[(r, c)] = height;
            }
        }
        heights.indexed_iter_mut().for_each(|((r, c), height)| {
            if from_center([r, c], [rows, columns], self.cell) <= 0.5 * self.platform + 1e-9 {
                *height = 0.0;
            }
        });
        Ok(heights)
    }
}

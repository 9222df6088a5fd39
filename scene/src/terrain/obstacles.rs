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
/// Lines of points are computed one by one, along the longer axis. In each line, the last obstacle is placed first, and
/// every point is set once: large obstacles that overlap would otherwise set all points again for each of them.
fn place(obstacles: &[Obstacle], [rows, columns]: [usize; 2]) -> Array2<f64> {
    let is_wide = columns >= rows;
    let length = rows.max(columns);
    let mut heights = vec![0.0; rows * columns];
    for (line, heights) in heights.chunks_exact_mut(length).enumerate() {
        // For each point, and for the end, a point from which on to search for the next unset one; the point itself if
        // it is unset, or for the end.
        let mut next_unset: Vec<usize> = (0..=length).collect();
        for Obstacle { columns, rows, height } in obstacles.iter().rev() {
            let (across, along) = if is_wide { (rows, columns) } else { (columns, rows) };
            if !across.contains(&line) {
                continue;
            }
            let mut point = find(&mut next_unset, along.start);
            while point < along.end {
                heights[point] = *height;
                // All points up to the end of the obstacle are set in this line.
                next_unset[point] = along.end;
                point = find(&mut next_unset, point + 1);
            }
        }
    }
    let at = |r: usize, c: usize| if is_wide { heights[r * length + c] } else { heights[c * length + r] };
    Array2::from_shape_fn((rows, columns), |(r, c)| at(r, c))
}

/// First unset point of a line from `point` on, or its end. Halves the path of the search for later ones.
fn find(next_unset: &mut [usize], mut point: usize) -> usize {
    while next_unset[point] != point {
        next_unset[point] = next_unset[next_unset[point]];
        point = next_unset[point];
    }
    point
}

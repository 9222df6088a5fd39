//! Height fields: a walk over the cells that a ray crosses.
//!
//! The solid lies between the floor and the surface, a graph over the grid. So a ray hits it where it changes from
//! above the surface to below or the other way. The walk tracks the side of the ray, so a ray cannot slip through
//! between two cells. Blocks of cells that the ray stays above (or below) are skipped, by a pyramid of the lowest and
//! the highest heights.
//!
//! Source: Tevs, Ihrke, Seidel: Maximum mipmaps for fast, accurate, and scalable dynamic height field rendering, I3D
//! 2008.

mod packet;

use super::{Intersections, RayShape};
use crate::geometry::assets::AssetCache;
use crate::geometry::bvh::TraversalStack;
use crate::geometry::packet::{ALL, Packet};
use crate::simd::Simd;
use kinetoscope_scene::Ray;
use kinetoscope_scene::shape::Intersection;
use kinetoscope_scene::vector::{V3, add_scaled, normalize};
use std::sync::Arc;

/// Cells that a walk visits one by one before it tries blocks: rays from above mostly hit in the first or the second.
const FIRST_CELLS: usize = 4;

/// Rounding may move a hit beyond the ends of a ray segment by this fraction of the heights.
const SLACK: f64 = 1e-12;

/// A height field, shared by all instances of the asset.
#[derive(Clone, Debug)]
pub(crate) struct HeightField {
    grid: Arc<HeightGrid>,
}

/// Heights over a grid.
#[derive(Clone, Debug)]
pub(crate) struct HeightGrid {
    columns: usize,
    /// Cells along x and y.
    cells: [usize; 2],
    /// Half lengths along x and y \[m\].
    half: [f64; 2],
    /// Cells per meter.
    cells_per_meter: [f64; 2],
    /// Heights of all points, row by row \[m\].
    heights: Vec<f64>,
    /// Heights of the floor and of the highest point \[m\].
    floor: f64,
    top: f64,
    /// Level k has blocks of 2^(k+1) by 2^(k+1) cells.
    pyramid: Vec<PyramidLevel>,
}

/// Lowest and highest height over blocks of cells.
#[derive(Clone, Debug)]
struct PyramidLevel {
    width: usize,
    blocks: Vec<[f64; 2]>,
}

/// A ray in units of cells along x and y, from 0 at the lower corner.
#[derive(Clone, Copy, Debug)]
struct GridRay {
    origin: [f64; 2],
    direction: [f64; 2],
    inverse: [f64; 2],
    z: f64,
    dz: f64,
    /// 1 above the surface, -1 below.
    side: f64,
}

impl HeightGrid {
    pub(crate) fn new(shape: &kinetoscope_scene::shape::HeightField) -> Self {
        let [x, y, scale, bottom] = shape.size();
        let (rows, columns) = (shape.rows(), shape.columns());
        let heights: Vec<f64> = shape.elevation().iter().map(|&e| f64::from(e) * scale).collect();
        let cells = [columns - 1, rows - 1];
        let mut field = Self {
            columns,
            cells,
            half: [x, y],
            cells_per_meter: [cells[0] as f64 / (2.0 * x), cells[1] as f64 / (2.0 * y)],
            floor: -bottom,
            top: heights.iter().copied().fold(0.0, f64::max),
            heights,
            pyramid: Vec::new(),
        };
        let mut size = cells;
        while size[0] > 1 || size[1] > 1 {
            let (below, width) = (size, size[0].div_ceil(2));
            size = size.map(|n| n.div_ceil(2));
            let blocks = (0..size[0] * size[1]).map(|k| {
                let (i, j) = (k % width, k / width);
                let parts = [0, 1, 2, 3].map(|p| [2 * i + p % 2, 2 * j + p / 2]);
                let inside = parts.into_iter().filter(|p| p[0] < below[0] && p[1] < below[1]);
                inside
                    .map(|p| field.range(field.pyramid.len(), p))
                    .fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], [a, b]| [lo.min(a), hi.max(b)])
            });
            let blocks = blocks.collect();
            field.pyramid.push(PyramidLevel { width, blocks });
        }
        field
    }

    /// Number of pyramid levels above the cells.
    #[cfg(test)]
    pub(crate) fn levels(&self) -> usize {
        self.pyramid.len()
    }

    /// Lowest and highest height over a block of a level; level 0 is the cells.
    #[inline(always)]
    fn range(&self, level: usize, [i, j]: [usize; 2]) -> [f64; 2] {
        if level == 0 {
            let [a, b, d, e] = self.corners([i, j]);
            return [a.min(b).min(d.min(e)), a.max(b).max(d.max(e))];
        }
        let level = &self.pyramid[level - 1];
        level.blocks[j * level.width + i]
    }

    /// Heights of the corners of a cell: at (0, 0), (1, 0), (0, 1), (1, 1).
    #[inline(always)]
    fn corners(&self, [i, j]: [usize; 2]) -> [f64; 4] {
        let at = j * self.columns + i;
        let (low, high) = (&self.heights[at..at + 2], &self.heights[at + self.columns..at + self.columns + 2]);
        [low[0], low[1], high[0], high[1]]
    }

    /// Height at the corner (0, 0) of a cell, and slopes (per cell), of the triangle right or left of its diagonal. The
    /// triangles are those of [`kinetoscope_scene::shape::HeightField`].
    #[inline(always)]
    fn plane(corners: [f64; 4], right: bool) -> [f64; 3] {
        let [a, b, d, e] = corners;
        if right { [a, b - a, e - b] } else { [a, e - d, d - a] }
    }

    /// The hit with the surface in a cell between distances `from` and `to`; `None` if the ray misses it there.
    #[inline(always)]
    fn intersect_cell(&self, walk: &GridRay, cell: [usize; 2], from: f64, to: f64) -> Option<Intersection> {
        let corners = self.corners(cell);
        let [x, y] = [0, 1].map(|k| walk.origin[k] - cell[k] as f64);
        let [dx, dy] = walk.direction;
        // Positive right of the diagonal.
        let (w, dw) = (x - y, dx - dy);
        let diagonal = if dw == 0.0 { to } else { -w / dw };
        let pieces =
            if diagonal > from && diagonal < to { [(from, diagonal), (diagonal, to)] } else { [(from, to); 2] };
        let count = if pieces[0].1 < to { 2 } else { 1 };
        for &(from, to) in &pieces[..count] {
            let right = w + dw * (0.5 * from + 0.5 * to) >= 0.0;
            let [h, hx, hy] = Self::plane(corners, right);
            // Height above the surface: gap + t closing.
            let (gap, closing) = (walk.z - (h + hx * x + hy * y), walk.dz - (hx * dx + hy * dy));
            let normal = || normalize([-hx * self.cells_per_meter[0], -hy * self.cells_per_meter[1], 1.0]);
            if (gap + closing * from) * walk.side <= 0.0 {
                return Some(Intersection { t: from, normal: normal()? });
            }
            if (gap + closing * to) * walk.side <= 0.0 {
                return Some(Intersection { t: (-gap / closing).clamp(from, to), normal: normal()? });
            }
        }
        None
    }

    /// Walks from distance `from` to distance `to` and returns the first hit; `None` without a hit.
    #[inline(always)]
    fn walk_cells(&self, walk: &GridRay, mut from: f64, to: f64) -> Option<Intersection> {
        let position = |t: f64, k: usize| walk.origin[k] + t * walk.direction[k];
        let clamped = |p: f64, lo: usize, hi: usize| (p.max(0.0) as usize).clamp(lo, hi);
        let mut cell = [0, 1].map(|k| clamped(position(from, k), 0, self.cells[k] - 1));
        let (mut level, mut steps) = (0, 0);
        loop {
            steps += 1;
            let block = cell.map(|c| c >> level);
            // Distance at which the ray leaves the block, and the axis across which it does.
            let mut leave = to;
            let mut axis = None;
            for (k, &block) in block.iter().enumerate() {
                if walk.direction[k] == 0.0 {
                    continue;
                }
                let line = if walk.direction[k] > 0.0 { (block + 1) << level } else { block << level };
                let t = (line as f64 - walk.origin[k]) * walk.inverse[k];
                if t < leave {
                    (leave, axis) = (t, Some(k));
                }
            }
            let leave = leave.max(from);
            let [lo, hi] = self.range(level, block);
            let (z0, z1) = (walk.z + walk.dz * from, walk.z + walk.dz * leave);
            let slack = SLACK * (walk.z.abs() + self.top - self.floor);
            let clear = if walk.side > 0.0 { z0.min(z1) > hi + slack } else { z0.max(z1) < lo - slack };
            if !clear && level > 0 {
                level -= 1;
                continue;
            }
            if !clear && let Some(touch) = self.intersect_cell(walk, cell, from, leave) {
                return Some(touch);
            }
            let k = axis?;
            // The next block along the axis; along the other axis, the one where the ray is by now.
            let next = if walk.direction[k] > 0.0 { (block[k] + 1) << level } else { block[k] << level };
            if walk.direction[k] > 0.0 && next >= self.cells[k] || walk.direction[k] < 0.0 && next == 0 {
                return None;
            }
            cell[k] = if walk.direction[k] > 0.0 { next } else { next - 1 };
            let other = 1 - k;
            if level > 0 {
                let first = block[other] << level;
                let last = (first + (1 << level) - 1).min(self.cells[other] - 1);
                cell[other] = clamped(position(leave, other), first, last);
            }
            from = leave;
            // At the border of a larger block, that block is tried next.
            let aligned = if walk.direction[k] > 0.0 { next } else { cell[k] + 1 };
            if clear && steps >= FIRST_CELLS && level < self.pyramid.len() && aligned.trailing_zeros() as usize > level
            {
                level += 1;
            }
        }
    }

    /// Hit of a ray straight down from above the surface, as height scanners cast them: it crosses one cell, so no walk
    /// is needed. `None` for other rays, for rays that begin below the surface, and outside of the footprint.
    #[inline(always)]
    fn intersect_vertical(&self, ray: &Ray) -> Option<Intersection> {
        let (o, d) = (ray.origin, ray.direction);
        if d[0] != 0.0 || d[1] != 0.0 || d[2] >= 0.0 || o[0].abs() > self.half[0] || o[1].abs() > self.half[1] {
            return None;
        }
        let [h, hx, hy] = self.height_at(o[0], o[1]);
        let t = (o[2] - h) / -d[2];
        let normal = normalize([-hx * self.cells_per_meter[0], -hy * self.cells_per_meter[1], 1.0])?;
        (t >= 0.0).then_some(Intersection { t, normal })
    }

    #[inline(always)]
    fn intersect(&self, ray: &Ray, limit: f64) -> Option<Intersection> {
        if let Some(touch) = self.intersect_vertical(ray) {
            return (touch.t <= limit).then_some(touch);
        }
        let (o, d) = (ray.origin, ray.direction);
        let [lo, hi] = [[-self.half[0], -self.half[1], self.floor], [self.half[0], self.half[1], self.top]];
        // Sides through which the ray enters and leaves the bounding box.
        let (mut enter, mut leave) = ((0.0f64, None), (f64::INFINITY, 2));
        for k in 0..3 {
            if d[k] == 0.0 {
                if o[k] < lo[k] || o[k] > hi[k] {
                    return None;
                }
                continue;
            }
            let (a, b) = ((lo[k] - o[k]) / d[k], (hi[k] - o[k]) / d[k]);
            let (a, b) = if d[k] > 0.0 { (a, b) } else { (b, a) };
            if a >= enter.0 {
                enter = (a + 0.0, Some(k));
            }
            if b < leave.0 {
                leave = (b, k);
            }
        }
        let (from, to) = (enter.0, leave.0);
        if !(from <= to && from <= limit) {
            return None;
        }
        let wall = |t: f64, axis: usize| {
            let normal = [0, 1, 2].map(|k| if k == axis { 1.0 } else { 0.0 });
            (t <= limit).then_some(Intersection { t, normal })
        };
        let origin = [0, 1].map(|k| (o[k] + self.half[k]) * self.cells_per_meter[k]);
        let direction = [0, 1].map(|k| d[k] * self.cells_per_meter[k]);
        let inverse = direction.map(|d| 1.0 / d);
        let mut walk = GridRay { origin, direction, inverse, z: o[2], dz: d[2], side: 1.0 };
        match enter.1 {
            // Upward through the floor.
            Some(2) if d[2] > 0.0 => return wall(from, 2),
            // Downward through the top.
            Some(2) => {}
            came => {
                let [x, y, z] = add_scaled(o, from, d);
                let gap = z - self.height_at(x, y)[0];
                if gap < 0.0 {
                    match came {
                        Some(axis) => return wall(from, axis),
                        None => walk.side = -1.0,
                    }
                }
            }
        }
        if let Some(touch) = self.walk_cells(&walk, from, to.min(limit)) {
            return (touch.t <= limit).then_some(touch);
        }
        // From inside through a wall or the floor, or from above through a floor without thickness.
        (walk.side < 0.0 || leave.1 == 2 && d[2] < 0.0).then(|| wall(to, leave.1)).flatten()
    }

    /// The cell of a point of the footprint, given in units of cells.
    #[inline(always)]
    fn cell_at(&self, at: [f64; 2]) -> [usize; 2] {
        [0, 1].map(|k| (at[k].max(0.0) as usize).min(self.cells[k] - 1))
    }

    /// Height of the surface over a point of the footprint \[m\], and its slopes (per cell).
    #[inline(always)]
    fn height_at(&self, x: f64, y: f64) -> [f64; 3] {
        let at = [(x + self.half[0]) * self.cells_per_meter[0], (y + self.half[1]) * self.cells_per_meter[1]];
        let cell = self.cell_at(at);
        let [x, y] = [0, 1].map(|k| at[k] - cell[k] as f64);
        let [h, hx, hy] = Self::plane(self.corners(cell), x >= y);
        [h + hx * x + hy * y, hx, hy]
    }
}

impl HeightField {
    pub(super) fn from_shape(shape: &kinetoscope_scene::shape::HeightField, assets: &mut AssetCache) -> Self {
        Self { grid: assets.height_field(shape) }
    }

    /// Bounding box in the frame of the height field: smallest and largest coordinates \[m\].
    pub(super) fn bounds(&self) -> [V3; 2] {
        let HeightGrid { half, floor, top, .. } = &*self.grid;
        [[-half[0], -half[1], *floor], [half[0], half[1], *top]]
    }
}

impl RayShape for HeightField {
    #[inline(always)]
    fn intersect(&self, ray: &Ray, limit: f64, _stack: &mut TraversalStack) -> Option<Intersection> {
        self.grid.intersect(ray, limit)
    }

    #[inline(always)]
    fn intersect_packet<S: Simd>(
        &self,
        s: S,
        packet: &Packet,
        _stack: &mut TraversalStack,
        touches: &mut Intersections,
    ) {
        let field = &*self.grid;
        let plumb = field.intersect_vertical_packet(s, packet, touches);
        let done = if plumb == ALL { plumb } else { plumb | field.intersect_steep_packet(s, packet, !plumb, touches) };
        for (k, touch) in touches.iter_mut().enumerate().filter(|(k, _)| done >> k & 1 == 0 && packet.is_active(*k)) {
            *touch = field.intersect(&packet.ray(k), packet.limit(k));
        }
    }
}

//! Packets of rays from above: the first steps of the walk in all lanes at once, by the operations of the single ray.

use super::{FIRST_CELLS, HeightGrid, SLACK};
use crate::geometry::packet::{Packet, WIDTH};
use crate::geometry::shape::Intersections;
use crate::simd::{D, D3, N, Simd, axes, dot_3};
use kinetoscope_scene::shape::Intersection;

/// Corner heights of a cell in each lane, and the index of the cell.
#[derive(Clone, Copy)]
struct CellLanes<S: Simd> {
    /// At (0, 0), (1, 0), (0, 1), (1, 1).
    corners: [D<S>; 4],
    at: [D<S>; 2],
}

impl<S: Simd> CellLanes<S> {
    /// Packet version of [`HeightGrid::plane`]: height at the corner (0, 0) and slopes of the triangle right or left of
    /// the diagonal.
    #[inline(always)]
    fn plane(&self, right: N<S>) -> D3<S> {
        let [a, b, d, e] = self.corners;
        [a, right.select(b - a, e - d), right.select(e - b, d - a)]
    }
}

impl HeightGrid {
    /// The cells under points in units of cells; points outside of the footprint get a cell of the rim.
    #[inline(always)]
    fn cells_at<S: Simd>(&self, s: S, at: [D<S>; 2]) -> CellLanes<S> {
        let (x, y) = (at[0].array(), at[1].array());
        let (mut cells, mut corners) = ([[0.0; WIDTH]; 2], [[0.0; WIDTH]; 4]);
        for k in 0..WIDTH {
            let cell = self.cell_at([x[k], y[k]]);
            (cells[0][k], cells[1][k]) = (cell[0] as f64, cell[1] as f64);
            [corners[0][k], corners[1][k], corners[2][k], corners[3][k]] = self.corners(cell);
        }
        let [a, b, d, e] = &corners;
        let corners = [D::load(s, a), D::load(s, b), D::load(s, d), D::load(s, e)];
        CellLanes { corners, at: [D::load(s, &cells[0]), D::load(s, &cells[1])] }
    }

    /// Packet version of [`normalize`](kinetoscope_scene::vector::normalize) for the surface's normal; false in lanes
    /// without a surface.
    #[inline(always)]
    fn normals<S: Simd>(&self, s: S, hx: D<S>, hy: D<S>) -> ([[f64; WIDTH]; 3], N<S>) {
        let one = D::splat(s, 1.0);
        let up = [-hx * self.cells_per_meter[0], -hy * self.cells_per_meter[1], one];
        let largest = up[0].abs().max(up[1].abs()).max(one);
        let up = [up[0] / largest, up[1] / largest, up[2] / largest];
        let by = one / dot_3(up, up).sqrt();
        let normal = axes(
            #[inline(always)]
            |k| (up[k] * by).array(),
        );
        (normal, largest.lt(D::splat(s, f64::INFINITY)))
    }

    /// Packet version of [`intersect_vertical`](HeightGrid::intersect_vertical); returns a bit for each lane it applies
    /// to.
    #[inline(always)]
    pub(super) fn intersect_vertical_packet<S: Simd>(&self, s: S, packet: &Packet, touches: &mut Intersections) -> u64 {
        let (o, d) = (packet.origins(s), packet.directions(s));
        let zero = D::splat(s, 0.0);
        let half = [D::splat(s, self.half[0]), D::splat(s, self.half[1])];
        let down = d[0].eq(zero) & d[1].eq(zero) & d[2].lt(zero);
        let over = o[0].abs().le(half[0]) & o[1].abs().le(half[1]);
        if (down & over).to_bitmask() == 0 {
            return 0;
        }
        let at = [(o[0] + half[0]) * self.cells_per_meter[0], (o[1] + half[1]) * self.cells_per_meter[1]];
        let cells = self.cells_at(s, at);
        let (x, y) = (at[0] - cells.at[0], at[1] - cells.at[1]);
        let [h, hx, hy] = cells.plane(y.le(x));
        let t = (o[2] - (h + hx * x + hy * y)) / -d[2];
        let (normal, known) = self.normals(s, hx, hy);
        let done = down & over & zero.le(t) & known;
        write_hits(touches, t, &normal, (done & t.le(packet.limits(s))).to_bitmask());
        done.to_bitmask()
    }

    /// The first steps of [`intersect`](HeightGrid::intersect) for the `wanted` rays of a packet that enter through the
    /// top of the bounding box. Returns a bit for each lane that hits the surface there.
    #[inline(always)]
    pub(super) fn intersect_steep_packet<S: Simd>(
        &self,
        s: S,
        packet: &Packet,
        wanted: u64,
        touches: &mut Intersections,
    ) -> u64 {
        let (o, d, limit) = (packet.origins(s), packet.directions(s), packet.limits(s));
        let zero = D::splat(s, 0.0);
        let none = d[0].eq(zero) | d[1].eq(zero) | zero.le(d[2]);
        let [lo, hi] = [[-self.half[0], -self.half[1], self.floor], [self.half[0], self.half[1], self.top]];
        let ends = axes(
            #[inline(always)]
            |k| {
                let (a, b) = ((D::splat(s, lo[k]) - o[k]) / d[k], (D::splat(s, hi[k]) - o[k]) / d[k]);
                let forward = zero.lt(d[k]);
                (forward.select(a, b), forward.select(b, a))
            },
        );
        // A ray enters through the top if that entry distance is the largest.
        let mut from = ends[2].0 + zero;
        let leave = ends[0].1.min(ends[1].1).min(ends[2].1);
        let enters = zero.max(ends[0].0).max(ends[1].0).le(from) & from.le(leave) & from.le(limit) & !none;
        let mut active = enters.to_bitmask() & wanted;
        if active == 0 {
            return 0;
        }
        let to = leave.min(limit);
        let pm = self.cells_per_meter;
        let origin = [(o[0] + D::splat(s, self.half[0])) * pm[0], (o[1] + D::splat(s, self.half[1])) * pm[1]];
        let along = [d[0] * pm[0], d[1] * pm[1]];
        let one = D::splat(s, 1.0);
        let inverse = [one / along[0], one / along[1]];
        active &= !(along[0].eq(zero) | along[1].eq(zero)).to_bitmask();
        let right_hand = [zero.lt(along[0]), zero.lt(along[1])];
        let slack = (o[2].abs() + D::splat(s, self.top) - D::splat(s, self.floor)) * SLACK;
        let mut at = [origin[0] + from * along[0], origin[1] + from * along[1]];
        let mut done = 0;
        for _ in 0..FIRST_CELLS {
            let cells = self.cells_at(s, at);
            // Distance at which the ray leaves the cell.
            let (mut next, mut leave) = (cells.at, to);
            let mut inside = zero.lt(zero);
            for k in 0..2 {
                let line = right_hand[k].select(cells.at[k] + one, cells.at[k]);
                let t = (line - origin[k]) * inverse[k];
                let sooner = t.lt(leave);
                leave = sooner.select(t, leave);
                // The next cell, and its existence.
                let beyond = right_hand[k].select(line, line - one);
                let there = zero.le(beyond) & beyond.lt(D::splat(s, self.cells[k] as f64));
                next[0] = sooner.select(if k == 0 { beyond } else { cells.at[0] }, next[0]);
                next[1] = sooner.select(if k == 1 { beyond } else { cells.at[1] }, next[1]);
                inside = (sooner & there) | (!sooner & inside);
            }
            let leave = leave.max(from);
            let [a, b, c, e] = cells.corners;
            let highest = a.max(b).max(c.max(e));
            let (z0, z1) = (o[2] + d[2] * from, o[2] + d[2] * leave);
            let clear = (highest + slack).lt(z0.min(z1));
            let close = active & !clear.to_bitmask();
            if close != 0 {
                let (t, hx, hy, hit) = intersect_cells(s, &cells, origin, along, [o[2], d[2]], from, leave);
                let (normal, known) = self.normals(s, hx, hy);
                let hit = (hit & known & t.le(limit)).to_bitmask() & close;
                write_hits(touches, t, &normal, hit);
                done |= hit;
                active &= !hit;
            }
            active &= inside.to_bitmask();
            if active == 0 {
                break;
            }
            (from, at) = (leave, next);
        }
        done
    }
}

/// Packet version of [`HeightGrid::intersect_cell`] for rays above the surface: distance, slopes at the hit, and the
/// lanes that hit.
#[inline(always)]
fn intersect_cells<S: Simd>(
    s: S,
    cells: &CellLanes<S>,
    origin: [D<S>; 2],
    [dx, dy]: [D<S>; 2],
    [z, dz]: [D<S>; 2],
    from: D<S>,
    to: D<S>,
) -> (D<S>, D<S>, D<S>, N<S>) {
    let zero = D::splat(s, 0.0);
    let (x, y) = (origin[0] - cells.at[0], origin[1] - cells.at[1]);
    let (w, dw) = (x - y, dx - dy);
    let diagonal = dw.eq(zero).select(to, -w / dw);
    let split = from.lt(diagonal) & diagonal.lt(to);
    // The segment before the diagonal, then, in lanes without a hit, the segment behind it.
    let (mut from, mut end, mut open) = (from, split.select(diagonal, to), zero.le(zero));
    let (mut t, mut slopes, mut hit) = (from, [zero; 2], zero.lt(zero));
    for _ in 0..2 {
        let right = zero.le(w + dw * (from * 0.5 + end * 0.5));
        let [h, hx, hy] = cells.plane(right);
        let (gap, closing) = (z - (h + hx * x + hy * y), dz - (hx * dx + hy * dy));
        let (first, last) = ((gap + closing * from).le(zero), (gap + closing * end).le(zero));
        let inner = (-gap / closing).max(from).min(end);
        let here = open & (first | last);
        t = here.select(first.select(from, inner), t);
        slopes = [here.select(hx, slopes[0]), here.select(hy, slopes[1])];
        (hit, open) = (hit | here, open & split & !here);
        if open.to_bitmask() == 0 {
            break;
        }
        (from, end) = (diagonal, to);
    }
    (t, slopes[0], slopes[1], hit)
}

/// Writes the hits of some lanes.
#[inline(always)]
fn write_hits<S: Simd>(touches: &mut Intersections, t: D<S>, normal: &[[f64; WIDTH]; 3], lanes: u64) {
    let t = t.array();
    for (k, touch) in touches.iter_mut().enumerate().filter(|(k, _)| lanes >> k & 1 == 1) {
        *touch = Some(Intersection { t: t[k], normal: [normal[0][k], normal[1][k], normal[2][k]] });
    }
}

//! Polygons of a surface in a grid: quadrilaterals between lines, each of two triangles.

use super::surface::InstanceSurface;
use super::texture::floor_lanes;
use crate::simd::{F, LANES, M, Simd, V3, load, load_u, max, min, select, select_u, splat};
use kinetoscope_scene::PlaneLines;

/// Polygons, triangles, at sixteen points of a surface.
#[derive(Clone, Copy)]
pub(crate) struct PolygonLanes<S: Simd> {
    /// Numbers of the triangles, see [`Cells`]; of a mesh, their indices.
    pub(crate) numbers: [u32; LANES],
    /// Barycentric coordinates of the points.
    pub(crate) shares: [F<S>; 3],
}

/// Corners of sixteen polygons.
#[derive(Clone, Copy)]
pub(crate) struct CornerLanes<S: Simd> {
    /// Positions \[m\].
    pub(crate) positions: [V3<S>; 3],
    /// Unit normals; outward, whatever side is visible.
    pub(crate) normals: [V3<S>; 3],
}

/// Sixteen polygons of a shape: quadrilaterals in columns and rows on a part of the shape, each split into two triangles.
/// Their numbers have 12 bits for the column, 12 for the row, one for the half and the others for the part.
#[derive(Clone, Copy)]
pub(super) struct Cells<S: Simd> {
    pub(super) column: F<S>,
    pub(super) row: F<S>,
    /// The second triangle of a quadrilateral, see [`Quad`].
    pub(super) half: M<S>,
    pub(super) part: F<S>,
}

/// Bits of the column, and of the row, of a polygon's number.
const CELL_BITS: u32 = 12;
/// Largest column and row.
const LAST_CELL: f32 = ((1 << CELL_BITS) - 1) as f32;

impl<S: Simd> Cells<S> {
    /// Numbers of the polygons. In lanes of other instances, columns and rows may be any numbers.
    #[inline(always)]
    fn numbers(self, s: S) -> [u32; LANES] {
        let (zero, last) = (splat(s, 0.0), splat(s, LAST_CELL));
        let inside = {
            #[inline(always)]
            |x: F<S>| max(min(x, last), zero).to_int()
        };
        let part = self.part * 2.0 + select(self.half, splat(s, 1.0), zero);
        let numbers =
            inside(self.column) + inside(self.row) * (1 << CELL_BITS) + part.to_int() * (1 << (2 * CELL_BITS));
        numbers.array().map(|number| number as u32)
    }

    #[inline(always)]
    pub(super) fn of(s: S, numbers: &[u32; LANES]) -> Self {
        let mut lanes = [[0.0f32; LANES]; 4];
        for (k, &number) in numbers.iter().enumerate() {
            let mask = (1 << CELL_BITS) - 1;
            lanes[0][k] = (number & mask) as f32;
            lanes[1][k] = (number >> CELL_BITS & mask) as f32;
            lanes[2][k] = (number >> (2 * CELL_BITS) & 1) as f32;
            lanes[3][k] = (number >> (2 * CELL_BITS + 1)) as f32;
        }
        let [column, row, half, part] = &lanes;
        Self {
            column: load(s, column),
            row: load(s, row),
            half: load(s, half).simd_gt(splat(s, 0.5)),
            part: load(s, part),
        }
    }
}

impl<S: Simd> PolygonLanes<S> {
    /// `a` where the mask is set, else `b`.
    #[inline(always)]
    pub(super) fn select(s: S, m: M<S>, a: Self, b: Self) -> Self {
        let (p, q) = (a.shares, b.shares);
        let numbers = select_u(m, load_u(s, &a.numbers), load_u(s, &b.numbers)).array();
        Self { numbers, shares: [select(m, p[0], q[0]), select(m, p[1], q[1]), select(m, p[2], q[2])] }
    }
}

impl<S: Simd> CornerLanes<S> {
    /// The same corners in the world.
    #[inline(always)]
    pub(super) fn into_world(self, s: S, source: &InstanceSurface<'_>) -> Self {
        let world = source.world_from_instance;
        let from = V3::splat(s, world.translation);
        let ([a, b, c], [l, m, n]) = (self.positions, self.normals);
        let positions = [
            a.rotate(&world.rotation).add(from),
            b.rotate(&world.rotation).add(from),
            c.rotate(&world.rotation).add(from),
        ];
        Self { positions, normals: [l.rotate(&world.rotation), m.rotate(&world.rotation), n.rotate(&world.rotation)] }
    }

    /// `a` where the mask is set, else `b`.
    #[inline(always)]
    pub(super) fn select(m: M<S>, a: Self, b: Self) -> Self {
        let v3 = {
            #[inline(always)]
            |a: [V3<S>; 3], b: [V3<S>; 3]| {
                [V3::select(m, a[0], b[0]), V3::select(m, a[1], b[1]), V3::select(m, a[2], b[2])]
            }
        };
        Self { positions: v3(a.positions, b.positions), normals: v3(a.normals, b.normals) }
    }
}

/// The second of two ends where the mask is set, else the first.
#[inline(always)]
pub(super) fn pick<S: Simd>(second: M<S>, [a, b]: [F<S>; 2]) -> F<S> {
    select(second, b, a)
}

/// [`PlaneLines`] of sixteen points.
#[derive(Clone, Copy)]
pub(super) struct LineLanes<S: Simd> {
    pub(super) reach: F<S>,
    pub(super) step: F<S>,
    pub(super) border: F<S>,
}

impl<S: Simd> LineLanes<S> {
    #[inline(always)]
    pub(super) fn of(s: S, lines: PlaneLines) -> Self {
        Self { reach: splat(s, lines.reach), step: splat(s, lines.step), border: splat(s, lines.border) }
    }

    /// Numbers of the cells around coordinates, and the fractions of the way between their two lines, as in
    /// [`PlaneLines::cell`]. The first and the last cell are those at the borders. Regular cells beyond the largest number,
    /// of which no plane has that many, count as one.
    #[inline(always)]
    pub(super) fn cell(self, s: S, x: F<S>) -> (F<S>, F<S>) {
        let Self { reach, step, .. } = self;
        let (zero, one) = (splat(s, 0.0), splat(s, 1.0));
        let line = min(floor_lanes(s, (x + reach) / step), splat(s, LAST_CELL - 2.0));
        let (before, behind) = (x.simd_lt(-reach), x.simd_ge(reach));
        let cell = select(before, zero, select(behind, splat(s, LAST_CELL), line + 1.0));
        let [low, high] = self.ends(s, cell);
        let width = high - low;
        let is_wide = width.simd_gt(zero);
        let fraction = (x - low) / select(is_wide, width, one);
        (cell, select(is_wide, min(max(fraction, zero), one), zero))
    }

    /// The two lines of cells.
    #[inline(always)]
    pub(super) fn ends(self, s: S, cell: F<S>) -> [F<S>; 2] {
        let Self { reach, step, border } = self;
        let line = cell - 1.0;
        let (before, behind) = (cell.simd_lt(splat(s, 0.5)), cell.simd_ge(splat(s, LAST_CELL)));
        let low = select(before, -border, select(behind, reach, line * step - reach));
        let high = select(before, -reach, select(behind, border, (line + 1.0) * step - reach));
        [low, high]
    }
}

/// Quadrilaterals, of which OpenGL splits some from the lower right to the upper left corner, others from the lower left
/// to the upper right one. Their first triangle is the lower or upper left one, their second the upper or lower right one.
#[derive(Clone, Copy)]
pub(super) struct Quad<S: Simd> {
    /// Set for quadrilaterals that are split from the lower right to the upper left corner.
    is_anti: M<S>,
    /// Set for the second triangle.
    half: M<S>,
}

/// Points of quadrilaterals.
#[derive(Clone, Copy)]
pub(super) struct QuadPoint<S: Simd> {
    half: M<S>,
    shares: [F<S>; 3],
}

impl<S: Simd> Quad<S> {
    /// Triangles at fractions of the width and height.
    #[inline(always)]
    pub(super) fn at(s: S, [u, v]: [F<S>; 2], is_anti: M<S>) -> QuadPoint<S> {
        let one = splat(s, 1.0);
        let (is_upper, is_right) = ((u + v).simd_gt(one), u.simd_gt(v));
        let anti =
            [select(is_upper, one - v, u), select(is_upper, one - u, v), select(is_upper, u + v - 1.0, one - u - v)];
        let other = [select(is_right, one - u, one - v), select(is_right, v, u), select(is_right, u - v, v - u)];
        QuadPoint {
            half: (is_anti & is_upper) | (!is_anti & is_right),
            shares: [
                select(is_anti, anti[0], other[0]),
                select(is_anti, anti[1], other[1]),
                select(is_anti, anti[2], other[2]),
            ],
        }
    }

    #[inline(always)]
    pub(super) fn of(half: M<S>, is_anti: M<S>) -> Self {
        Self { is_anti, half }
    }

    /// The corners; `corner` has the position and the normal of a corner: right or not, upper or not.
    #[inline(always)]
    pub(super) fn corners(self, corner: impl Fn(M<S>, M<S>) -> (V3<S>, V3<S>)) -> CornerLanes<S> {
        let Self { is_anti, half } = self;
        let (nothing, everything) = (half & !half, half | !half);
        let right = [is_anti, !is_anti, half];
        let upper = [nothing, everything, (is_anti & half) | !(is_anti | half)];
        let ends = [corner(right[0], upper[0]), corner(right[1], upper[1]), corner(right[2], upper[2])];
        let [(a, l), (b, m), (c, n)] = ends;
        CornerLanes { positions: [a, b, c], normals: [l, m, n] }
    }
}

impl<S: Simd> QuadPoint<S> {
    #[inline(always)]
    pub(super) fn polygons(self, s: S, [column, row]: [F<S>; 2], part: F<S>) -> PolygonLanes<S> {
        let numbers = Cells { column, row, half: self.half, part }.numbers(s);
        PolygonLanes { numbers, shares: self.shares }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{all_levels, at_level};

    /// The lines around coordinates are those of [`PlaneLines::cell`].
    #[test]
    fn cells() {
        let lines = PlaneLines { reach: 1.0, step: 0.5, border: 1.25 };
        for first in (-140..140).step_by(LANES) {
            let x: [f32; LANES] = std::array::from_fn(|k| 0.01 * (first + k as i32) as f32);
            for level in all_levels() {
                at_level!(level, s => {
                    let (cell, fraction) = LineLanes::of(s, lines).cell(s, load(s, &x));
                    let [low, high] = LineLanes::of(s, lines).ends(s, cell);
                    let found = [low, high, fraction].map(|lanes| lanes.array());
                    for (k, &x) in x.iter().enumerate() {
                        let (ends, fraction) = lines.cell(x);
                        assert_eq!(found.map(|lanes| lanes[k]), [ends[0], ends[1], fraction], "{x}");
                    }
                });
            }
        }
    }

    /// Interpolation is continuous across both diagonals of a quadrilateral, and exact at its corners.
    #[test]
    fn diagonals() {
        for level in all_levels() {
            let value = |u: f32, v: f32, anti: bool| {
                at_level!(level, s => {
                    let (zero, one) = (splat(s, 0.0), splat(s, 1.0));
                    let is_anti = if anti { one.simd_eq(one) } else { one.simd_eq(zero) };
                    let QuadPoint { half, shares } = Quad::at(s, [splat(s, u), splat(s, v)], is_anti);
                    let found = Quad::of(half, is_anti).corners(|right, upper| {
                        let at = V3 { x: pick(right, [zero, one]), y: pick(upper, [zero, splat(s, 3.0)]), z: zero };
                        (at, at)
                    });
                    let products = found.positions.map(|p| (p.x * p.y).array()[5]);
                    (0..3).map(|c| shares[c].array()[5] * products[c]).sum::<f32>()
                })
            };
            for anti in [false, true] {
                assert_eq!(
                    [value(0., 0., anti), value(1., 0., anti), value(0., 1., anti), value(1., 1., anti)],
                    [0., 0., 0., 3.]
                );
            }
            // In the middle: on the diagonal between the corners with 0, or with 0 and 3.
            assert_eq!([value(0.5, 0.5, true), value(0.5, 0.5, false)], [0.0, 1.5]);
            assert!((value(0.501, 0.5, true) - value(0.499, 0.5, true)).abs() < 0.01);
        }
    }
}

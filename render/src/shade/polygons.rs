//! Polygons of MuJoCo's OpenGL renderer, which lights surfaces at their corners: the polygon at a point of a shape.
//!
//! Visibility and depth stay those of the shapes. Only light is computed at the corners and interpolated.

use super::light::cos_deg;
use super::polygon_cells::{Cells, CornerLanes, LineLanes, PolygonLanes, Quad, pick};
use super::surface::{InstanceSurface, Surface};
use super::texture::floor_lanes;
use crate::simd::{F, LANES, M, Simd, V3, abs, load, max, min, select, splat};
use kinetoscope_scene::shape::{RenderMesh, Shape};
use kinetoscope_scene::{PlaneLines, Tessellation};

/// Parts of round shapes: the upper and the lower end of a capsule, or the whole of a ball, the side of a cylinder, and its
/// flat ends.
const UPPER: f32 = 0.0;
const LOWER: f32 = 1.0;
const SIDE: f32 = 2.0;
const TOP: f32 = 3.0;
const BOTTOM: f32 = 4.0;

/// Corners of the polygons of all shapes of a frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct PolygonTables {
    tessellation: Option<Tessellation>,
    /// Cosine and sine of each angle around a round shape.
    angles: Vec<[f32; 2]>,
    /// Cosine and sine of each latitude, from pole to pole.
    latitudes: Vec<[f32; 2]>,
}

/// Cosine of an angle of 0 to 360 degrees.
fn cosine(deg: f32) -> f32 {
    cos_deg(deg.min(360.0 - deg))
}

/// Largest numbers of a [`Tessellation`] that are used.
const MAX_POLYGONS: u16 = 1000;

impl PolygonTables {
    /// Prepares the tables for a tessellation; without one, light is computed at every point.
    pub(crate) fn prepare(&mut self, tessellation: Option<Tessellation>) {
        if self.tessellation == tessellation {
            return;
        }
        self.tessellation = tessellation;
        let Some(Tessellation { slices, stacks, .. }) = tessellation else { return };
        let slices = slices.clamp(3, MAX_POLYGONS);
        let half = (stacks / 2).clamp(1, MAX_POLYGONS);
        let entry = |deg: f32| [cosine(deg), cosine((deg - 90.0).abs())];
        self.angles = (0..=slices).map(|k| entry(360.0 * f32::from(k) / f32::from(slices))).collect();
        let latitude = |k: u16| {
            let deg = 90.0 * f32::from(k) / f32::from(half);
            [cosine((deg - 90.0).abs()), if deg >= 90.0 { 1.0 } else { -1.0 } * cosine(90.0 - (deg - 90.0).abs())]
        };
        self.latitudes = (0..=2 * half).map(latitude).collect();
    }

    /// True if light is computed at the corners of polygons.
    pub(crate) fn is_in_use(&self) -> bool {
        self.tessellation.is_some()
    }

    /// Polygons at the selected points of an instance; `triangle` has the index of the triangle of its `mesh` in each
    /// lane. Other lanes have the polygon of a selected one.
    #[inline(always)]
    pub(crate) fn polygons<S: Simd>(
        &self,
        s: S,
        source: &InstanceSurface<'_>,
        mesh: Option<&RenderMesh>,
        triangle: &[u32; LANES],
        at: &Surface<S>,
        lanes: u64,
    ) -> PolygonLanes<S> {
        let mut found = match mesh {
            Some(_) => PolygonLanes { numbers: *triangle, shares: at.shares },
            None => self.of_instance(s, source, at),
        };
        let fill = found.numbers[(lanes.trailing_zeros() as usize).min(LANES - 1)];
        for (k, number) in found.numbers.iter_mut().enumerate() {
            *number = if lanes >> k & 1 == 1 { *number } else { fill };
        }
        found
    }

    /// Corners of polygons of an instance, in the world.
    #[inline(always)]
    pub(crate) fn corners<S: Simd>(
        &self,
        s: S,
        source: &InstanceSurface<'_>,
        mesh: Option<&RenderMesh>,
        numbers: &[u32; LANES],
    ) -> CornerLanes<S> {
        let corners = match mesh {
            Some(mesh) => of_mesh(s, mesh, numbers),
            None => self.of_shape(s, &source.instance.shape, source.plane_lines, numbers),
        };
        corners.into_world(s, source)
    }

    /// Polygons at points of an instance that is a shape with a closed form. One copy per instruction set.
    #[inline(never)]
    fn of_instance<S: Simd>(&self, s: S, source: &InstanceSurface<'_>, at: &Surface<S>) -> PolygonLanes<S> {
        s.vectorize(
            #[inline(always)]
            || {
                let rotation = &source.world_from_instance.rotation;
                let into_local = [0, 1, 2].map(|j| [0, 1, 2].map(|i| rotation[i][j]));
                let normal = at.normal.rotate(&into_local);
                self.at_points(s, &source.instance.shape, source.plane_lines, at.local_position, normal)
            },
        )
    }

    /// Polygons at points of a shape with a closed form, where it has these outward normals (or their opposites), in the
    /// frame of the shape.
    #[inline(always)]
    fn at_points<S: Simd>(
        &self,
        s: S,
        shape: &Shape,
        lines: [PlaneLines; 2],
        p: V3<S>,
        normal: V3<S>,
    ) -> PolygonLanes<S> {
        let (zero, one) = (splat(s, 0.0), splat(s, 1.0));
        let everything = one.simd_eq(one);
        match shape {
            Shape::Plane(_) => {
                let (column, u) = LineLanes::of(s, lines[0]).cell(s, p.x);
                let (row, v) = LineLanes::of(s, lines[1]).cell(s, p.y);
                Quad::at(s, [u, v], everything).polygons(s, [column, row], zero)
            }
            Shape::Box(cuboid) => {
                let (nx, ny, nz) = (abs(normal.x), abs(normal.y), abs(normal.z));
                let by_x = nx.simd_ge(ny) & nx.simd_ge(nz);
                let by_z = !by_x & nz.simd_gt(ny);
                let by_y = !by_x & !by_z;
                // The visible side tells the face, also from inside.
                let on_axis = select(by_x, p.x, select(by_y, p.y, p.z));
                let is_outer = !on_axis.simd_lt(zero);
                let lines = self.box_lines(s, cuboid.half, by_x, by_z);
                let (column, u) = lines[0].cell(s, select(by_x, p.y, p.x));
                let (row, v) = lines[1].cell(s, select(by_z, p.y, p.z));
                let is_anti = (is_outer & !by_y) | (!is_outer & by_y);
                let axis = select(by_x, zero, select(by_y, splat(s, 2.0), splat(s, 4.0)));
                let face = axis + select(is_outer, one, zero);
                Quad::at(s, [u, v], is_anti).polygons(s, [column, row], face)
            }
            Shape::Sphere(sphere) => self.on_ball(s, [sphere.radius; 3], p, zero, splat(s, UPPER)),
            Shape::Ellipsoid(ellipsoid) => self.on_ball(s, ellipsoid.radii, p, zero, splat(s, UPPER)),
            Shape::Capsule(capsule) => {
                let (radius, half) = (capsule.radius, capsule.half_length);
                let is_end = abs(p.z).simd_gt(splat(s, half));
                let is_low = p.z.simd_lt(zero);
                let center = select(is_low, splat(s, -half), splat(s, half));
                let part = select(is_low, splat(s, LOWER), splat(s, UPPER));
                if is_end.all_true() {
                    return self.on_ball(s, [radius; 3], p, center, part);
                }
                let tube = self.on_tube(s, half, p);
                if !is_end.any_true() {
                    return tube;
                }
                PolygonLanes::select(s, is_end, self.on_ball(s, [radius; 3], p, center, part), tube)
            }
            Shape::Cylinder(cylinder) => {
                let is_side = abs(normal.z).simd_lt(splat(s, 0.5));
                let tube = self.on_tube(s, cylinder.half_length, p);
                if is_side.all_true() {
                    return tube;
                }
                let is_low = p.z.simd_lt(zero);
                let rings = self.rings(s, cylinder.radius);
                let (row, t) = rings.cell(s, (p.x * p.x + p.y * p.y).sqrt());
                let (column, u) = self.slice(s, p.x, p.y);
                let part = select(is_low, splat(s, BOTTOM), splat(s, TOP));
                let cap = Quad::at(s, [u, t], is_low).polygons(s, [column, row], part);
                PolygonLanes::select(s, is_side, tube, cap)
            }
            _ => PolygonLanes { numbers: [0; LANES], shares: [one, zero, zero] },
        }
    }

    /// Corners of polygons of a shape with a closed form, in the frame of the shape.
    #[inline(never)]
    fn of_shape<S: Simd>(&self, s: S, shape: &Shape, lines: [PlaneLines; 2], numbers: &[u32; LANES]) -> CornerLanes<S> {
        s.vectorize(
            #[inline(always)]
            || {
                let cells = Cells::of(s, numbers);
                let (zero, one) = (splat(s, 0.0), splat(s, 1.0));
                let minus = splat(s, -1.0);
                let everything = one.simd_eq(one);
                match shape {
                    Shape::Plane(_) => {
                        let x = LineLanes::of(s, lines[0]).ends(s, cells.column);
                        let y = LineLanes::of(s, lines[1]).ends(s, cells.row);
                        let up = V3 { x: zero, y: zero, z: one };
                        Quad::of(cells.half, everything).corners(
                            #[inline(always)]
                            |right, upper| (V3 { x: pick(right, x), y: pick(upper, y), z: zero }, up),
                        )
                    }
                    Shape::Box(cuboid) => {
                        let by_x = cells.part.simd_lt(splat(s, 2.0));
                        let by_z = cells.part.simd_ge(splat(s, 4.0));
                        let by_y = !by_x & !by_z;
                        let axis = select(by_x, zero, select(by_y, splat(s, 2.0), splat(s, 4.0)));
                        let is_outer = cells.part.simd_gt(axis);
                        let side = select(is_outer, one, minus);
                        let lines = self.box_lines(s, cuboid.half, by_x, by_z);
                        let (x, y) = (lines[0].ends(s, cells.column), lines[1].ends(s, cells.row));
                        let is_anti = (is_outer & !by_y) | (!is_outer & by_y);
                        let [half_x, half_y, half_z] = cuboid.half.map(|half| splat(s, half));
                        let normal = V3 {
                            x: select(by_x, side, zero),
                            y: select(by_y, side, zero),
                            z: select(by_z, side, zero),
                        };
                        Quad::of(cells.half, is_anti).corners(
                            #[inline(always)]
                            |right, upper| {
                                let (right, upper) = (pick(right, x), pick(upper, y));
                                let position = V3 {
                                    x: select(by_x, side * half_x, right),
                                    y: select(by_y, side * half_y, select(by_x, right, upper)),
                                    z: select(by_z, side * half_z, upper),
                                };
                                (position, normal)
                            },
                        )
                    }
                    Shape::Sphere(sphere) => self.of_ball(s, [sphere.radius; 3], zero, cells),
                    Shape::Ellipsoid(ellipsoid) => self.of_ball(s, ellipsoid.radii, zero, cells),
                    Shape::Capsule(capsule) => {
                        let (radius, half) = (capsule.radius, capsule.half_length);
                        let is_low = cells.part.simd_eq(splat(s, LOWER));
                        let center = select(is_low, splat(s, -half), splat(s, half));
                        let is_side = cells.part.simd_eq(splat(s, SIDE));
                        let ball = self.of_ball(s, [radius; 3], center, cells);
                        if !is_side.any_true() {
                            return ball;
                        }
                        CornerLanes::select(is_side, self.of_tube(s, radius, half, cells), ball)
                    }
                    Shape::Cylinder(cylinder) => {
                        let (radius, half) = (cylinder.radius, cylinder.half_length);
                        let tube = self.of_tube(s, radius, half, cells);
                        let is_side = cells.part.simd_eq(splat(s, SIDE));
                        if is_side.all_true() {
                            return tube;
                        }
                        let is_low = cells.part.simd_eq(splat(s, BOTTOM));
                        let side = select(is_low, minus, one);
                        let ring = self.rings(s, radius).ends(s, cells.row);
                        let (cosines, sines) = ends_of(s, &self.angles, cells.column);
                        let normal = V3 { x: zero, y: zero, z: side };
                        let cap = Quad::of(cells.half, is_low).corners(
                            #[inline(always)]
                            |right, upper| {
                                let r = max(pick(upper, ring), zero);
                                (V3 { x: r * pick(right, cosines), y: r * pick(right, sines), z: side * half }, normal)
                            },
                        );
                        CornerLanes::select(is_side, tube, cap)
                    }
                    _ => {
                        let nothing = V3 { x: zero, y: zero, z: zero };
                        CornerLanes { positions: [nothing; 3], normals: [nothing; 3] }
                    }
                }
            },
        )
    }

    /// Lines of the faces of a box, across and along.
    #[inline(always)]
    fn box_lines<S: Simd>(&self, s: S, half: [f32; 3], by_x: M<S>, by_z: M<S>) -> [LineLanes<S>; 2] {
        let quality = self.tessellation.unwrap_or_default();
        let half = half.map(|half| splat(s, half));
        let count = f32::from(quality.quads.clamp(1, MAX_POLYGONS));
        let lines = {
            #[inline(always)]
            |half: F<S>| LineLanes { reach: half, step: half * 2.0 / count, border: half }
        };
        [lines(select(by_x, half[1], half[0])), lines(select(by_z, half[1], half[2]))]
    }

    /// Rings of the flat ends of a cylinder.
    #[inline(always)]
    fn rings<S: Simd>(&self, s: S, radius: f32) -> LineLanes<S> {
        let count = f32::from((self.tessellation.unwrap_or_default().stacks / 2).clamp(1, MAX_POLYGONS));
        LineLanes::of(s, PlaneLines { reach: radius, step: radius / count, border: radius })
    }

    /// Lines around the side of a cylinder.
    #[inline(always)]
    fn tube_lines<S: Simd>(&self, s: S, half: f32) -> LineLanes<S> {
        let count = f32::from(self.tessellation.unwrap_or_default().stacks.clamp(1, MAX_POLYGONS));
        LineLanes::of(s, PlaneLines { reach: half, step: 2.0 * half / count, border: half })
    }

    /// Slices of a round shape at points, and the fractions between their two ends.
    #[inline(always)]
    fn slice<S: Simd>(&self, s: S, x: F<S>, y: F<S>) -> (F<S>, F<S>) {
        let turns = angle(s, y, x) * (1.0 / 360.0);
        let turns = select(turns.simd_lt(splat(s, 0.0)), turns + 1.0, turns);
        entry_of(s, &self.angles, turns)
    }

    /// Polygons of a ball with the centers (0, 0, `center`).
    #[inline(always)]
    fn on_ball<S: Simd>(&self, s: S, radii: [f32; 3], p: V3<S>, center: F<S>, part: F<S>) -> PolygonLanes<S> {
        let q = V3 { x: p.x / radii[0], y: p.y / radii[1], z: (p.z - center) / radii[2] };
        let (column, u) = self.slice(s, q.x, q.y);
        let latitude = angle(s, q.z, (q.x * q.x + q.y * q.y).sqrt()) * (1.0 / 180.0) + 0.5;
        let (row, v) = entry_of(s, &self.latitudes, latitude);
        Quad::at(s, [u, v], center.simd_eq(center)).polygons(s, [column, row], part)
    }

    #[inline(always)]
    fn of_ball<S: Simd>(&self, s: S, radii: [f32; 3], center: F<S>, cells: Cells<S>) -> CornerLanes<S> {
        let (cosines, sines) = ends_of(s, &self.angles, cells.column);
        let (flats, ups) = ends_of(s, &self.latitudes, cells.row);
        Quad::of(cells.half, center.simd_eq(center)).corners(
            #[inline(always)]
            |right, upper| {
                let (flat, up) = (pick(upper, flats), pick(upper, ups));
                let unit = V3 { x: flat * pick(right, cosines), y: flat * pick(right, sines), z: up };
                let normal = V3 { x: unit.x / radii[0], y: unit.y / radii[1], z: unit.z / radii[2] };
                let position = V3 { x: unit.x * radii[0], y: unit.y * radii[1], z: unit.z * radii[2] + center };
                (position, normal.unit(s))
            },
        )
    }

    /// Polygons of the side of a cylinder.
    #[inline(always)]
    fn on_tube<S: Simd>(&self, s: S, half: f32, p: V3<S>) -> PolygonLanes<S> {
        let zero = splat(s, 0.0);
        let (column, u) = self.slice(s, p.x, p.y);
        let (row, v) = self.tube_lines(s, half).cell(s, p.z);
        Quad::at(s, [u, v], zero.simd_eq(zero)).polygons(s, [column, row], splat(s, SIDE))
    }

    #[inline(always)]
    fn of_tube<S: Simd>(&self, s: S, radius: f32, half: f32, cells: Cells<S>) -> CornerLanes<S> {
        let zero = splat(s, 0.0);
        let (cosines, sines) = ends_of(s, &self.angles, cells.column);
        let heights = self.tube_lines(s, half).ends(s, cells.row);
        Quad::of(cells.half, zero.simd_eq(zero)).corners(
            #[inline(always)]
            |right, upper| {
                let (x, y) = (pick(right, cosines), pick(right, sines));
                (V3 { x: x * radius, y: y * radius, z: pick(upper, heights) }, V3 { x, y, z: zero })
            },
        )
    }
}

/// Entries of a table at fractions of its length, and the fractions between them and the next ones.
#[inline(always)]
fn entry_of<S: Simd>(s: S, table: &[[f32; 2]], fraction: F<S>) -> (F<S>, F<S>) {
    let count = table.len().saturating_sub(1).max(1) as f32;
    let (zero, one) = (splat(s, 0.0), splat(s, 1.0));
    let at = fraction * count;
    // Also for lanes of other instances, whose numbers may be anything.
    let index = max(min(floor_lanes(s, at), splat(s, count - 1.0)), zero);
    (index, min(max(at - index, zero), one))
}

/// Both numbers of the entries of a table, and of the next ones.
#[inline(always)]
fn ends_of<S: Simd>(s: S, table: &[[f32; 2]], entry: F<S>) -> ([F<S>; 2], [F<S>; 2]) {
    let entries: [i32; LANES] = entry.to_int().array();
    let mut ends = [[[0.0f32; LANES]; 2]; 2];
    for (k, &entry) in entries.iter().enumerate() {
        for (end, entry) in table.iter().skip(entry as usize).take(2).enumerate() {
            (ends[0][end][k], ends[1][end][k]) = (entry[0], entry[1]);
        }
    }
    let [[a, b], [c, d]] = &ends;
    ([load(s, a), load(s, b)], [load(s, c), load(s, d)])
}

/// Corners of triangles of a mesh, in its frame.
#[inline(never)]
fn of_mesh<S: Simd>(s: S, mesh: &RenderMesh, triangles: &[u32; LANES]) -> CornerLanes<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let zero = [[0.0f32; LANES]; 3];
            let (mut p, mut n) = ([zero; 3], [zero; 3]);
            let (positions, normals) = (mesh.positions(), mesh.normals());
            for (k, &triangle) in triangles.iter().enumerate() {
                let corners = mesh.triangles()[triangle as usize];
                for (c, &corner) in corners.iter().enumerate() {
                    let (position, normal) = (positions[corner as usize], normals[corner as usize]);
                    for axis in 0..3 {
                        (p[c][axis][k], n[c][axis][k]) = (position[axis], normal[axis]);
                    }
                }
            }
            let v3 = {
                #[inline(always)]
                |a: &[[f32; LANES]; 3]| V3 { x: load(s, &a[0]), y: load(s, &a[1]), z: load(s, &a[2]) }
            };
            CornerLanes { positions: [v3(&p[0]), v3(&p[1]), v3(&p[2])], normals: [v3(&n[0]), v3(&n[1]), v3(&n[2])] }
        },
    )
}

/// Angles of the vectors (x, y) from the x axis \[deg\], -180 to 180: a polynomial, within 0.001 degrees, because `atan2`
/// differs from machine to machine. Source of the polynomial: a minimax fit of the arc tangent on 0..=1.
#[inline(always)]
fn angle<S: Simd>(s: S, y: F<S>, x: F<S>) -> F<S> {
    let (ax, ay) = (abs(x), abs(y));
    let (zero, one) = (splat(s, 0.0), splat(s, 1.0));
    let is_steep = ax.simd_lt(ay);
    let (small, large) = (select(is_steep, ax, ay), select(is_steep, ay, ax));
    let r = small / select(large.simd_gt(zero), large, one);
    let k = r * r;
    let series = ((((k * -0.011_721_2 + 0.052_653_32) * k - 0.116_432_87) * k + 0.193_543_46) * k - 0.332_623_47) * k;
    let deg = (series + 0.999_977_26) * r * (180.0 / std::f32::consts::PI);
    let deg = select(is_steep, 90.0 - deg, deg);
    let deg = select(x.simd_lt(zero), 180.0 - deg, deg);
    select(y.simd_lt(zero), -deg, deg)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{all_levels, at_level};
    use kinetoscope_scene::shape::{Box, Capsule, Cylinder, Ellipsoid, Plane, Sphere};
    use kinetoscope_scene::vector::{dot, norm, sub};

    const QUALITY: Tessellation = Tessellation { slices: 28, stacks: 16, quads: 4 };

    fn tables() -> PolygonTables {
        let mut tables = PolygonTables::default();
        tables.prepare(Some(QUALITY));
        tables
    }

    #[test]
    fn angles() {
        for level in all_levels() {
            at_level!(level, s => s.vectorize(#[inline(always)] || {
                for first in (-1800..1800).step_by(LANES) {
                    let deg: [f64; LANES] = std::array::from_fn(|k| (first + k as i32) as f64 / 10.0);
                    let (y, x) = (deg.map(|deg| deg.to_radians().sin() as f32 * 0.7),
                        deg.map(|deg| deg.to_radians().cos() as f32 * 0.7));
                    let found = angle(s, load(s, &y), load(s, &x)).array();
                    for (found, deg) in found.into_iter().zip(deg) {
                        assert!((f64::from(found) - deg).abs() < 2e-3, "{deg}: {found}");
                    }
                }
                assert_eq!(angle(s, splat(s, 0.0), splat(s, 0.0)).array(), [0.0; LANES]);
            }));
        }
    }

    /// A triangle at a point.
    #[derive(Debug)]
    struct Corners {
        positions: [[f32; 3]; 3],
        normals: [[f32; 3]; 3],
        shares: [f32; 3],
    }

    impl Corners {
        fn of<S: Simd>(lanes: &CornerLanes<S>, [a, b, c]: &[F<S>; 3], k: usize) -> Self {
            let at = |v: &V3<S>| [v.x.array()[k], v.y.array()[k], v.z.array()[k]];
            Self {
                positions: lanes.positions.each_ref().map(at),
                normals: lanes.normals.each_ref().map(at),
                shares: [a.array()[k], b.array()[k], c.array()[k]],
            }
        }
    }

    /// The corners are points of the shape with its normals, near the point, which is their weighted mean but for the
    /// height of the shape over the polygon. The number of different polygons is that of the shape's part.
    #[test]
    fn corners_of_shapes() {
        let shapes: [(Shape, f32, f32); 6] = [
            // With the largest distance of a point from its polygon, and the longest edge.
            (Sphere { radius: 0.4 }.into(), 0.006, 0.13),
            (Ellipsoid { radii: [0.5, 0.3, 0.4] }.into(), 0.01, 0.16),
            (Capsule { radius: 0.2, half_length: 0.3 }.into(), 0.004, 0.07),
            (Cylinder { radius: 0.3, half_length: 0.4 }.into(), 0.005, 0.09),
            (Box { half: [0.5, 0.3, 0.4] }.into(), 1e-5, 0.33),
            (Plane { half: [1.0, 2.0] }.into(), 1e-5, 0.8),
        ];
        let tables = tables();
        let lines =
            [PlaneLines { reach: 0.75, step: 0.5, border: 1.0 }, PlaneLines { reach: 1.5, step: 0.5, border: 2.0 }];
        let mut rng = crate::geometry::TestRng(7);
        for (shape, height, edge) in &shapes {
            let mut hits = Vec::new();
            for _ in 0..20_000 {
                let target = rng.point(1.0);
                let origin = [target[0] * 0.3, target[1] * 0.3, 3.0];
                let direction = [target[0] - origin[0], target[1] - origin[1], -3.0];
                let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
                let ray = kinetoscope_scene::Ray { origin, direction: direction.map(|x| x / length) };
                let hit = shape.intersect(&ray, f64::INFINITY);
                hits.extend(hit.map(|hit| [ray.at(hit.t), hit.normal].map(|v| v.map(|x| x as f32))));
            }
            for level in all_levels() {
                let mut seen = std::collections::HashSet::new();
                for sixteen in hits.as_chunks::<LANES>().0 {
                    let lanes = |which: usize, axis: usize| sixteen.map(|hit| hit[which][axis]);
                    let found: Vec<Corners> = at_level!(level, s => s.vectorize(#[inline(always)] || {
                        let v3 = |which: usize| V3 {
                            x: load(s, &lanes(which, 0)),
                            y: load(s, &lanes(which, 1)),
                            z: load(s, &lanes(which, 2)),
                        };
                        let found = tables.at_points(s, shape, lines, v3(0), v3(1));
                        let corners = tables.of_shape(s, shape, lines, &found.numbers);
                        (0..LANES).map(|k| Corners::of(&corners, &found.shares, k)).collect()
                    }));
                    for ([point, normal], found) in sixteen.iter().zip(&found) {
                        let mean =
                            [0, 1, 2].map(|k| (0..3).map(|c| found.shares[c] * found.positions[c][k]).sum::<f32>());
                        assert!(norm(sub(mean, *point)) < *height, "{} {point:?} {found:?}", shape.name());
                        assert!((found.shares.iter().sum::<f32>() - 1.0).abs() < 1e-5);
                        assert!(found.shares.iter().all(|&x| x >= -1e-5));
                        for c in 0..3 {
                            assert!(
                                norm(sub(found.positions[c], *point)) < *edge,
                                "{} {point:?} {found:?}",
                                shape.name()
                            );
                            assert!((dot(found.normals[c], found.normals[c]) - 1.0).abs() < 1e-5);
                            assert!(dot(found.normals[c], *normal) > 0.9, "{} {found:?}", shape.name());
                        }
                        seen.insert(found.positions.map(|p| p.map(|x| (x * 1e4).round() as i32)));
                    }
                }
                assert!(seen.len() > 30, "{}: {}", shape.name(), seen.len());
            }
        }
    }
}

//! Polygons of MuJoCo's OpenGL renderer, which lights surfaces at their corners: the polygon at a point of a shape.
//!
//! Visibility and depth stay those of the shapes. Only light is computed at the corners and interpolated.

use super::light::cos_deg;
use super::surface::{InstanceSurface, Surface};
use super::texture::floor_lanes;
use crate::simd::{F, LANES, M, Simd, V3, abs, load, max, min, select, splat};
use kinetoscope_scene::shape::{RenderMesh, Shape};
use kinetoscope_scene::{PlaneLines, Tessellation};

/// Corners of the polygons, triangles, at sixteen points of a surface.
#[derive(Clone, Copy)]
pub(crate) struct CornerLanes<S: Simd> {
    /// Positions in the world \[m\].
    pub(crate) positions: [V3<S>; 3],
    /// Unit normals, world frame; outward, whatever side is visible.
    pub(crate) normals: [V3<S>; 3],
    /// Barycentric coordinates of the points.
    pub(crate) shares: [F<S>; 3],
}

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

    /// Corners of the polygons at the selected points of an instance; `triangle` has the index of the triangle of its
    /// `mesh` in each lane.
    #[inline(always)]
    pub(crate) fn corners<S: Simd>(
        &self,
        s: S,
        source: &InstanceSurface<'_>,
        mesh: Option<&RenderMesh>,
        triangle: &[u32; LANES],
        at: &Surface<S>,
        lanes: M<S>,
    ) -> CornerLanes<S> {
        match mesh {
            Some(mesh) => of_mesh(s, source, mesh, triangle, at.local_position, lanes.to_bitmask()),
            None => self.of_instance(s, source, at),
        }
    }

    /// Corners at points of an instance that is a shape with a closed form. One copy per instruction set.
    #[inline(never)]
    fn of_instance<S: Simd>(&self, s: S, source: &InstanceSurface<'_>, at: &Surface<S>) -> CornerLanes<S> {
        s.vectorize(
            #[inline(always)]
            || {
                let rotation = &source.world_from_instance.rotation;
                let into_local = [0, 1, 2].map(|j| [0, 1, 2].map(|i| rotation[i][j]));
                let normal = at.normal.rotate(&into_local);
                let corners = self.of_shape(s, &source.instance.shape, source.plane_lines, at.local_position, normal);
                corners.into_world(s, source)
            },
        )
    }

    /// Triangles at points of a shape with a closed form, where it has these outward normals (or their opposites), in the
    /// frame of the shape.
    #[inline(always)]
    fn of_shape<S: Simd>(
        &self,
        s: S,
        shape: &Shape,
        lines: [PlaneLines; 2],
        p: V3<S>,
        normal: V3<S>,
    ) -> CornerLanes<S> {
        let quality = self.tessellation.unwrap_or_default();
        let (zero, one) = (splat(s, 0.0), splat(s, 1.0));
        let minus = splat(s, -1.0);
        match shape {
            Shape::Plane(_) => {
                let (x, u) = LineLanes::of(s, lines[0]).cell(s, p.x);
                let (y, v) = LineLanes::of(s, lines[1]).cell(s, p.y);
                let up = V3 { x: zero, y: zero, z: one };
                Quad::new(s, [u, v], one.simd_eq(one)).corners(
                    #[inline(always)]
                    |right, upper| (V3 { x: pick(right, x), y: pick(upper, y), z: zero }, up),
                )
            }
            Shape::Box(cuboid) => {
                let (nx, ny, nz) = (abs(normal.x), abs(normal.y), abs(normal.z));
                let by_x = nx.simd_ge(ny) & nx.simd_ge(nz);
                let by_z = !by_x & nz.simd_gt(ny);
                let by_y = !by_x & !by_z;
                // The visible side tells the face, also from inside.
                let on_axis = select(by_x, p.x, select(by_y, p.y, p.z));
                let side = select(on_axis.simd_lt(zero), minus, one);
                let half = cuboid.half.map(|half| splat(s, half));
                let count = f32::from(quality.quads.clamp(1, MAX_POLYGONS));
                let lines = {
                    #[inline(always)]
                    |half: F<S>| LineLanes { reach: half, step: half * 2.0 / count, border: half }
                };
                let (x, u) = lines(select(by_x, half[1], half[0])).cell(s, select(by_x, p.y, p.x));
                let (y, v) = lines(select(by_z, half[1], half[2])).cell(s, select(by_z, p.y, p.z));
                let is_outer = side.simd_gt(zero);
                let is_anti = (is_outer & !by_y) | (!is_outer & by_y);
                let [half_x, half_y, half_z] = half;
                let normal =
                    V3 { x: select(by_x, side, zero), y: select(by_y, side, zero), z: select(by_z, side, zero) };
                Quad::new(s, [u, v], is_anti).corners(
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
            Shape::Sphere(sphere) => self.of_ball(s, [sphere.radius; 3], p, zero),
            Shape::Ellipsoid(ellipsoid) => self.of_ball(s, ellipsoid.radii, p, zero),
            Shape::Capsule(capsule) => {
                let (radius, half) = (capsule.radius, capsule.half_length);
                let is_end = abs(p.z).simd_gt(splat(s, half));
                let center = select(p.z.simd_lt(zero), splat(s, -half), splat(s, half));
                if is_end.all_true() {
                    return self.of_ball(s, [radius; 3], p, center);
                }
                let tube = self.of_tube(s, radius, half, quality.stacks, p);
                if !is_end.any_true() {
                    return tube;
                }
                CornerLanes::select(is_end, self.of_ball(s, [radius; 3], p, center), tube)
            }
            Shape::Cylinder(cylinder) => {
                let (radius, half) = (cylinder.radius, cylinder.half_length);
                let is_side = abs(normal.z).simd_lt(splat(s, 0.5));
                let tube = self.of_tube(s, radius, half, quality.stacks, p);
                if is_side.all_true() {
                    return tube;
                }
                let side = select(p.z.simd_lt(zero), minus, one);
                let count = f32::from((quality.stacks / 2).clamp(1, MAX_POLYGONS));
                let rings = PlaneLines { reach: radius, step: radius / count, border: radius };
                let (ring, t) = LineLanes::of(s, rings).cell(s, (p.x * p.x + p.y * p.y).sqrt());
                let (cosines, sines, u) = self.slice(s, p.x, p.y);
                let normal = V3 { x: zero, y: zero, z: side };
                let cap = Quad::new(s, [u, t], side.simd_lt(zero)).corners(
                    #[inline(always)]
                    |right, upper| {
                        let r = max(pick(upper, ring), zero);
                        (V3 { x: r * pick(right, cosines), y: r * pick(right, sines), z: side * half }, normal)
                    },
                );
                CornerLanes::select(is_side, tube, cap)
            }
            _ => CornerLanes { positions: [p; 3], normals: [normal; 3], shares: [one, zero, zero] },
        }
    }

    /// Slices of a round shape at points: cosines and sines of their two ends, and the fractions between them.
    #[inline(always)]
    fn slice<S: Simd>(&self, s: S, x: F<S>, y: F<S>) -> ([F<S>; 2], [F<S>; 2], F<S>) {
        let turns = angle(s, y, x) * (1.0 / 360.0);
        let turns = select(turns.simd_lt(splat(s, 0.0)), turns + 1.0, turns);
        ends_of(s, &self.angles, turns)
    }

    /// Triangles of a ball with the centers (0, 0, `center`).
    #[inline(always)]
    fn of_ball<S: Simd>(&self, s: S, radii: [f32; 3], p: V3<S>, center: F<S>) -> CornerLanes<S> {
        let q = V3 { x: p.x / radii[0], y: p.y / radii[1], z: (p.z - center) / radii[2] };
        let (cosines, sines, u) = self.slice(s, q.x, q.y);
        let latitude = angle(s, q.z, (q.x * q.x + q.y * q.y).sqrt()) * (1.0 / 180.0) + 0.5;
        let (flats, ups, v) = ends_of(s, &self.latitudes, latitude);
        Quad::new(s, [u, v], center.simd_eq(center)).corners(
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

    /// Triangles of the side of a cylinder.
    #[inline(always)]
    fn of_tube<S: Simd>(&self, s: S, radius: f32, half: f32, stacks: u16, p: V3<S>) -> CornerLanes<S> {
        let zero = splat(s, 0.0);
        let (cosines, sines, u) = self.slice(s, p.x, p.y);
        let count = f32::from(stacks.clamp(1, MAX_POLYGONS));
        let lines = PlaneLines { reach: half, step: 2.0 * half / count, border: half };
        let (heights, v) = LineLanes::of(s, lines).cell(s, p.z);
        Quad::new(s, [u, v], zero.simd_eq(zero)).corners(
            #[inline(always)]
            |right, upper| {
                let (x, y) = (pick(right, cosines), pick(right, sines));
                (V3 { x: x * radius, y: y * radius, z: pick(upper, heights) }, V3 { x, y, z: zero })
            },
        )
    }
}

impl<S: Simd> CornerLanes<S> {
    /// The same corners in the world.
    #[inline(always)]
    fn into_world(self, s: S, source: &InstanceSurface<'_>) -> Self {
        let world = source.world_from_instance;
        let from = V3::splat(s, world.translation);
        let ([a, b, c], [l, m, n]) = (self.positions, self.normals);
        let positions = [
            a.rotate(&world.rotation).add(from),
            b.rotate(&world.rotation).add(from),
            c.rotate(&world.rotation).add(from),
        ];
        Self {
            positions,
            normals: [l.rotate(&world.rotation), m.rotate(&world.rotation), n.rotate(&world.rotation)],
            ..self
        }
    }

    /// `a` where the mask is set, else `b`.
    #[inline(always)]
    fn select(m: M<S>, a: Self, b: Self) -> Self {
        let v3 = {
            #[inline(always)]
            |a: [V3<S>; 3], b: [V3<S>; 3]| {
                [V3::select(m, a[0], b[0]), V3::select(m, a[1], b[1]), V3::select(m, a[2], b[2])]
            }
        };
        let (p, q) = (a.shares, b.shares);
        Self {
            positions: v3(a.positions, b.positions),
            normals: v3(a.normals, b.normals),
            shares: [select(m, p[0], q[0]), select(m, p[1], q[1]), select(m, p[2], q[2])],
        }
    }
}

/// The second of two ends where the mask is set, else the first.
#[inline(always)]
fn pick<S: Simd>(second: M<S>, [a, b]: [F<S>; 2]) -> F<S> {
    select(second, b, a)
}

/// [`PlaneLines`] of sixteen points.
#[derive(Clone, Copy)]
struct LineLanes<S: Simd> {
    reach: F<S>,
    step: F<S>,
    border: F<S>,
}

impl<S: Simd> LineLanes<S> {
    #[inline(always)]
    fn of(s: S, lines: PlaneLines) -> Self {
        Self { reach: splat(s, lines.reach), step: splat(s, lines.step), border: splat(s, lines.border) }
    }

    /// [`PlaneLines::cell`]: the two lines around coordinates, and the fractions of the way between them.
    #[inline(always)]
    fn cell(self, s: S, x: F<S>) -> ([F<S>; 2], F<S>) {
        let Self { reach, step, border } = self;
        let (zero, one) = (splat(s, 0.0), splat(s, 1.0));
        let line = floor_lanes(s, (x + reach) / step);
        let (before, behind) = (x.simd_lt(-reach), x.simd_ge(reach));
        let low = select(before, -border, select(behind, reach, line * step - reach));
        let high = select(before, -reach, select(behind, border, (line + 1.0) * step - reach));
        let width = high - low;
        let is_wide = width.simd_gt(zero);
        let fraction = (x - low) / select(is_wide, width, one);
        ([low, high], select(is_wide, min(max(fraction, zero), one), zero))
    }
}

/// Triangles of quadrilaterals at fractions of their width and height. OpenGL splits some from the lower right to the
/// upper left corner, others from the lower left to the upper right one.
#[derive(Clone, Copy)]
struct Quad<S: Simd> {
    /// Masks of the corners that are right, and upper.
    right: [M<S>; 3],
    upper: [M<S>; 3],
    shares: [F<S>; 3],
}

impl<S: Simd> Quad<S> {
    /// `is_anti` is set for those that are split from the lower right to the upper left corner.
    #[inline(always)]
    fn new(s: S, [u, v]: [F<S>; 2], is_anti: M<S>) -> Self {
        let one = splat(s, 1.0);
        let (nothing, everything) = (one.simd_lt(one), one.simd_eq(one));
        let (is_upper, is_right) = ((u + v).simd_gt(one), u.simd_gt(v));
        let anti =
            [select(is_upper, one - v, u), select(is_upper, one - u, v), select(is_upper, u + v - 1.0, one - u - v)];
        let other = [select(is_right, one - u, one - v), select(is_right, v, u), select(is_right, u - v, v - u)];
        Self {
            right: [is_anti, !is_anti, (is_anti & is_upper) | (!is_anti & is_right)],
            upper: [nothing, everything, (is_anti & is_upper) | !(is_anti | is_right)],
            shares: [
                select(is_anti, anti[0], other[0]),
                select(is_anti, anti[1], other[1]),
                select(is_anti, anti[2], other[2]),
            ],
        }
    }

    /// The corners; `corner` has the position and the normal of a corner: right or not, upper or not.
    #[inline(always)]
    fn corners(self, corner: impl Fn(M<S>, M<S>) -> (V3<S>, V3<S>)) -> CornerLanes<S> {
        let Self { right, upper, shares } = self;
        let ends = [corner(right[0], upper[0]), corner(right[1], upper[1]), corner(right[2], upper[2])];
        let [(a, l), (b, m), (c, n)] = ends;
        CornerLanes { positions: [a, b, c], normals: [l, m, n], shares }
    }
}

/// Both numbers of the entries of a table around fractions of its length, and the fractions between them.
#[inline(always)]
fn ends_of<S: Simd>(s: S, table: &[[f32; 2]], fraction: F<S>) -> ([F<S>; 2], [F<S>; 2], F<S>) {
    let count = table.len().saturating_sub(1).max(1) as f32;
    let (zero, one) = (splat(s, 0.0), splat(s, 1.0));
    let at = fraction * count;
    // Also for lanes of other instances, whose numbers may be anything.
    let index = max(min(floor_lanes(s, at), splat(s, count - 1.0)), zero);
    let indices: [i32; LANES] = index.to_int().array();
    let mut ends = [[[0.0f32; LANES]; 2]; 2];
    for (k, &index) in indices.iter().enumerate() {
        for (end, entry) in table.iter().skip(index as usize).take(2).enumerate() {
            (ends[0][end][k], ends[1][end][k]) = (entry[0], entry[1]);
        }
    }
    let [[a, b], [c, d]] = &ends;
    ([load(s, a), load(s, b)], [load(s, c), load(s, d)], min(max(at - index, zero), one))
}

/// Triangles of a mesh at points of it, in the world. Lanes that are not in `lanes` copy one that is.
#[inline(never)]
fn of_mesh<S: Simd>(
    s: S,
    source: &InstanceSurface<'_>,
    mesh: &RenderMesh,
    triangle: &[u32; LANES],
    point: V3<S>,
    lanes: u64,
) -> CornerLanes<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let zero = [[0.0f32; LANES]; 3];
            let (mut p, mut n) = ([zero; 3], [zero; 3]);
            let fill = (lanes.trailing_zeros() as usize).min(LANES - 1);
            let (positions, normals) = (mesh.positions(), mesh.normals());
            for k in 0..LANES {
                let from = if lanes >> k & 1 == 1 { k } else { fill };
                let corners = mesh.triangles()[triangle[from] as usize];
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
            let [a, b, c] = [v3(&p[0]), v3(&p[1]), v3(&p[2])];
            let (ab, ac, w) = (b.sub(a), c.sub(a), point.sub(a));
            let normal = ab.cross(ac);
            let area = normal.dot(normal);
            let (zero, one) = (splat(s, 0.0), splat(s, 1.0));
            let has_area = area.simd_gt(zero);
            let inverse = select(has_area, 1.0 / select(has_area, area, one), zero);
            let kb = min(max(w.cross(ac).dot(normal) * inverse, zero), one);
            let kc = min(max(ab.cross(w).dot(normal) * inverse, zero), one - kb);
            let corners = CornerLanes {
                positions: [a, b, c],
                normals: [v3(&n[0]), v3(&n[1]), v3(&n[2])],
                shares: [one - kb - kc, kb, kc],
            };
            corners.into_world(s, source)
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
            at_level!(level, s => {
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
            });
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
        fn of<S: Simd>(lanes: &CornerLanes<S>, k: usize) -> Self {
            let at = |v: &V3<S>| [v.x.array()[k], v.y.array()[k], v.z.array()[k]];
            let [a, b, c] = &lanes.shares;
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
                    let found: Vec<Corners> = at_level!(level, s => {
                        let v3 = |which: usize| V3 {
                            x: load(s, &lanes(which, 0)),
                            y: load(s, &lanes(which, 1)),
                            z: load(s, &lanes(which, 2)),
                        };
                        let found = tables.of_shape(s, shape, lines, v3(0), v3(1));
                        (0..LANES).map(|k| Corners::of(&found, k)).collect()
                    });
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

    /// The lines around coordinates are those of [`PlaneLines::cell`].
    #[test]
    fn cells() {
        let lines = PlaneLines { reach: 1.0, step: 0.5, border: 1.25 };
        for first in (-140..140).step_by(LANES) {
            let x: [f32; LANES] = std::array::from_fn(|k| 0.01 * (first + k as i32) as f32);
            for level in all_levels() {
                at_level!(level, s => {
                    let ([low, high], fraction) = LineLanes::of(s, lines).cell(s, load(s, &x));
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
                    let found = Quad::new(s, [splat(s, u), splat(s, v)], is_anti).corners(|right, upper| {
                        let at = V3 { x: pick(right, [zero, one]), y: pick(upper, [zero, splat(s, 3.0)]), z: zero };
                        (at, at)
                    });
                    let Corners { positions, shares, .. } = Corners::of(&found, 5);
                    (0..3).map(|c| shares[c] * (positions[c][0] * positions[c][1])).sum::<f32>()
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

//! Polygons of MuJoCo's OpenGL renderer, which lights surfaces at their corners: the polygon at a point of a shape.
//!
//! Visibility and depth stay those of the shapes. Only light is computed at the corners and interpolated.

use super::light::cos_deg;
use super::surface::{InstanceSurface, Surface};
use crate::simd::{F, LANES, M, Simd, V3, load};
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

/// A triangle around a point, in the frame of the instance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Corners {
    positions: [[f32; 3]; 3],
    normals: [[f32; 3]; 3],
    shares: [f32; 3],
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
        let (point, normal) = (at.local_position, at.normal);
        let point = [point.x.array(), point.y.array(), point.z.array()];
        let normal = [normal.x.array(), normal.y.array(), normal.z.array()];
        let lanes = lanes.to_bitmask();
        let found = match mesh {
            Some(mesh) => corners_of_lanes(lanes, |k| of_mesh(mesh, triangle[k] as usize, point.map(|axis| axis[k]))),
            None => self.of_shape_lanes(lanes, source, &point, &normal),
        };
        let world = source.world_from_instance;
        let v3 = |a: &[[f32; LANES]; 3]| V3 { x: load(s, &a[0]), y: load(s, &a[1]), z: load(s, &a[2]) };
        let [a, b, c] = &found.positions;
        let place = {
            #[inline(always)]
            |a: &[[f32; LANES]; 3]| v3(a).rotate(&world.rotation).add(V3::splat(s, world.translation))
        };
        let positions = [place(a), place(b), place(c)];
        let [a, b, c] = &found.normals;
        let normals = [v3(a).rotate(&world.rotation), v3(b).rotate(&world.rotation), v3(c).rotate(&world.rotation)];
        let [a, b, c] = &found.shares;
        CornerLanes { positions, normals, shares: [load(s, a), load(s, b), load(s, c)] }
    }

    /// Triangles at points of a shape with a closed form. One copy for all instruction sets.
    #[inline(never)]
    fn of_shape_lanes(
        &self,
        lanes: u64,
        source: &InstanceSurface<'_>,
        point: &[[f32; LANES]; 3],
        normal: &[[f32; LANES]; 3],
    ) -> CornerArrays {
        let rotation = source.world_from_instance.rotation;
        corners_of_lanes(lanes, |k| {
            let normal = [0, 1, 2].map(|j| (0..3).map(|i| rotation[i][j] * normal[i][k]).sum::<f32>());
            self.of_shape(&source.instance.shape, source.plane_lines, [0, 1, 2].map(|axis| point[axis][k]), normal)
        })
    }

    /// Triangle at a point of a shape with a closed form, where it has this outward normal (or its opposite).
    fn of_shape(&self, shape: &Shape, lines: [PlaneLines; 2], p: [f32; 3], normal: [f32; 3]) -> Corners {
        let quality = self.tessellation.unwrap_or_default();
        match shape {
            Shape::Plane(_) => {
                let [(x, s), (y, t)] = [0, 1].map(|k| lines[k].cell(p[k]));
                quad([s, t], true, |u, v| ([x[usize::from(u)], y[usize::from(v)], 0.0], [0.0, 0.0, 1.0]))
            }
            Shape::Box(cuboid) => {
                let axis = (0..3).fold(0, |a, b| if normal[b].abs() > normal[a].abs() { b } else { a });
                // The visible side tells the face, also from inside.
                let side = if p[axis] < 0.0 { -1.0 } else { 1.0 };
                let [right, up] = [[1, 2], [0, 2], [0, 1]][axis];
                let count = f32::from(quality.quads.clamp(1, MAX_POLYGONS));
                let [(x, s), (y, t)] = [right, up].map(|k| {
                    let half = cuboid.half[k];
                    PlaneLines { reach: half, step: 2.0 * half / count, border: half }.cell(p[k])
                });
                let is_anti = (side > 0.0) != (axis == 1);
                quad([s, t], is_anti, |u, v| {
                    let (mut position, mut normal) = ([side * cuboid.half[axis]; 3], [0.0; 3]);
                    (position[right], position[up]) = (x[usize::from(u)], y[usize::from(v)]);
                    normal[axis] = side;
                    (position, normal)
                })
            }
            Shape::Sphere(sphere) => self.of_ball([sphere.radius; 3], p, 0.0),
            Shape::Ellipsoid(ellipsoid) => self.of_ball(ellipsoid.radii, p, 0.0),
            Shape::Capsule(capsule) => {
                let (radius, half) = (capsule.radius, capsule.half_length);
                if p[2].abs() > half {
                    self.of_ball([radius; 3], p, half.copysign(p[2]))
                } else {
                    self.of_tube(radius, half, quality.stacks, p)
                }
            }
            Shape::Cylinder(cylinder) => {
                let (radius, half) = (cylinder.radius, cylinder.half_length);
                if normal[2].abs() < 0.5 {
                    return self.of_tube(radius, half, quality.stacks, p);
                }
                let side = if p[2] < 0.0 { -1.0 } else { 1.0 };
                let count = f32::from((quality.stacks / 2).clamp(1, MAX_POLYGONS));
                let rings = PlaneLines { reach: radius, step: radius / count, border: radius };
                let (ring, t) = rings.cell((p[0] * p[0] + p[1] * p[1]).sqrt());
                let (angles, s) = self.slice(p);
                quad([s, t], side < 0.0, |u, v| {
                    let ([c, z], r) = (angles[usize::from(u)], ring[usize::from(v)].max(0.0));
                    ([r * c, r * z, side * half], [0.0, 0.0, side])
                })
            }
            _ => Corners { positions: [p; 3], normals: [normal; 3], shares: [1.0, 0.0, 0.0] },
        }
    }

    /// Slice of a round shape at a point: its two ends, and the fraction between them.
    fn slice(&self, p: [f32; 3]) -> ([[f32; 2]; 2], f32) {
        let count = self.angles.len().saturating_sub(1).max(1);
        let turns = angle(p[1], p[0]) * (1.0 / 360.0);
        let at = (if turns < 0.0 { turns + 1.0 } else { turns }) * count as f32;
        let index = (at as usize).min(count - 1);
        let end = |k: usize| self.angles.get(k).copied().unwrap_or([1.0, 0.0]);
        ([end(index), end(index + 1)], (at - index as f32).clamp(0.0, 1.0))
    }

    /// Triangle of a ball with the center (0, 0, `center`).
    fn of_ball(&self, radii: [f32; 3], p: [f32; 3], center: f32) -> Corners {
        let q = [p[0] / radii[0], p[1] / radii[1], (p[2] - center) / radii[2]];
        let (angles, s) = self.slice(q);
        let count = self.latitudes.len().saturating_sub(1).max(1);
        let at = (angle(q[2], (q[0] * q[0] + q[1] * q[1]).sqrt()) * (1.0 / 180.0) + 0.5) * count as f32;
        let index = (at.max(0.0) as usize).min(count - 1);
        let end = |k: usize| self.latitudes.get(k).copied().unwrap_or([1.0, 0.0]);
        let latitudes = [end(index), end(index + 1)];
        quad([s, (at - index as f32).clamp(0.0, 1.0)], true, |u, v| {
            let ([c, z], [flat, up]) = (angles[usize::from(u)], latitudes[usize::from(v)]);
            let unit = [flat * c, flat * z, up];
            let normal = [0, 1, 2].map(|k| unit[k] / radii[k]);
            ([unit[0] * radii[0], unit[1] * radii[1], unit[2] * radii[2] + center], unit_vector(normal))
        })
    }

    /// Triangle of the side of a cylinder.
    fn of_tube(&self, radius: f32, half: f32, stacks: u16, p: [f32; 3]) -> Corners {
        let (angles, s) = self.slice(p);
        let count = f32::from(stacks.clamp(1, MAX_POLYGONS));
        let (heights, t) = PlaneLines { reach: half, step: 2.0 * half / count, border: half }.cell(p[2]);
        quad([s, t], true, |u, v| {
            let [c, z] = angles[usize::from(u)];
            ([radius * c, radius * z, heights[usize::from(v)]], [c, z, 0.0])
        })
    }
}

/// Triangles of sixteen points.
#[derive(Clone, Debug)]
struct CornerArrays {
    positions: [[[f32; LANES]; 3]; 3],
    normals: [[[f32; LANES]; 3]; 3],
    shares: [[f32; LANES]; 3],
}

/// Triangles of the selected lanes. Lanes of other instances copy one, so that all numbers stay finite.
#[inline(always)]
fn corners_of_lanes(lanes: u64, of: impl Fn(usize) -> Corners) -> CornerArrays {
    let zero = [[0.0f32; LANES]; 3];
    let mut out = CornerArrays { positions: [zero; 3], normals: [zero; 3], shares: zero };
    let fill = (lanes.trailing_zeros() as usize).min(LANES - 1);
    let first = of(fill);
    for k in 0..LANES {
        let one = if lanes >> k & 1 == 1 && k != fill { of(k) } else { first };
        for c in 0..3 {
            for axis in 0..3 {
                out.positions[c][axis][k] = one.positions[c][axis];
                out.normals[c][axis][k] = one.normals[c][axis];
            }
            out.shares[c][k] = one.shares[c];
        }
    }
    out
}

fn unit_vector(v: [f32; 3]) -> [f32; 3] {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    v.map(|x| x / length)
}

/// Triangle of a quadrilateral at fractions of its width and height. OpenGL splits it from the lower right to the upper
/// left corner if `is_anti`, else from the lower left to the upper right one. `corner` has the position and the normal
/// of a corner: right or not, upper or not.
fn quad([s, t]: [f32; 2], is_anti: bool, corner: impl Fn(bool, bool) -> ([f32; 3], [f32; 3])) -> Corners {
    let (corners, shares) = if is_anti {
        let upper = s + t > 1.0;
        let shares = if upper { [1.0 - t, 1.0 - s, s + t - 1.0] } else { [s, t, 1.0 - s - t] };
        ([(true, false), (false, true), (upper, upper)], shares)
    } else {
        let right = s > t;
        let shares = if right { [1.0 - s, t, s - t] } else { [1.0 - t, s, t - s] };
        ([(false, false), (true, true), (right, !right)], shares)
    };
    let ends = corners.map(|(u, v)| corner(u, v));
    Corners { positions: ends.map(|(position, _)| position), normals: ends.map(|(_, normal)| normal), shares }
}

/// Triangle of a mesh at a point of it.
fn of_mesh(mesh: &RenderMesh, triangle: usize, point: [f32; 3]) -> Corners {
    let corners = mesh.triangles()[triangle].map(|i| i as usize);
    let positions = corners.map(|i| mesh.positions()[i]);
    let sub = |a: [f32; 3], b: [f32; 3]| [0, 1, 2].map(|k| a[k] - b[k]);
    let cross =
        |a: [f32; 3], b: [f32; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let [ab, ac, w] = [positions[1], positions[2], point].map(|p| sub(p, positions[0]));
    let normal = cross(ab, ac);
    let area = dot(normal, normal);
    let inverse = if area > 0.0 { 1.0 / area } else { 0.0 };
    let b = (dot(cross(w, ac), normal) * inverse).clamp(0.0, 1.0);
    let c = (dot(cross(ab, w), normal) * inverse).clamp(0.0, 1.0 - b);
    Corners { positions, normals: corners.map(|i| mesh.normals()[i]), shares: [1.0 - b - c, b, c] }
}

/// Angle of the vector (x, y) from the x axis \[deg\], -180 to 180: a polynomial, within 0.001 degrees, because `atan2`
/// differs from machine to machine. Source of the polynomial: a minimax fit of the arc tangent on 0..=1.
fn angle(y: f32, x: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let (small, large) = if ax < ay { (ax, ay) } else { (ay, ax) };
    if large <= 0.0 {
        return 0.0;
    }
    let r = small / large;
    let k = r * r;
    let series = ((((-0.011_721_2 * k + 0.052_653_32) * k - 0.116_432_87) * k + 0.193_543_46) * k - 0.332_623_47) * k;
    let deg = (series + 0.999_977_26) * r * (180.0 / std::f32::consts::PI);
    let deg = if ax < ay { 90.0 - deg } else { deg };
    let deg = if x < 0.0 { 180.0 - deg } else { deg };
    if y < 0.0 { -deg } else { deg }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_scene::shape::{Box, Capsule, Cylinder, Ellipsoid, Plane, Sphere};

    const QUALITY: Tessellation = Tessellation { slices: 28, stacks: 16, quads: 4 };

    fn tables() -> PolygonTables {
        let mut tables = PolygonTables::default();
        tables.prepare(Some(QUALITY));
        tables
    }

    #[test]
    fn angles() {
        for k in -1800..1800 {
            let deg = f64::from(k) / 10.0;
            let (y, x) = (deg.to_radians().sin() * 0.7, deg.to_radians().cos() * 0.7);
            assert!((f64::from(angle(y as f32, x as f32)) - deg).abs() < 2e-3, "{deg}");
        }
        assert_eq!(angle(0.0, 0.0), 0.0);
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
            let mut seen = std::collections::HashSet::new();
            for _ in 0..20_000 {
                let target = rng.point(1.0);
                let origin = [target[0] * 0.3, target[1] * 0.3, 3.0];
                let direction = [target[0] - origin[0], target[1] - origin[1], -3.0];
                let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
                let ray = kinetoscope_scene::Ray { origin, direction: direction.map(|x| x / length) };
                let Some(hit) = shape.intersect(&ray, f64::INFINITY) else { continue };
                let point = ray.at(hit.t).map(|x| x as f32);
                let found = tables.of_shape(shape, lines, point, hit.normal.map(|x| x as f32));
                let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
                let mean = [0, 1, 2].map(|k| (0..3).map(|c| found.shares[c] * found.positions[c][k]).sum::<f32>());
                let off = [0, 1, 2].map(|k| mean[k] - point[k]);
                assert!(dot(off, off).sqrt() < *height, "{} {point:?} {found:?}", shape.name());
                assert!((found.shares.iter().sum::<f32>() - 1.0).abs() < 1e-5);
                assert!(found.shares.iter().all(|&x| x >= -1e-5));
                for c in 0..3 {
                    let to = [0, 1, 2].map(|k| found.positions[c][k] - point[k]);
                    assert!(dot(to, to).sqrt() < *edge, "{} {point:?} {found:?}", shape.name());
                    assert!((dot(found.normals[c], found.normals[c]) - 1.0).abs() < 1e-5);
                    assert!(dot(found.normals[c], hit.normal.map(|x| x as f32)) > 0.9, "{} {found:?}", shape.name());
                }
                seen.insert(found.positions.map(|p| p.map(|x| (x * 1e4).round() as i32)));
            }
            assert!(seen.len() > 30, "{}: {}", shape.name(), seen.len());
        }
    }

    /// Interpolation is continuous across both diagonals of a quadrilateral, and exact at its corners.
    #[test]
    fn diagonals() {
        let value = |s: f32, t: f32, anti: bool| {
            let found =
                quad([s, t], anti, |u, v| ([f32::from(u8::from(u)), 3.0 * f32::from(u8::from(v)), 0.0], [0.0; 3]));
            (0..3).map(|c| found.shares[c] * (found.positions[c][0] * found.positions[c][1])).sum::<f32>()
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

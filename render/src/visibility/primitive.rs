//! Intersection of rays with closed-form shapes, sixteen at a time.
//!
//! All solids are convex: a ray is inside of a solid over an interval. The nearest surface in front of `near` is the
//! start of the interval, or its end if the camera is inside.
//!
//! The shapes listed below have SIMD code for sixteen rays in single precision. Other shapes are intersected ray by
//! ray, in double precision.

use crate::simd::{F, LANES, M, Simd, U, V3, abs, load, load_u, max, min, select, select_u, splat, splat_u};
use kinetoscope_scene::Ray;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::vector::{add_scaled, dot, scale};

/// Hits of sixteen rays with a shape.
#[derive(Clone, Copy)]
pub(crate) struct PrimitiveHit<S: Simd> {
    pub(crate) hit: M<S>,
    /// Parameter of the ray: the depth \[m\].
    pub(crate) t: F<S>,
    /// Outward normal, of any length.
    pub(crate) normal: V3<S>,
    /// Index of the smooth part of the surface, smaller than [`kinetoscope_scene::RenderScene::IDS_OF_PRIMITIVE`].
    pub(crate) face: U<S>,
}

/// Intervals of the rays inside of a convex body.
#[derive(Clone, Copy)]
struct Interval<S: Simd> {
    enter: F<S>,
    leave: F<S>,
}

/// The first surface at or behind `near`: lanes with a hit, parameter, and lanes whose rays enter the solid there. An
/// interval that leaves before it enters is empty.
#[inline(always)]
fn first_surface<S: Simd>(s: S, i: Interval<S>, near: f32) -> (M<S>, F<S>, M<S>) {
    let near = splat(s, near);
    let outside = i.enter.simd_ge(near);
    let t = select(outside, i.enter, i.leave);
    // Infinite ends belong to rays along the surface.
    (i.enter.simd_le(i.leave) & t.simd_ge(near) & t.simd_lt(splat(s, f32::MAX)), t, outside)
}

/// Replaces numbers below 1e-18 in magnitude by 1e-18, so that a division is finite or a clean infinity.
#[inline(always)]
fn nonzero<S: Simd>(s: S, d: F<S>) -> F<S> {
    select(abs(d).simd_lt(splat(s, 1e-18)), splat(s, 1e-18), d)
}

const EMPTY: f32 = f32::INFINITY;

/// A ball about the origin, in coordinates where it is round. The distance of the ray from the center is computed at
/// the ray's closest point; the discriminant would cancel for small balls far away. Source: Haines et al., Precision
/// improvements for ray/sphere intersection, Ray Tracing Gems, 2019.
#[inline(always)]
fn intersect_sphere<S: Simd>(s: S, o: V3<S>, d: V3<S>, radius: f32) -> Interval<S> {
    let dd = d.dot(d);
    let middle = -(o.dot(d) / dd);
    let p = o.add(d.scale(middle));
    let rest = splat(s, radius * radius) - p.dot(p);
    let hit = rest.simd_ge(splat(s, 0.0));
    if !hit.any_true() {
        return Interval { enter: splat(s, EMPTY), leave: splat(s, -EMPTY) };
    }
    let half = (max(rest, splat(s, 0.0)) / dd).sqrt();
    Interval { enter: select(hit, middle - half, splat(s, EMPTY)), leave: select(hit, middle + half, splat(s, -EMPTY)) }
}

/// An infinite cylinder about z.
#[inline(always)]
fn infinite_cylinder<S: Simd>(s: S, o: V3<S>, d: V3<S>, radius: f32) -> Interval<S> {
    let dd = d.x * d.x + d.y * d.y;
    let along = dd.simd_lt(splat(s, 1e-18));
    let dd = select(along, splat(s, 1.0), dd);
    let middle = select(along, splat(s, 0.0), -((o.x * d.x + o.y * d.y) / dd));
    let (x, y) = (o.x + d.x * middle, o.y + d.y * middle);
    let rest = splat(s, radius * radius) - (x * x + y * y);
    let hit = rest.simd_ge(splat(s, 0.0));
    if !hit.any_true() {
        return Interval { enter: splat(s, EMPTY), leave: splat(s, -EMPTY) };
    }
    let half = select(along, splat(s, EMPTY), (max(rest, splat(s, 0.0)) / dd).sqrt());
    Interval { enter: select(hit, middle - half, splat(s, EMPTY)), leave: select(hit, middle + half, splat(s, -EMPTY)) }
}

/// The space between -h and h along one axis.
#[inline(always)]
fn slab<S: Simd>(s: S, o: F<S>, d: F<S>, h: f32) -> Interval<S> {
    let inverse = 1.0 / nonzero(s, d);
    let (a, b) = ((-h - o) * inverse, (h - o) * inverse);
    Interval { enter: min(a, b), leave: max(a, b) }
}

#[inline(always)]
fn sign<S: Simd>(s: S, x: F<S>) -> F<S> {
    select(x.simd_lt(splat(s, 0.0)), splat(s, -1.0), splat(s, 1.0))
}

/// Nearness 1/z of a plane. `down` is the slope of the rays, meters along the normal per meter of depth (negative);
/// `height` is that of their origin above the plane \[m\].
#[inline(always)]
pub(crate) fn plane_nearness<S: Simd>(down: F<S>, height: f32) -> F<S> {
    down * (-1.0 / height)
}

/// Intersects rays with a shape that has a closed form, in its own frame. Shapes made of triangles are never hit.
#[inline(always)]
pub(crate) fn intersect<S: Simd>(s: S, shape: &Shape, o: V3<S>, d: V3<S>, near: f32) -> PrimitiveHit<S> {
    let zero = splat(s, 0.0);
    let none = {
        #[inline(always)]
        || PrimitiveHit { hit: zero.simd_gt(zero), t: zero, normal: V3::splat(s, [0.; 3]), face: splat_u(s, 0) }
    };
    match shape {
        Shape::Plane(plane) => {
            let t = -(o.z / nonzero(s, d.z));
            let (x, y) = (o.x + d.x * t, o.y + d.y * t);
            let mut hit = d.z.simd_lt(zero) & t.simd_ge(splat(s, near)) & t.simd_lt(splat(s, f32::MAX));
            for (p, half) in [(x, plane.half[0]), (y, plane.half[1])] {
                if half != 0.0 {
                    hit &= abs(p).simd_le(splat(s, half));
                }
            }
            PrimitiveHit { hit, t, normal: V3::splat(s, [0., 0., 1.]), face: splat_u(s, 0) }
        }
        Shape::Sphere(sphere) => {
            let (hit, t, _) = first_surface(s, intersect_sphere(s, o, d, sphere.radius), near);
            PrimitiveHit { hit, t, normal: o.add(d.scale(t)), face: splat_u(s, 0) }
        }
        Shape::Ellipsoid(ellipsoid) => {
            let k = ellipsoid.radii.map(|r| 1.0 / r);
            let by = {
                #[inline(always)]
                |v: V3<S>| V3 { x: v.x * k[0], y: v.y * k[1], z: v.z * k[2] }
            };
            let (o, d) = (by(o), by(d));
            let (hit, t, _) = first_surface(s, intersect_sphere(s, o, d, 1.0), near);
            // The gradient of x²/a² + ...: the unit ball's normal, scaled once more; of about unit length.
            let small = ellipsoid.radii.iter().copied().fold(f32::MAX, f32::min);
            let p = o.add(d.scale(t));
            let normal = V3 { x: p.x * (k[0] * small), y: p.y * (k[1] * small), z: p.z * (k[2] * small) };
            PrimitiveHit { hit, t, normal, face: splat_u(s, 0) }
        }
        Shape::Capsule(capsule) => {
            let (r, h) = (capsule.radius, capsule.half_length);
            let side = infinite_cylinder(s, o, d, r);
            // The balls at the ends are inside of the tube.
            let near_axis = side.enter.simd_le(side.leave);
            if !near_axis.any_true() {
                return none();
            }
            // Most rays enter through the side, where nothing else is nearer.
            let on_side = near_axis
                & abs(o.z + d.z * side.enter).simd_le(splat(s, h))
                & side.enter.simd_ge(splat(s, near))
                & side.enter.simd_lt(splat(s, f32::MAX));
            let (mut hit, mut t) = (on_side, side.enter);
            if (near_axis & !on_side).any_true() {
                let caps = slab(s, o.z, d.z, h);
                let mut all = Interval { enter: max(side.enter, caps.enter), leave: min(side.leave, caps.leave) };
                let empty = all.enter.simd_gt(all.leave);
                all.enter = select(empty, splat(s, EMPTY), all.enter);
                all.leave = select(empty, splat(s, -EMPTY), all.leave);
                for end in [h, -h] {
                    let one = intersect_sphere(s, V3 { z: o.z - end, ..o }, d, r);
                    all = Interval { enter: min(all.enter, one.enter), leave: max(all.leave, one.leave) };
                }
                let (elsewhere, at, _) = first_surface(s, all, near);
                (hit, t) = (on_side | (elsewhere & near_axis), select(on_side, t, at));
            }
            let p = o.add(d.scale(t));
            let z = p.z - max(min(p.z, splat(s, h)), splat(s, -h));
            PrimitiveHit { hit, t, normal: V3 { x: p.x, y: p.y, z }, face: splat_u(s, 0) }
        }
        Shape::Cylinder(cylinder) => {
            let side = infinite_cylinder(s, o, d, cylinder.radius);
            if !side.enter.simd_le(side.leave).any_true() {
                return none();
            }
            let caps = slab(s, o.z, d.z, cylinder.half_length);
            let all = Interval { enter: max(side.enter, caps.enter), leave: min(side.leave, caps.leave) };
            let (hit, t, outside) = first_surface(s, all, near);
            let p = o.add(d.scale(t));
            let cap = t.simd_eq(select(outside, caps.enter, caps.leave));
            let flat = V3 { x: zero, y: zero, z: sign(s, p.z) };
            let normal = V3::select(cap, flat, V3 { x: p.x, y: p.y, z: zero });
            let faces = select_u(p.z.simd_lt(zero), splat_u(s, 1), splat_u(s, 2));
            PrimitiveHit { hit, t, normal, face: select_u(cap, faces, splat_u(s, 0)) }
        }
        Shape::Box(b) => {
            let x = slab(s, o.x, d.x, b.half[0]);
            let y = slab(s, o.y, d.y, b.half[1]);
            let z = slab(s, o.z, d.z, b.half[2]);
            let all =
                Interval { enter: max(max(x.enter, y.enter), z.enter), leave: min(min(x.leave, y.leave), z.leave) };
            let (hit, t, outside) = first_surface(s, all, near);
            let p = o.add(d.scale(t));
            let by_x = t.simd_eq(select(outside, x.enter, x.leave));
            let by_y = t.simd_eq(select(outside, y.enter, y.leave));
            let axis = {
                #[inline(always)]
                |n: [f32; 3], p: F<S>| V3::splat(s, n).scale(sign(s, p))
            };
            let normal = V3::select(by_y, axis([0., 1., 0.], p.y), axis([0., 0., 1.], p.z));
            let normal = V3::select(by_x, axis([1., 0., 0.], p.x), normal);
            let one = {
                #[inline(always)]
                |k: u32, p: F<S>| select_u(p.simd_lt(zero), splat_u(s, k), splat_u(s, k + 1))
            };
            let face = select_u(by_x, one(0, p.x), select_u(by_y, one(2, p.y), one(4, p.z)));
            PrimitiveHit { hit, t, normal, face }
        }
        _ => ray_by_ray(s, shape, o, d, near),
    }
}

/// Version of [`intersect`] for every shape with a closed form, by [`Shape::intersect`].
#[inline(always)]
fn ray_by_ray<S: Simd>(s: S, shape: &Shape, o: V3<S>, d: V3<S>, near: f32) -> PrimitiveHit<S> {
    let lanes = {
        #[inline(always)]
        |v: V3<S>| [v.x.array(), v.y.array(), v.z.array()]
    };
    let LaneHits { t, normal: [x, y, z], face } = intersect_lanes(shape, lanes(o), lanes(d), near);
    let (t, normal) = (load(s, &t), V3 { x: load(s, &x), y: load(s, &y), z: load(s, &z) });
    PrimitiveHit { hit: t.simd_lt(splat(s, f32::MAX)), t, normal, face: load_u(s, &face) }
}

/// Hits of [`intersect_lanes`], as in [`PrimitiveHit`]; `t` is [`EMPTY`] on a miss.
struct LaneHits {
    t: [f32; LANES],
    normal: [[f32; LANES]; 3],
    face: [u32; LANES],
}

/// Intersects sixteen rays, one after the other. Arguments and result are arrays and not [`V3`], because references to
/// vectors would keep those of [`intersect`] in memory for all shapes.
#[cold]
#[inline(never)]
fn intersect_lanes(shape: &Shape, origins: [[f32; LANES]; 3], directions: [[f32; LANES]; 3], near: f32) -> LaneHits {
    let mut hits = LaneHits { t: [EMPTY; LANES], normal: [[0.0; LANES]; 3], face: [0; LANES] };
    for k in 0..LANES {
        let [o, d] = [&origins, &directions].map(|v| [0, 1, 2].map(|axis| f64::from(v[axis][k])));
        let length = dot(d, d).sqrt();
        // Rays start at the near plane.
        let ray = Ray { origin: add_scaled(o, near.into(), d), direction: scale(d, 1.0 / length) };
        let found = if ray.is_finite() { shape.intersect(&ray, f64::INFINITY) } else { None };
        let Some(found) = found else { continue };
        let inward = dot(found.normal, ray.at(found.t)) < 0.0 && !shape.is_one_sided();
        hits.t[k] = (f64::from(near) + found.t / length) as f32;
        for (lanes, component) in hits.normal.iter_mut().zip(found.normal) {
            lanes[k] = (if inward { -component } else { component }) as f32;
        }
        hits.face[k] = shape.face(&found, &ray) as u32;
    }
    hits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{all_levels, at_level};
    use kinetoscope_scene::shape::{Box, Capsule, Cylinder, Ellipsoid, Plane, Sphere};

    /// The ray-by-ray version agrees with the SIMD code.
    #[test]
    fn rays_one_by_one() {
        let shapes: [Shape; 7] = [
            Plane::INFINITE.into(),
            Plane { half: [0.4, 0.3] }.into(),
            Sphere { radius: 0.4 }.into(),
            Capsule { radius: 0.2, half_length: 0.3 }.into(),
            Ellipsoid { radii: [0.2, 0.3, 0.5] }.into(),
            Cylinder { radius: 0.25, half_length: 0.4 }.into(),
            Box { half: [0.2, 0.3, 0.4] }.into(),
        ];
        let mut rng = crate::geometry::TestRng(41);
        for shape in &shapes {
            let (mut hits, mut differ) = (0, 0);
            for packet in 0..300 {
                // From outside, and from inside; some directions are not of unit length.
                let from = rng.point(if packet % 3 == 0 { 0.15 } else { 2.0 }).map(|x| x as f32);
                let to: [[f64; 3]; LANES] = std::array::from_fn(|_| rng.point(0.5));
                let directions: [[f32; LANES]; 3] =
                    std::array::from_fn(|axis| to.map(|to| to[axis] as f32 - from[axis]));
                for level in all_levels() {
                    at_level!(level, s => s.vectorize(#[inline(always)] || {
                        let [x, y, z] = directions.each_ref().map(|d| load(s, d));
                        let (o, d) = (V3::splat(s, from), V3 { x, y, z });
                        let [fast, general] = [intersect(s, shape, o, d, 0.01), ray_by_ray(s, shape, o, d, 0.01)];
                        let [both, one] = [fast.hit.to_bitmask() & general.hit.to_bitmask(),
                            fast.hit.to_bitmask() ^ general.hit.to_bitmask()];
                        differ += one.count_ones();
                        let [(t, n, f), (t2, n2, f2)] = [&fast, &general].map(|hit| {
                            let n = hit.normal.unit(s);
                            (hit.t.array(), [n.x.array(), n.y.array(), n.z.array()], hit.face.array())
                        });
                        for k in (0..LANES).filter(|k| both >> k & 1 == 1) {
                            hits += 1;
                            let facing: f32 = (0..3).map(|axis| n[axis][k] * n2[axis][k]).sum();
                            // At an edge two faces are equally near.
                            let off = (t[k] - t2[k]).abs();
                            let same = facing > 0.999 && f[k] == f2[k] && off < 1e-4;
                            // Grazing rays lose half of the digits.
                            assert!(off < 5e-3, "{}: {} and {}", shape.name(), t[k], t2[k]);
                            differ += u32::from(!same);
                        }
                    }));
                }
            }
            assert!(hits > 1000 && differ * 500 < hits, "{}: {differ} of {hits}", shape.name());
        }
    }

    /// Triangles are intersected elsewhere.
    #[test]
    fn triangles() {
        let ball = kinetoscope_scene::shape::RenderMesh::new(&Shape::from(Sphere { radius: 0.5 }).tessellate(8), 0.5);
        let shape = Shape::from(kinetoscope_scene::shape::Mesh { mesh: std::sync::Arc::new(ball) });
        for level in all_levels() {
            at_level!(level, s => s.vectorize(#[inline(always)] || {
                let (o, d) = (V3::splat(s, [0.0, 0.0, 2.0]), V3::splat(s, [0.0, 0.0, -1.0]));
                assert!(!intersect(s, &shape, o, d, 0.01).hit.any_true());
            }));
        }
    }
}

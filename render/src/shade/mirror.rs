//! Planar mirrors of rasterized images: one ray from each sample on a mirror, shaded by the rasterizer at its hit. A
//! mirror seen in a mirror shows its own color.

use super::corner_light::{PolygonSource, light_at_corners};
use super::group::{Colors, ShadingContext};
use super::light::{ShadeContext, ViewRays, shade, sky};
use super::shadow_rays::{SurfacePoints, arrays, lanes_of};
use super::surface::{InstanceSurface, Surface, SurfacePointLanes};
use super::tone::BlendSpace;
use crate::geometry::bvh::TraversalStack;
use crate::geometry::interpolation::interpolate_triangle;
use crate::simd::{F, LANES, M, Simd, V3, abs, load, max, min, select, splat};
use crate::trace::motion::END_TIME;
use crate::trace::{Hit, RayTracer, RoundBounds};
use kinetoscope_scene::Ray;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::vector::{add_scaled, dot, scale, sub, to_f64};
use kinetoscope_scene::{Instance, LightingSpace, Marker, RenderScene};
use std::cell::RefCell;

/// Largest number of transparent surfaces that a mirrored ray passes.
const MAX_PASSES: usize = 16;
/// Offset of rays past a surface, as a fraction of the largest coordinate.
const RAY_OFFSET: f64 = 1e-7;
/// A ray ends if less than this fraction of the light is left.
const MIN_THROUGHPUT: f32 = 1e-3;

/// Mirroring surfaces of the scene, and a thread's scratch memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mirrors<'a> {
    pub(crate) tracer: &'a RayTracer,
    pub(crate) stack: &'a RefCell<&'a mut TraversalStack>,
    /// Index of the first instance that mirrors.
    pub(crate) first: usize,
    /// True if no other instance mirrors, as in MuJoCo's renderer.
    pub(crate) only_first: bool,
    /// Bounding box of the objects that mirrored rays may hit; `None` if one of them is unbounded, or if several
    /// instances mirror.
    pub(crate) bounds: Option<ReflectionBounds<'a>>,
}

/// Bounds of the objects that mirrored rays may hit, enlarged by the error of single precision. Rays that miss them, as from
/// most of a floor, are not traced.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReflectionBounds<'a> {
    /// Bounding box of all.
    all: [[f32; 3]; 2],
    each: &'a [RoundBounds],
    /// Index of the mirror, which is convex: mirrored rays do not hit it.
    mirror: u32,
}

impl<'a> ReflectionBounds<'a> {
    /// Enlargement of the box, as a fraction of its size and coordinates.
    const MARGIN: f64 = 1e-3;

    pub(crate) fn new([lo, hi]: [[f64; 3]; 2], each: &'a [RoundBounds], mirror: u32) -> Self {
        let pad = (0..3).map(|k| (hi[k] - lo[k]) + lo[k].abs().max(hi[k].abs())).fold(0.0, f64::max) * Self::MARGIN;
        Self { all: [lo.map(|x| (x - pad) as f32), hi.map(|x| (x + pad) as f32)], each, mirror }
    }

    /// Those of the lanes whose rays, from `origin` in a direction (unit), may hit an object.
    #[inline(always)]
    fn may_intersect<S: Simd>(&self, s: S, origin: V3<S>, direction: V3<S>, lanes: M<S>) -> M<S> {
        let lanes = lanes & self.may_intersect_box(s, origin, direction);
        let mut found = lanes & !lanes;
        for bounds in self.each.iter().filter(|bounds| bounds.instance != self.mirror) {
            let wanted = lanes & !found;
            if !wanted.any_true() {
                break;
            }
            let to = V3::splat(s, bounds.center).sub(origin);
            let (square, along) = (to.dot(to), to.dot(direction));
            let radius = bounds.radius * bounds.radius;
            // The differences lose digits, in proportion to the distance.
            let near = (square - along * along).simd_le(square * 1e-6 + radius)
                & (along.simd_ge(splat(s, 0.0)) | square.simd_le(splat(s, radius)));
            if (wanted & near).any_true() {
                let across = direction.cross(V3::splat(s, bounds.axis));
                let distance = to.dot(across);
                let limit = (square * 1e-9 + bounds.across * bounds.across) * across.dot(across);
                found |= wanted & near & (distance * distance).simd_le(limit + square * 1e-12);
            }
        }
        found
    }

    /// Lanes whose rays may hit the box.
    #[inline(always)]
    fn may_intersect_box<S: Simd>(&self, s: S, origin: V3<S>, direction: V3<S>) -> M<S> {
        let [lo, hi] = &self.all;
        let (mut near, mut far) = (splat(s, 0.0), splat(s, f32::MAX));
        for (o, d, lo, hi) in [
            (origin.x, direction.x, lo[0], hi[0]),
            (origin.y, direction.y, lo[1], hi[1]),
            (origin.z, direction.z, lo[2], hi[2]),
        ] {
            // Directions along the faces would divide by zero.
            let tiny = splat(s, 1e-12);
            let inverse = splat(s, 1.0) / select(abs(d).simd_lt(tiny), tiny, d);
            let (a, b) = ((splat(s, lo) - o) * inverse, (splat(s, hi) - o) * inverse);
            (near, far) = (max(near, min(a, b)), min(far, max(a, b)));
        }
        near.simd_le(far)
    }
}

/// Reflectance of an instance that is a planar mirror, 0..=1; 0 for other shapes and transparent instances.
pub(crate) fn reflectance(instance: &Instance) -> f32 {
    let material = &instance.material;
    match instance.shape {
        Shape::Plane(_) | Shape::Box(_) if material.rgba[3] >= 1.0 => material.reflectance.clamp(0.0, 1.0),
        _ => 0.0,
    }
}

/// Samples on a mirror.
#[derive(Clone, Copy)]
pub(crate) struct MirrorSamples<S: Simd> {
    pub(crate) point: SurfacePointLanes<S>,
    /// Unit vector of the ray from the camera, world frame.
    pub(crate) view: V3<S>,
    /// Meters along the ray per unit of the point's depth.
    pub(crate) length: F<S>,
    /// Color of the mirror without reflections.
    pub(crate) color: V3<S>,
}

/// A mirrored ray, and the distance \[m\] traced so far.
#[derive(Clone, Copy, Debug)]
struct ReflectedRay {
    ray: Ray,
    distance: f64,
    /// Fraction of the light that is left.
    throughput: f32,
}

/// Surfaces in lanes that are set one by one.
#[derive(Clone, Debug)]
struct SurfaceLanes {
    positions: [[f32; LANES]; 3],
    normals: [[f32; LANES]; 3],
    shading: [[f32; LANES]; 3],
    local: [[f32; LANES]; 3],
    uv: [[f32; LANES]; 2],
    uv_density: [f32; LANES],
    shares: [[f32; LANES]; 3],
    distances: [f32; LANES],
}

impl SurfaceLanes {
    const EMPTY: Self = Self {
        positions: [[0.0; LANES]; 3],
        normals: [[0.0; LANES]; 3],
        shading: [[0.0; LANES]; 3],
        local: [[0.0; LANES]; 3],
        uv: [[0.0; LANES]; 2],
        uv_density: [1.0; LANES],
        shares: [[0.0; LANES]; 3],
        distances: [1.0; LANES],
    };

    /// Sets a lane to the hit of a ray.
    fn set(&mut self, k: usize, scene: &RenderScene, reflected: &ReflectedRay, hit: &Hit) {
        let (ray, pose) = (&reflected.ray, &hit.world_from_instance);
        let position = ray.at(hit.distance);
        let side = if dot(hit.normal, ray.direction) < 0.0 { 1.0 } else { -1.0 };
        let (rotation, from) = (pose.rotation, sub(position, pose.translation));
        let local = [0, 1, 2].map(|j| (0..3).map(|i| rotation[i][j] * from[i]).sum::<f64>());
        let mesh = scene.instances()[hit.instance as usize].mesh();
        let corner = mesh.map(|mesh| interpolate_triangle(mesh, hit.triangle as usize, local, side));
        let normal = scale(hit.normal, side);
        let shading = corner.map_or(normal, |corner| {
            let turned = rotation.map(|row| side * dot(row, corner.normal));
            scale(turned, 1.0 / dot(turned, turned).sqrt().max(f64::MIN_POSITIVE))
        });
        let vectors = [
            (&mut self.positions, position),
            (&mut self.normals, normal),
            (&mut self.shading, shading),
            (&mut self.local, local),
        ];
        for (to, from) in vectors {
            (to[0][k], to[1][k], to[2][k]) = (from[0] as f32, from[1] as f32, from[2] as f32);
        }
        let (uv, density) = corner.and_then(|corner| corner.uv).unwrap_or(([0.0; 2], 1.0));
        (self.uv[0][k], self.uv[1][k], self.uv_density[k]) = (uv[0] as f32, uv[1] as f32, density as f32);
        for (to, from) in self.shares.iter_mut().zip(corner.map_or([0.0; 3], |corner| corner.shares)) {
            to[k] = from as f32;
        }
        self.distances[k] = (reflected.distance + hit.distance) as f32;
    }

    #[inline(always)]
    fn surface<S: Simd>(&self, s: S, t: F<S>) -> Surface<S> {
        let v3 = |v: &[[f32; LANES]; 3]| V3 { x: load(s, &v[0]), y: load(s, &v[1]), z: load(s, &v[2]) };
        Surface {
            t,
            normal: v3(&self.normals),
            shading_normal: v3(&self.shading),
            position: v3(&self.positions),
            local_position: v3(&self.local),
            uv: [load(s, &self.uv[0]), load(s, &self.uv[1])],
            uv_density: load(s, &self.uv_density),
            shares: [load(s, &self.shares[0]), load(s, &self.shares[1]), load(s, &self.shares[2])],
        }
    }
}

impl Mirrors<'_> {
    /// True if an instance mirrors.
    #[inline(always)]
    pub(crate) fn has(&self, index: usize, instance: &Instance) -> bool {
        index == self.first || index > self.first && !self.only_first && reflectance(instance) > 0.0
    }

    /// Color of a mirror with its reflection.
    ///
    /// In linear light, `(1 - r) color + r mirrored`; the sky is mirrored too. In MuJoCo's light model, `color +
    /// mirrored` in sRGB, where the surface colors, but not their highlights, are multiplied by r before shading; the
    /// sky is not mirrored.
    #[inline(never)]
    pub(crate) fn reflect<S: Simd>(
        &self,
        s: S,
        context: &ShadingContext<'_>,
        source: &InstanceSurface<'_>,
        samples: MirrorSamples<S>,
        lanes: M<S>,
    ) -> V3<S> {
        s.vectorize(
            #[inline(always)]
            || {
                let MirrorSamples { point, view, length, color } = samples;
                let SurfacePointLanes { normal, depth, .. } = point;
                let up = source.world_from_instance.rotation.map(|row| row[2]);
                let lanes = lanes & normal.dot(V3::splat(s, up)).simd_gt(splat(s, 0.5));
                let mirrored_view = view.sub(normal.scale(view.dot(normal) * 2.0));
                let display = context.shade.scene.lighting_space == LightingSpace::Display;
                let followed = match &self.bounds {
                    Some(reach) => reach.may_intersect(s, point.position, mirrored_view, lanes),
                    None => lanes,
                };
                let wanted = followed.to_bitmask();
                if lanes.to_bitmask() == 0 || display && wanted == 0 {
                    return color;
                }
                let points = SurfacePoints::new(point);
                let (directions, lengths, depths) = (arrays(view), length.array(), depth.array());
                let mut rays = [None; LANES];
                for k in lanes_of(wanted) {
                    let (n, d) = (points.normal(k), to_f64(directions.map(|axis| axis[k])));
                    let mirrored = add_scaled(d, -2.0 * dot(d, n), n);
                    let direction = scale(mirrored, 1.0 / dot(mirrored, mirrored).sqrt());
                    let ray = Ray { origin: points.offset_origin(k), direction };
                    let traveled = f64::from(depths[k]) * f64::from(lengths[k]);
                    rays[k] = Some(ReflectedRay { ray, distance: traveled, throughput: 1.0 });
                }
                let r = reflectance(source.instance);
                let tint = if display { r } else { 1.0 };
                let mut sum: Colors = [[0.0; LANES]; 3];
                let hit_lanes = self.trace_reflections(s, context, &mut rays, tint, length, &mut sum);
                let mut left = [0.0f32; LANES];
                for (left, ray) in left.iter_mut().zip(&rays) {
                    *left = ray.map_or(1.0, |ray| ray.throughput);
                }
                let sum = V3 { x: load(s, &sum[0]), y: load(s, &sum[1]), z: load(s, &sum[2]) };
                if display {
                    if hit_lanes == 0 {
                        return color;
                    }
                    let hit = lanes & mask(s, hit_lanes);
                    let blend = context.shade.lighting.blend;
                    // Written out: a closure that is called three times is compiled without the instruction set.
                    let lit = V3 {
                        x: add(s, blend, color.x, sum.x),
                        y: add(s, blend, color.y, sum.y),
                        z: add(s, blend, color.z, sum.z),
                    };
                    return V3::select(hit, lit, color);
                }
                let beyond = sky(s, context.shade.lighting, mirrored_view, context.shade.pixel.angle());
                let mirrored = sum.add(beyond.scale(load(s, &left)));
                V3::select(lanes, color.scale(splat(s, 1.0 - r)).add(mirrored.scale(splat(s, r))), color)
            },
        )
    }

    /// Adds up the colors that mirrored rays hit, as linear light or as sRGB bytes; returns the lanes with a hit.
    /// `tint` is that of [`shade`].
    #[inline(always)]
    fn trace_reflections<S: Simd>(
        &self,
        s: S,
        context: &ShadingContext<'_>,
        rays: &mut [Option<ReflectedRay>; LANES],
        tint: f32,
        length: F<S>,
        sum: &mut Colors,
    ) -> u64 {
        let (scene, mut at) = (context.shade.scene, SurfaceLanes::EMPTY);
        let display = scene.lighting_space == LightingSpace::Display;
        let blend = context.shade.lighting.blend;
        let lit = ShadeContext { receives_shadows: scene.opengl.is_none(), image_axes: None, ..context.shade };
        let mut hit_lanes = 0;
        for _ in 0..MAX_PASSES {
            let mut hits = [None; LANES];
            let mut left = 0u64;
            {
                let mut stack = self.stack.borrow_mut();
                for (k, reflected) in rays.iter_mut().enumerate() {
                    let Some(reflected) = reflected.as_mut().filter(|r| r.throughput > MIN_THROUGHPUT) else {
                        continue;
                    };
                    hits[k] = self.next(s, scene, reflected, &mut stack);
                    left |= u64::from(hits[k].is_some()) << k;
                }
            }
            if left == 0 {
                break;
            }
            hit_lanes |= left;
            while left != 0 {
                let Some(instance) = hits[left.trailing_zeros() as usize].map(|hit| hit.instance) else { break };
                let mut bits = 0u64;
                let mut directions = [[0.0f32; LANES], [0.0; LANES], [1.0; LANES]];
                for k in lanes_of(left) {
                    let (Some(hit), Some(reflected)) = (&hits[k], &rays[k]) else { continue };
                    if hit.instance == instance {
                        bits |= 1 << k;
                        at.set(k, scene, reflected, hit);
                        for (to, from) in directions.iter_mut().zip(reflected.ray.direction) {
                            to[k] = from as f32;
                        }
                    }
                }
                left &= !bits;
                let source = context.source(instance as usize);
                let distance = load(s, &at.distances);
                let here = at.surface(s, distance / length);
                let [x, y, z] = &directions;
                let direction = V3 { x: load(s, x), y: load(s, y), z: load(s, z) };
                let mirrored = ViewRays { direction, distance };
                let here_lanes = mask(s, bits);
                let corner_light = context.lit_polygons.map(|table| {
                    let triangles = hits.map(|hit| hit.map_or(0, |hit| hit.triangle));
                    let polygons = PolygonSource { index: instance, source: &source, mesh: source.instance.mesh() };
                    light_at_corners(s, &lit, table, polygons, &triangles, &here, mirrored, false, tint, here_lanes)
                });
                let seen = shade(s, &lit, &source, &here, corner_light, mirrored, tint, here_lanes);
                let seen = if display {
                    V3 { x: blend.to_bytes(s, seen.x), y: blend.to_bytes(s, seen.y), z: blend.to_bytes(s, seen.z) }
                } else {
                    seen
                };
                let seen = arrays(seen);
                let alpha = source.instance.material.rgba[3].min(1.0);
                let is_additive = scene.opengl.is_some_and(|rules| rules.is_additive);
                let passed = if is_additive && alpha < 1.0 { 1.0 } else { 1.0 - alpha };
                for k in lanes_of(bits) {
                    let (Some(hit), Some(reflected)) = (&hits[k], &mut rays[k]) else { continue };
                    for (sum, seen) in sum.iter_mut().zip(&seen) {
                        sum[k] += reflected.throughput * alpha * seen[k];
                    }
                    reflected.throughput *= passed;
                    reflected.pass(hit.distance);
                }
            }
        }
        hit_lanes
    }

    /// The next surface along a mirrored ray, without backs of transparent surfaces, or any backs that are
    /// [culled](kinetoscope_scene::OpenGlRules::culls_backs); `None` without one, and after [`MAX_PASSES`] such backs.
    #[inline(always)]
    fn next<S: Simd>(
        &self,
        s: S,
        scene: &RenderScene,
        reflected: &mut ReflectedRay,
        stack: &mut TraversalStack,
    ) -> Option<Hit> {
        for _ in 0..MAX_PASSES {
            let hit = self.tracer.closest_hit(s, &reflected.ray, f64::INFINITY, END_TIME, stack)?;
            let instance = &scene.instances()[hit.instance as usize];
            let culls = scene.opengl.is_some_and(|rules| rules.culls_backs) && instance.group != Marker::GROUP;
            if instance.material.rgba[3] >= 1.0 && !culls || dot(hit.normal, reflected.ray.direction) < 0.0 {
                return Some(hit);
            }
            reflected.pass(hit.distance);
        }
        None
    }
}

impl ReflectedRay {
    /// Moves the ray past a surface.
    fn pass(&mut self, distance: f64) {
        let far = self.ray.origin.iter().fold(distance.max(1.0), |m, x| m.max(x.abs()));
        let onward = distance + RAY_OFFSET * far;
        self.ray.origin = self.ray.at(onward);
        self.distance += onward;
    }
}

/// Mask of the lanes in `bits`.
#[inline(always)]
fn mask<S: Simd>(s: S, bits: u64) -> M<S> {
    let mut set = [0.0f32; LANES];
    for k in lanes_of(bits) {
        set[k] = 1.0;
    }
    load(s, &set).simd_gt(splat(s, 0.5))
}

/// Sum of a color and of sRGB bytes, clamped at white; color and sum are in the space `blend`.
#[inline(always)]
fn add<S: Simd>(s: S, blend: BlendSpace, light: F<S>, byte: F<S>) -> F<S> {
    blend.color_of_bytes(min(max(blend.to_bytes(s, light) + byte, splat(s, 0.0)), splat(s, 255.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::assets::RayAssetCache;
    use crate::raster::Layer;
    use crate::simd::{all_levels, at_level};
    use kinetoscope_testkit::scenes::{TestRng as SceneRng, random_scene};

    /// Rays that hit an object are traced; most of those that miss all are not.
    #[test]
    fn bounds_of_reflections() {
        let mut rng = crate::geometry::TestRng(5);
        let (mut hits, mut misses, mut left_out) = (0, 0, 0);
        for seed in 1..5 {
            let (scene, poses) = random_scene(&mut SceneRng(seed), 1.0);
            let mut tracer = RayTracer::default();
            tracer.prepare_geometry(&scene, &RayAssetCache::default(), |_| Layer::Opaque);
            tracer.place(&scene, &poses, None);
            let all = [[-1e3; 3], [1e3; 3]];
            let bounds = ReflectionBounds::new(all, tracer.round_bounds(), u32::MAX);
            let bounded = |hit: &Hit| bounds.each.iter().any(|bounds| bounds.instance == hit.instance);
            for _ in 0..200 {
                let (mut origins, mut directions) = ([[0.0f32; LANES]; 3], [[0.0f32; LANES]; 3]);
                for k in 0..LANES {
                    let (origin, toward) = (rng.point(4.0), rng.point(1.0));
                    let d = sub(toward, origin);
                    let d = scale(d, 1.0 / dot(d, d).sqrt());
                    for axis in 0..3 {
                        (origins[axis][k], directions[axis][k]) = (origin[axis] as f32, d[axis] as f32);
                    }
                }
                for level in all_levels() {
                    let found = at_level!(level, s => s.vectorize(#[inline(always)] || {
                        let v3 = |v: &[[f32; LANES]; 3]| V3 { x: load(s, &v[0]), y: load(s, &v[1]), z: load(s, &v[2]) };
                        let every = splat(s, 0.0).simd_eq(splat(s, 0.0));
                        bounds.may_intersect(s, v3(&origins), v3(&directions), every).to_bitmask()
                    }));
                    for k in 0..LANES {
                        let ray = Ray {
                            origin: origins.map(|axis| f64::from(axis[k])),
                            direction: directions.map(|axis| f64::from(axis[k])),
                        };
                        let mut stack = TraversalStack::default();
                        let hit = at_level!(all_levels()[0], s => tracer.closest_hit(s, &ray, f64::INFINITY, END_TIME, &mut stack));
                        let is_followed = found >> k & 1 == 1;
                        if hit.as_ref().is_some_and(bounded) {
                            assert!(is_followed, "{ray:?} hits {hit:?}");
                            hits += 1;
                        } else {
                            misses += 1;
                            left_out += usize::from(!is_followed);
                        }
                    }
                }
            }
        }
        assert!(hits > 1000 && left_out * 4 > misses, "{hits} hits, {left_out} of {misses} misses are left out");
    }
}

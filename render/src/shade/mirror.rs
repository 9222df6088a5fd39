//! Planar mirrors of rasterized images: one ray from each sample on a mirror, shaded by the rasterizer at its hit. A
//! mirror seen in a mirror shows its own color.

use super::corner_light::{PolygonSource, light_at_corners};
use super::group::{Colors, ShadingContext};
use super::light::{ShadeContext, ViewRays, shade, sky};
use super::shadow_rays::{SurfacePoints, arrays, offset_origins};
use super::surface::{InstanceSurface, Surface, SurfacePointLanes};
use super::tone::BlendSpace;
use crate::geometry::bvh::TraversalStack;
use crate::geometry::interpolation::interpolate_triangle;
use crate::simd::{F, LANES, M, Simd, V3, load, max, min, splat};
use crate::trace::{Candidates, Hit, RayGroup, RayHit, RayTracer, lanes_of};
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
    pub(crate) candidates: &'a RefCell<&'a mut Candidates>,
    /// Index of the first instance that mirrors.
    pub(crate) first: usize,
    /// True if no other instance mirrors, as in MuJoCo's renderer.
    pub(crate) only_first: bool,
    /// True if mirrored rays can hit bounded objects only, and not the mirror itself: it is the only one, and convex.
    pub(crate) bounded: bool,
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

/// Mirrored rays of the samples.
#[derive(Clone, Debug)]
struct ReflectedRays {
    /// Samples with a ray.
    lanes: u64,
    rays: [Ray; LANES],
    /// Distances traced so far \[m\], from the camera on.
    distances: [f64; LANES],
    /// Fractions of the light that are left; 1 for samples without a ray.
    throughputs: [f32; LANES],
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
    fn set(&mut self, k: usize, scene: &RenderScene, reflected: &ReflectedRays, hit: &Hit) {
        let (ray, pose) = (&reflected.rays[k], &hit.world_from_instance);
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
        self.distances[k] = (reflected.distances[k] + hit.distance) as f32;
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
                // Rotations are accepted with a small error, so normals are not always of length 1.
                let group = RayGroup { origin: offset_origins(point), direction: mirrored_view.unit(s) };
                let candidates = &mut **self.candidates.borrow_mut();
                self.tracer.find_candidates(s, group, lanes, self.skipped(), candidates);
                let wanted = if self.bounded { candidates.lanes() } else { lanes.to_bitmask() };
                if lanes.to_bitmask() == 0 || display && wanted == 0 {
                    return color;
                }
                let points = SurfacePoints::new(point);
                let (directions, lengths, depths) = (arrays(view), length.array(), depth.array());
                let mut rays = ReflectedRays { lanes: wanted, ..ReflectedRays::NONE };
                for k in lanes_of(wanted) {
                    let (n, d) = (points.normal(k), to_f64(directions.map(|axis| axis[k])));
                    let mirrored = add_scaled(d, -2.0 * dot(d, n), n);
                    let direction = scale(mirrored, 1.0 / dot(mirrored, mirrored).sqrt());
                    rays.rays[k] = Ray { origin: points.offset_origin(k), direction };
                    rays.distances[k] = f64::from(depths[k]) * f64::from(lengths[k]);
                }
                let r = reflectance(source.instance);
                let tint = if display { r } else { 1.0 };
                let mut sum: Colors = [[0.0; LANES]; 3];
                let hit_lanes = self.trace_reflections(s, context, candidates, &mut rays, (tint, length), &mut sum);
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
                let mirrored = sum.add(beyond.scale(load(s, &rays.throughputs)));
                V3::select(lanes, color.scale(splat(s, 1.0 - r)).add(mirrored.scale(splat(s, r))), color)
            },
        )
    }

    /// Adds up the colors that mirrored rays hit, as linear light or as sRGB bytes; returns the lanes with a
    /// hit. `candidates` are those of the rays, `tint` is that of [`shade`].
    #[inline(always)]
    fn trace_reflections<S: Simd>(
        &self,
        s: S,
        context: &ShadingContext<'_>,
        candidates: &mut Candidates,
        rays: &mut ReflectedRays,
        (tint, length): (f32, F<S>),
        sum: &mut Colors,
    ) -> u64 {
        let (scene, mut at) = (context.shade.scene, SurfaceLanes::EMPTY);
        let display = scene.lighting_space == LightingSpace::Display;
        let blend = context.shade.lighting.blend;
        let lit = ShadeContext { receives_shadows: scene.opengl.is_none(), image_axes: None, ..context.shade };
        let mut hit_lanes = 0;
        for pass in 0..MAX_PASSES {
            let mut left = 0u64;
            for k in lanes_of(rays.lanes) {
                left |= u64::from(rays.throughputs[k] > MIN_THROUGHPUT) << k;
            }
            if left == 0 {
                break;
            }
            if pass > 0 {
                self.find_candidates(s, rays, left, candidates);
            }
            let hits = self.next(s, scene, candidates, rays, &mut left);
            if left == 0 {
                break;
            }
            hit_lanes |= left;
            // The other rays hit nothing more.
            rays.lanes = left;
            while left != 0 {
                let first = left.trailing_zeros() as usize % LANES;
                let Some(instance) = hits[first].map(|hit| self.tracer.instance_of(&hit)) else { break };
                let (mut bits, mut triangles) = (0u64, [0u32; LANES]);
                let mut directions = [[0.0f32; LANES], [0.0; LANES], [1.0; LANES]];
                for k in lanes_of(left) {
                    let Some(hit) = hits[k].filter(|hit| self.tracer.instance_of(hit) == instance) else { continue };
                    let Some(hit) = self.tracer.surface(&hit) else { continue };
                    bits |= 1 << k;
                    triangles[k] = hit.triangle;
                    at.set(k, scene, rays, &hit);
                    for (to, from) in directions.iter_mut().zip(rays.rays[k].direction) {
                        to[k] = from as f32;
                    }
                }
                if bits == 0 {
                    break;
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
                    let Some(hit) = &hits[k] else { continue };
                    for (sum, seen) in sum.iter_mut().zip(&seen) {
                        sum[k] += rays.throughputs[k] * alpha * seen[k];
                    }
                    rays.throughputs[k] *= passed;
                    rays.pass(k, hit.distance);
                }
            }
        }
        hit_lanes
    }

    /// Instance that mirrored rays do not hit; `None` if they may hit any.
    fn skipped(&self) -> Option<u32> {
        self.bounded.then_some(self.first as u32)
    }

    /// Finds the instances that the rays `lanes` may hit.
    #[inline(always)]
    fn find_candidates<S: Simd>(&self, s: S, reflected: &ReflectedRays, lanes: u64, candidates: &mut Candidates) {
        let group = RayGroup::of(s, &reflected.rays);
        self.tracer.find_candidates(s, group, mask(s, lanes), self.skipped(), candidates);
    }

    /// The next surfaces along the rays `lanes`, without backs of transparent surfaces, or any backs that are
    /// [culled](kinetoscope_scene::OpenGlRules::culls_backs); `None` without one, and after [`MAX_PASSES`] such backs.
    /// `lanes` becomes those with a surface. `candidates` are those of the rays.
    #[inline(always)]
    fn next<S: Simd>(
        &self,
        s: S,
        scene: &RenderScene,
        candidates: &mut Candidates,
        reflected: &mut ReflectedRays,
        lanes: &mut u64,
    ) -> [Option<RayHit>; LANES] {
        let mut stack = self.stack.borrow_mut();
        let mut found = [None; LANES];
        let mut left = std::mem::take(lanes);
        for pass in 0..MAX_PASSES {
            if left == 0 {
                break;
            }
            if pass > 0 {
                self.find_candidates(s, reflected, left, candidates);
            }
            for k in lanes_of(left) {
                found[k] = None;
            }
            self.tracer.closest_hits(s, candidates, &reflected.rays, left, &mut stack, &mut found);
            for k in lanes_of(left) {
                let is_wanted = found[k].map(|hit| (self.is_visible(scene, &hit, &reflected.rays[k]), hit.distance));
                match is_wanted {
                    Some((false, distance)) => reflected.pass(k, distance),
                    other => {
                        left &= !(1 << k);
                        *lanes |= u64::from(other.is_some()) << k;
                    }
                }
            }
        }
        for k in lanes_of(left) {
            found[k] = None;
        }
        found
    }

    /// True if a mirrored ray ends at this surface, or is attenuated by it.
    #[inline(always)]
    fn is_visible(&self, scene: &RenderScene, hit: &RayHit, ray: &Ray) -> bool {
        let instance = &scene.instances()[self.tracer.instance_of(hit) as usize];
        let culls = scene.opengl.is_some_and(|rules| rules.culls_backs) && instance.group != Marker::GROUP;
        instance.material.rgba[3] >= 1.0 && !culls
            || self.tracer.surface(hit).is_some_and(|hit| dot(hit.normal, ray.direction) < 0.0)
    }
}

impl ReflectedRays {
    const NONE: Self = Self {
        lanes: 0,
        rays: [Ray { origin: [0.0; 3], direction: [0.0, 0.0, 1.0] }; LANES],
        distances: [0.0; LANES],
        throughputs: [1.0; LANES],
    };

    /// Moves the ray of lane `k` past a surface.
    fn pass(&mut self, k: usize, distance: f64) {
        let ray = &mut self.rays[k];
        let far = ray.origin.iter().fold(distance.max(1.0), |m, x| m.max(x.abs()));
        let onward = distance + RAY_OFFSET * far;
        ray.origin = ray.at(onward);
        self.distances[k] += onward;
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

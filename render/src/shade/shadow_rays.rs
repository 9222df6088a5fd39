//! Ray-traced shadows and ambient occlusion for rasterized images.

use super::surface::SurfacePointLanes;
use crate::geometry::bvh::TraversalStack;
use crate::path::sobol::SobolSequence;
use crate::simd::{F, LANES, M, Simd, V3, abs, load, splat};
use crate::trace::motion::END_TIME;
use crate::trace::{RayTracer, lanes_of};
use kinetoscope_scene::Ray;
use kinetoscope_scene::basis::OrthonormalBasis;
use kinetoscope_scene::sampling::sample_cosine_hemisphere;
use kinetoscope_scene::vector::{add_scaled, dot, scale, sub, to_f64};
use kinetoscope_scene::{Light, LightKind};
use std::cell::RefCell;

/// Fraction of the way to a light that shadow rays cover: a light on a ceiling is not occluded by it.
pub(crate) const SHADOW_RAY_FRACTION: f64 = 1.0 - 1e-6;

/// Offset of ray origins above the surface, as a fraction of their coordinates and depth: positions are single
/// precision.
const RAY_OFFSET: f32 = 1e-5;

/// Ray tracer for shadows, and a thread's scratch memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadowRays<'a> {
    pub(crate) tracer: &'a RayTracer,
    pub(crate) stack: &'a RefCell<&'a mut TraversalStack>,
    /// True if lights cast shadows.
    pub(crate) shadows: bool,
    /// Rays per sample for ambient occlusion; 0 disables it.
    pub(crate) occlusion_rays: u16,
}

/// Surface points of all lanes, readable lane by lane.
pub(super) struct SurfacePoints {
    positions: [[f32; LANES]; 3],
    normals: [[f32; LANES]; 3],
    depths: [f32; LANES],
}

impl SurfacePoints {
    #[inline(always)]
    pub(super) fn new<S: Simd>(point: SurfacePointLanes<S>) -> Self {
        let SurfacePointLanes { position, normal, depth } = point;
        Self { positions: arrays(position), normals: arrays(normal), depths: depth.array() }
    }

    pub(super) fn normal(&self, k: usize) -> [f64; 3] {
        self.normals.map(|axis| f64::from(axis[k]))
    }

    /// Origin of a ray from the point of lane `k`: the point, moved slightly above the surface, in the world frame
    /// \[m\].
    pub(super) fn offset_origin(&self, k: usize) -> [f64; 3] {
        let at = self.positions.map(|axis| axis[k]);
        let far = RAY_OFFSET * (self.depths[k] + at.iter().map(|x| x.abs()).sum::<f32>());
        add_scaled(to_f64(at), f64::from(far), self.normal(k))
    }
}

#[inline(always)]
pub(super) fn arrays<S: Simd>(v: V3<S>) -> [[f32; LANES]; 3] {
    [v.x.array(), v.y.array(), v.z.array()]
}

/// Origins of rays from surface points, as [`SurfacePoints::offset_origin`], in single precision.
#[inline(always)]
pub(super) fn offset_origins<S: Simd>(point: SurfacePointLanes<S>) -> V3<S> {
    let SurfacePointLanes { position, normal, depth } = point;
    let far = (depth + abs(position.x) + abs(position.y) + abs(position.z)) * RAY_OFFSET;
    position.add(normal.scale(far))
}

impl ShadowRays<'_> {
    /// Fraction of a light that reaches each point; 1 in lanes that are not selected. `toward` is the direction to a
    /// directional light.
    #[inline(never)]
    pub(crate) fn visibility<S: Simd>(
        &self,
        s: S,
        light: &Light,
        toward: [f32; 3],
        point: SurfacePointLanes<S>,
        lanes: M<S>,
    ) -> F<S> {
        let points = SurfacePoints::new(point);
        let mut out = [1.0f32; LANES];
        let mut stack = self.stack.borrow_mut();
        for k in lanes_of(lanes.to_bitmask()) {
            let origin = points.offset_origin(k);
            let (direction, limit) = if light.kind == LightKind::Directional {
                (toward.map(f64::from), f64::INFINITY)
            } else {
                let to = sub(light.position.map(f64::from), origin);
                (to, SHADOW_RAY_FRACTION * dot(to, to).sqrt())
            };
            let length = dot(direction, direction).sqrt();
            if length > 0.0 {
                let ray = Ray { origin, direction: scale(direction, 1.0 / length) };
                out[k] = self.tracer.transmittance(s, &ray, limit, END_TIME, &mut stack) as f32;
            }
        }
        if out == [1.0; LANES] { splat(s, 1.0) } else { load(s, &out) }
    }

    /// Occluded fractions of the ambient light from above and from below the horizon, for a matte surface; 0 in lanes
    /// that are not selected. `smooth` is the shading normal.
    #[inline(never)]
    pub(crate) fn occlusion<S: Simd>(
        &self,
        s: S,
        point: SurfacePointLanes<S>,
        smooth: V3<S>,
        lanes: M<S>,
    ) -> [F<S>; 2] {
        let (points, smooth) = (SurfacePoints::new(point), arrays(smooth));
        let mut out = [[0.0f32; LANES]; 2];
        let mut stack = self.stack.borrow_mut();
        for k in lanes_of(lanes.to_bitmask()) {
            let at = points.positions.map(|axis| axis[k].to_bits());
            let sequence = SobolSequence::new([at[0] as usize, at[1] as usize], at[2]);
            let (origin, flat) = (points.offset_origin(k), points.normal(k));
            let basis = OrthonormalBasis::from_normal(smooth.map(|axis| f64::from(axis[k])));
            let mut blocked = [0.0f64; 2];
            for index in 0..u32::from(self.occlusion_rays) {
                let direction = basis.to_world(sample_cosine_hemisphere(sequence.sample(index).sample_2d(0)));
                let direction = scale(direction, 1.0 / dot(direction, direction).sqrt());
                // Directions of the smooth normal's hemisphere may point below the flat surface; those rays are
                // mirrored by it. So a round mesh does not shade itself, and enclosed points are dark.
                let over = dot(direction, flat);
                let asked = add_scaled(direction, if over < 0.0 { -2.0 * over } else { 0.0 }, flat);
                let passes = self.tracer.transmittance(
                    s,
                    &Ray { origin, direction: asked },
                    f64::INFINITY,
                    END_TIME,
                    &mut stack,
                );
                blocked[usize::from(direction[2] <= 0.0)] += 1.0 - passes;
            }
            for (out, blocked) in out.iter_mut().zip(blocked) {
                out[k] = (blocked / f64::from(self.occlusion_rays)) as f32;
            }
        }
        out.map(|part| load(s, &part))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::assets::RayAssetCache;
    use crate::raster::Layer;
    use crate::simd::{SimdLevel, at_level};
    use kinetoscope_scene::shape::Shape;
    use kinetoscope_scene::shape::{Box, Plane, Sphere};
    use kinetoscope_scene::{Instance, Material, PoseF32, RenderScene};

    const UP: [f32; 3] = [0.0, 0.0, 1.0];

    /// The occluded fractions from above and below at a point above a floor, with its geometric and its smooth normal.
    fn blocked(objects: Vec<(Shape, PoseF32)>, at: [f32; 3], normals: [[f32; 3]; 2]) -> [f64; 2] {
        let floor = (Plane::INFINITE.into(), PoseF32::IDENTITY);
        let (shapes, poses): (Vec<Shape>, Vec<PoseF32>) = std::iter::once(floor).chain(objects).unzip();
        let instances = shapes.into_iter().map(|shape| Instance::new(shape, Material::default(), 1)).collect();
        let scene = RenderScene::new(instances).unwrap();
        let mut tracer = RayTracer::default();
        tracer.prepare_geometry(&scene, &RayAssetCache::default(), |i| Layer::for_instance(i, u32::MAX));
        tracer.place(&scene, &poses, None);
        let mut stack = TraversalStack::default();
        let stack = RefCell::new(&mut stack);
        let rays = ShadowRays { tracer: &tracer, stack: &stack, shadows: true, occlusion_rays: 1 << 12 };
        at_level!(SimdLevel::best(), s => {
            let [at, normal, smooth] = [at, normals[0], normals[1]].map(|v| V3::splat(s, v));
            let lanes = splat(s, 0.0f32).simd_gt(splat(s, -1.0));
            let point = SurfacePointLanes { position: at, normal, depth: splat(s, 1.0) };
            let parts = rays.occlusion(s, point, smooth, lanes);
            parts.map(|part| f64::from(part.array()[3]))
        })
    }

    /// Of a net of 4096 points, only those in the cells that an edge crosses are uncertain: about twice 64, half of
    /// which are on the right side. So sqrt(128) / 2 / 4096 is a standard deviation of at most 0.0014.
    const NOISE: f64 = 5.0 * 0.0014;

    /// Beside an infinitely long wall of height h, at the distance d: (1 - d / sqrt(d² + h²)) / 2, which is a half in
    /// its corner. Source: Howell, A catalog of radiation heat transfer configuration factors: from an element to an
    /// infinitely long strip in a plane perpendicular to that of the element.
    #[test]
    fn wall() {
        let wall = |height: f32| {
            let half = [0.5, 5000.0, height];
            (Box { half }.into(), PoseF32::from_translation([-0.5, 0.0, 0.0]))
        };
        for (height, distance) in [(1.0f32, 1.0f32), (2.0, 0.5), (1.0, 4.0), (3000.0, 0.01)] {
            let (d, h) = (f64::from(distance), f64::from(height));
            let expected = 0.5 * (1.0 - d / d.hypot(h));
            let [above, below] = blocked(vec![wall(height)], [distance, 0.0, 0.0], [UP; 2]);
            assert!((above - expected).abs() < NOISE && below == 0.0, "{height} {distance}: {above}, not {expected}");
        }
        let [corner, _] = blocked(vec![wall(3000.0)], [0.001, 0.0, 0.0], [UP; 2]);
        assert!((corner - 0.5).abs() < NOISE);
        // Without occluders, the fraction is exactly 0. The control: the wall occludes a part in all cases above.
        assert_eq!(blocked(vec![], [0.3, 0.2, 0.0], [UP; 2]), [0.0; 2]);
    }

    /// Below a ball: (r / d)²; on a wall half of the light is from below, and the floor occludes it.
    #[test]
    fn ball_and_floor() {
        let ball = (Sphere { radius: 0.5 }.into(), PoseF32::from_translation([0.0, 0.0, 1.25]));
        let [above, below] = blocked(vec![ball], [0.0; 3], [UP; 2]);
        assert!((above - 0.16).abs() < NOISE && below == 0.0, "{above}");
        let [above, below] = blocked(vec![], UP, [[1.0, 0.0, 0.0]; 2]);
        assert!((below - 0.5).abs() < NOISE && above == 0.0, "{below}");
    }

    /// A facet of a round object, whose smooth normal leans over by half a right angle: without occluders it is not
    /// shaded at all, also not by itself. In a closed ball no light passes, whatever the normals.
    #[test]
    fn facets() {
        let normals = [UP, [0.5f32.sqrt(), 0.0, 0.5f32.sqrt()]];
        assert_eq!(blocked(vec![], [0.3, 0.2, 0.0], normals), [0.0; 2]);
        let room = vec![(Sphere { radius: 2.0 }.into(), PoseF32::IDENTITY)];
        let [above, below] = blocked(room, [0.3, 0.2, 0.0], normals);
        assert!((above + below - 1.0).abs() < 1e-6, "{above} {below}");
        // Light from below the horizon is the fraction that a plane of this tilt sees: (1 - cos) / 2.
        assert!((below - 0.5 * (1.0 - 0.5f64.sqrt())).abs() < NOISE, "{below}");
    }
}

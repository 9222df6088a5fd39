//! Direct light: light that reaches a point straight from lights and emissive surfaces.

use super::interaction::SurfaceInteraction;
use super::{MIN_FOOTPRINT_GROWTH, Path, PathTracer, offset_origin, times};
use crate::shade::shadow_rays::SHADOW_RAY_FRACTION;
use crate::simd::Simd;
use crate::trace::Hit;
use kinetoscope_scene::Ray;
use kinetoscope_scene::basis::OrthonormalBasis;
use kinetoscope_scene::vector::{V3, add_scaled, dot, normalize, sub};
use std::f64::consts::PI;

/// First dimension for emitter sampling, two pairs of numbers per surface: far beyond those of paths.
const EMITTER_DIMENSIONS: u32 = 1 << 29;

impl PathTracer<'_> {
    /// Direct light of all lights, scattered by a point towards the unit vector `o`. `dims` is the first dimension of
    /// the surface's random numbers.
    #[inline(always)]
    pub(super) fn direct_light<S: Simd>(
        &self,
        s: S,
        point: &SurfaceInteraction,
        o: V3,
        path: &mut Path<'_>,
        dims: u32,
    ) -> V3 {
        let basis = OrthonormalBasis::from_normal(point.shading_normal);
        let local = basis.to_local(o);
        let matte = point.bsdf.scattered_fraction();
        let mut out = [0.0; 3];
        let mut origin = None;
        for (source, k) in self.lights.lights.iter().zip(4..) {
            let choice = if source.has_size() { path.sample.sample_2d(dims + k) } else { [0.0; 2] };
            let Some(light) = source.sample(point.position, choice) else { continue };
            out = add_scaled(out, light.strength * matte, times(point.bsdf.diffuse_albedo, source.ambient));
            let scatter = point.bsdf.evaluate(local, basis.to_local(light.direction));
            let sent = [0, 1, 2]
                .map(|c| PI * (scatter.diffuse[c] * source.diffuse[c] + scatter.specular[c] * source.specular[c]));
            if sent.iter().all(|&x| x <= 0.0) {
                continue;
            }
            let passes = if source.cast_shadow {
                let origin = *origin.get_or_insert_with(|| self.shadow_ray_origin(s, point, path));
                let (direction, distance) = light.seen_from(point.position, origin);
                path.rays += 1;
                self.tracer.transmittance(
                    s,
                    &Ray { origin, direction },
                    distance * SHADOW_RAY_FRACTION,
                    path.time,
                    path.stack,
                )
            } else {
                1.0
            };
            out = add_scaled(out, light.strength * passes, sent);
        }
        out
    }

    /// Direct light of one sampled emissive instance, scattered by a point towards `o`. Multiple importance sampling
    /// weights it against paths that hit the emitter. `width` is the width of a pixel at the point \[m\].
    #[inline(always)]
    pub(super) fn sample_emitter_light<S: Simd>(
        &self,
        s: S,
        point: &SurfaceInteraction,
        o: V3,
        path: &mut Path<'_>,
        bounce: u32,
        width: f64,
    ) -> V3 {
        let none = [0.0; 3];
        if point.bsdf.scattered_fraction() <= 0.0 {
            return none;
        }
        let pair = |k: u32| path.sample.sample_2d(EMITTER_DIMENSIONS + 2 * bounce + k);
        // Without emitters, no random numbers are drawn.
        let Some(emitter) = self.lights.emitters.sample(0.0).and_then(|_| self.lights.emitters.sample(pair(0)[0]))
        else {
            return none;
        };
        let (from, [_, side]) = (offset_origin(point, 1.0), pair(0));
        let Some(pose) = self.tracer.pose_of(emitter.instance, path.time) else { return none };
        let Some((chosen, density)) = emitter.sample(pose.apply_inverse(from), side, pair(1)) else { return none };
        let to = sub(pose.apply(chosen.position), from);
        let (distance, Some(direction)) = (dot(to, to).sqrt(), normalize(to)) else { return none };
        let basis = OrthonormalBasis::from_normal(point.shading_normal);
        let (local, i) = (basis.to_local(o), basis.to_local(direction));
        // Directions that paths do not take contribute no direct light.
        if dot(direction, point.geometric_normal) <= 0.0 || i[2] <= 0.0 || local[2] <= 0.0 {
            return none;
        }
        let ray = Ray { origin: from, direction };
        path.rays += 1;
        let passes = self.tracer.transmittance(s, &ray, distance * SHADOW_RAY_FRACTION, path.time, path.stack);
        if passes <= 0.0 {
            return none;
        }
        let (instance, triangle) = (emitter.instance, chosen.triangle);
        let normal = pose.rotate(chosen.normal);
        let hit = Hit { distance, instance, triangle, normal, world_from_instance: pose };
        let Some(there) = SurfaceInteraction::new(self.scene, &ray, &hit, width + MIN_FOOTPRINT_GROWTH * distance)
        else {
            return none;
        };
        // Backs of transparent surfaces are invisible.
        if there.alpha < 1.0 && !there.front {
            return none;
        }
        let pdf = density * emitter.probability();
        let share = self.strategy.light_weight(pdf, point.bsdf.pdf(local, i));
        let scatter = point.bsdf.evaluate(local, i);
        let by = share * passes * there.alpha * (1.0 - there.bsdf.mirror) / pdf;
        [0, 1, 2].map(|c| by * there.emission[c] * (scatter.diffuse[c] + scatter.specular[c]))
    }

    /// Returns the MIS weight, 0 to 1, of the emission at the hit point `at`. The BSDF sampled the direction from
    /// `from` with the pdf `pdf` \[1/sr\]. The weight is 1 for an emitter that is never sampled directly.
    pub(super) fn bsdf_mis_weight(&self, from: V3, pdf: f64, hit: &Hit, at: V3) -> f64 {
        let Some(emitter) = self.lights.emitters.for_instance(hit.instance) else { return 1.0 };
        let pose = &hit.world_from_instance;
        let (from, at) = (pose.apply_inverse(from), pose.apply_inverse(at));
        let Some(density) = emitter.pdf(from, at, pose.rotate_inverse(hit.normal)) else { return 1.0 };
        self.strategy.bsdf_weight(pdf, density * emitter.probability())
    }

    /// Origin of a point's shadow rays: on the smooth surface that the normals describe, unless another surface is
    /// between.
    #[inline(always)]
    fn shadow_ray_origin<S: Simd>(&self, s: S, point: &SurfaceInteraction, path: &mut Path<'_>) -> V3 {
        let (here, lifted) = (
            offset_origin(point, 1.0),
            offset_origin(&SurfaceInteraction { position: point.smooth_position, ..*point }, 1.0),
        );
        let way = sub(lifted, here);
        let (far, Some(direction)) = (dot(way, way).sqrt(), normalize(way)) else { return lifted };
        path.rays += 1;
        match self.tracer.closest_hit(s, &Ray { origin: here, direction }, far, path.time, path.stack) {
            Some(_) => here,
            None => lifted,
        }
    }
}

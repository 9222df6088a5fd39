//! Direct light: light that reaches a point straight from lights and emissive surfaces.

use super::point::Point;
use super::{Path, Paths, SCATTERED, above, times};
use crate::shade::shadow_rays::REACH;
use crate::simd::Simd;
use crate::trace::Hit;
use kinetoscope_scene::Ray;
use kinetoscope_scene::basis::Basis;
use kinetoscope_scene::vector::{V3, along, dot, sub, unit};
use std::f64::consts::PI;

/// First dimension for emitter sampling, two pairs of numbers per surface: far beyond those of paths.
const GLOWING: u32 = 1 << 29;

impl Paths<'_> {
    /// Direct light of all lights, scattered by a point towards `o`.
    #[inline(always)]
    pub(super) fn lit<S: Simd>(&self, s: S, point: &Point, o: V3, path: &mut Path<'_>, dims: u32) -> V3 {
        let basis = Basis::of(point.normal);
        let local = basis.to_local(o);
        let matt = point.lobe.rest();
        let mut out = [0.0; 3];
        let mut origin = None;
        for (lamp, k) in self.lamps.lamps.iter().zip(4..) {
            let choice = if lamp.has_size() { path.sample.pair(dims + k) } else { [0.0; 2] };
            let Some(light) = lamp.at(point.position, choice) else { continue };
            out = along(out, light.strength * matt, times(point.lobe.body, lamp.ambient));
            let scatter = point.lobe.scatter(local, basis.to_local(light.direction));
            let sent =
                [0, 1, 2].map(|c| PI * (scatter.below[c] * lamp.diffuse[c] + scatter.layer[c] * lamp.specular[c]));
            if sent.iter().all(|&x| x <= 0.0) {
                continue;
            }
            let passes = if lamp.cast_shadow {
                let origin = *origin.get_or_insert_with(|| self.lifted(s, point, path));
                let (direction, distance) = light.seen_from(point.position, origin);
                path.rays += 1;
                self.tracer.passes(s, &Ray { origin, direction }, distance * REACH, path.time, path.stack)
            } else {
                1.0
            };
            out = along(out, light.strength * passes, sent);
        }
        out
    }

    /// Direct light of one sampled emissive instance, scattered by a point towards `o`. Multiple importance sampling
    /// weights it against paths that hit the emitter. `width` is the width of a pixel at the point \[m\].
    #[inline(always)]
    pub(super) fn glow<S: Simd>(&self, s: S, point: &Point, o: V3, path: &mut Path<'_>, bounce: u32, width: f64) -> V3 {
        let none = [0.0; 3];
        if point.lobe.rest() <= 0.0 {
            return none;
        }
        let pair = |k: u32| path.sample.pair(GLOWING + 2 * bounce + k);
        // Without emitters, no random numbers are drawn.
        let Some(emitter) = self.lamps.emitters.choose(0.0).and_then(|_| self.lamps.emitters.choose(pair(0)[0])) else {
            return none;
        };
        let (from, [_, side]) = (above(point, 1.0), pair(0));
        let Some(pose) = self.tracer.pose_of(emitter.instance, path.time) else { return none };
        let Some((chosen, density)) = emitter.choose(pose.apply_inverse(from), side, pair(1)) else { return none };
        let to = sub(pose.apply(chosen.position), from);
        let (distance, Some(direction)) = (dot(to, to).sqrt(), unit(to)) else { return none };
        let basis = Basis::of(point.normal);
        let (local, i) = (basis.to_local(o), basis.to_local(direction));
        // Directions that paths do not take contribute no direct light.
        if dot(direction, point.flat) <= 0.0 || i[2] <= 0.0 || local[2] <= 0.0 {
            return none;
        }
        let ray = Ray { origin: from, direction };
        path.rays += 1;
        let passes = self.tracer.passes(s, &ray, distance * REACH, path.time, path.stack);
        if passes <= 0.0 {
            return none;
        }
        let (instance, triangle) = (emitter.instance, chosen.triangle);
        let normal = pose.rotate(chosen.normal);
        let hit = Hit { distance, instance, triangle, normal, world_from_instance: pose };
        let Some(there) = Point::new(self.scene, &ray, &hit, width + SCATTERED * distance) else { return none };
        // Backs of transparent surfaces are invisible.
        if there.alpha < 1.0 && !there.front {
            return none;
        }
        let likely = density * emitter.share();
        let share = self.ways.looking(likely, point.lobe.likely(local, i));
        let scatter = point.lobe.scatter(local, i);
        let by = share * passes * there.alpha * (1.0 - there.lobe.mirror) / likely;
        [0, 1, 2].map(|c| by * there.emission[c] * (scatter.below[c] + scatter.layer[c]))
    }

    /// MIS weight of emission that a path hit. The direction of the path was sampled at `from` with the pdf `likely`
    /// \[1/sr\].
    pub(super) fn met(&self, from: V3, likely: f64, hit: &Hit, at: V3) -> f64 {
        let Some(emitter) = self.lamps.emitters.of(hit.instance) else { return 1.0 };
        let pose = &hit.world_from_instance;
        let (from, at) = (pose.apply_inverse(from), pose.apply_inverse(at));
        let Some(density) = emitter.density(from, at, pose.rotate_inverse(hit.normal)) else { return 1.0 };
        self.ways.meeting(likely, density * emitter.share())
    }

    /// Origin of a point's shadow rays: on the smooth surface that the normals describe, unless another surface is
    /// between.
    #[inline(always)]
    fn lifted<S: Simd>(&self, s: S, point: &Point, path: &mut Path<'_>) -> V3 {
        let (here, lifted) = (above(point, 1.0), above(&Point { position: point.lifted, ..*point }, 1.0));
        let way = sub(lifted, here);
        let (far, Some(direction)) = (dot(way, way).sqrt(), unit(way)) else { return lifted };
        path.rays += 1;
        match self.tracer.nearest(s, &Ray { origin: here, direction }, far, path.time, path.stack) {
            Some(_) => here,
            None => lifted,
        }
    }
}

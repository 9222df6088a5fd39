//! Path tracing: light is traced backward from the camera.
//!
//! At every surface, all lights are sampled (one shadow ray each), and one direction is sampled from the BSDF. A path
//! that hits a surface adds its emission; a path that hits no surface adds the environment light. So lights are found
//! by shadow rays only, the environment by paths only: no light counts twice. Emissive surfaces are found by both
//! strategies, with weights of multiple importance sampling (`emitter`). Later bounces end by Russian roulette.
//!
//! Source: Kajiya, The rendering equation, 1986. The units of light are those of
//! [`Renderer`](crate::renderer::Renderer).

pub(crate) mod accumulator;
pub(super) mod bsdf;
pub(crate) mod camera_rays;
pub(crate) mod denoise;
mod direct;
mod emitter;
pub(super) mod interaction;
mod light_source;
pub(super) mod sobol;
mod texel;

#[cfg(test)]
mod tests;

use crate::geometry::bvh::TraversalStack;
use crate::shade::tone;
use crate::shutter::RowClock;
use crate::simd::Simd;
use crate::trace::motion::{END_TIME, Motion, pose_to_f64};
use crate::trace::{Hit, RayTracer};
use crate::visibility::Projection;
use camera_rays::CameraRayGenerator;
use emitter::{Emitters, power_heuristic};
use interaction::SurfaceInteraction;
use kinetoscope_scene::Ray;
use kinetoscope_scene::basis::OrthonormalBasis;
use kinetoscope_scene::vector::{V3, add, add_scaled, dot, scale, to_f64};
use kinetoscope_scene::{Light, LightingSpace, PoseF64, RenderScene, Texture};
use light_source::LightSource;
use sobol::{SobolSample, SobolSequence};
use std::sync::Arc;

/// Largest number of sampled lights; the headlight is counted separately.
const MAX_LIGHTS: usize = crate::shade::light::MAX_LIGHTS;
/// Offset of ray origins above a surface, as a fraction of the largest coordinate, or \[m\] if that is below 1 m.
const RAY_OFFSET: f64 = 1e-7;
/// Bounces after which Russian roulette starts.
const RR_START: u32 = 2;
/// Largest number of transparent surfaces that a path passes.
const MAX_PASSES: u32 = 64;
/// Least growth of the pixel footprint after diffuse scattering, per meter.
const MIN_FOOTPRINT_GROWTH: f64 = 0.1;
/// Dimensions (pairs of random numbers): position in the pixel, and per surface the direction, the lobe with Russian
/// roulette, and transparency.
const IN_PIXEL: u32 = 0;
const DIRECTION: u32 = 1;
const LOBE: u32 = 2;
const TRANSPARENCY: u32 = 3;
/// Dimensions per surface: the ones above, and one for each light.
const DIMENSIONS: u32 = 4 + MAX_LIGHTS as u32;
/// Far beyond those: the point of the aperture, and the instant.
const ON_LENS: u32 = 1 << 30;
const TIME: u32 = (1 << 30) + 1;

/// State that all paths of an image share.
#[derive(Clone, Debug)]
pub(crate) struct PathTracer<'a> {
    pub(crate) scene: &'a RenderScene,
    pub(crate) tracer: &'a RayTracer,
    pub(crate) camera_rays: CameraRayGenerator<'a>,
    pub(crate) motion: Option<&'a ExposureMotion>,
    pub(crate) samples: u32,
    pub(crate) max_bounces: u32,
    pub(crate) seed: u32,
    pub(crate) lights: &'a SceneLights,
    pub(crate) strategy: MisStrategy,
}

/// Exposure time of the shutter, and motion of the camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExposureMotion {
    pub(crate) clock: RowClock,
    pub(crate) camera: Option<Motion>,
}

/// Strategies of multiple importance sampling for emissive surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MisStrategy {
    Both,
    /// Direct light only: emitters are sampled.
    #[cfg(test)]
    Light,
    /// BSDF sampling only: paths hit emitters.
    #[cfg(test)]
    Bsdf,
}

impl MisStrategy {
    /// Weight of an emitter sample with pdf `own`, where BSDF sampling has the pdf `other`.
    fn light_weight(self, own: f64, other: f64) -> f64 {
        match self {
            Self::Both => power_heuristic(own, other),
            #[cfg(test)]
            Self::Light => 1.0,
            #[cfg(test)]
            Self::Bsdf => 0.0,
        }
    }

    /// Weight of a BSDF sample with pdf `own` that hits an emitter, where emitter sampling has the pdf `other`.
    fn bsdf_weight(self, own: f64, other: f64) -> f64 {
        match self {
            Self::Both => power_heuristic(own, other),
            #[cfg(test)]
            Self::Light => 0.0,
            #[cfg(test)]
            Self::Bsdf => 1.0,
        }
    }
}

/// All light of a frame; keeps its memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct SceneLights {
    lights: Vec<LightSource>,
    emitters: Emitters,
    /// Radiance of the environment from above and below the horizon.
    environment: [V3; 2],
    /// Sky colors for cameras and mirrors: straight up, at the horizon, straight down.
    sky: [V3; 3],
    /// Image that replaces these sky colors.
    skybox: Option<Arc<Texture>>,
    haze: Option<(Option<V3>, f64, f64)>,
}

impl SceneLights {
    /// Prepares the light of a frame. `shadows` enables shadows, `view` is the camera. `forward` is true if its near
    /// plane is measured along the axis.
    pub(crate) fn prepare(
        &mut self,
        scene: &RenderScene,
        tracer: &RayTracer,
        lights: &[Light],
        shadows: bool,
        view: &Projection,
        forward: bool,
    ) {
        let linear = |c: [f32; 3]| to_f64(tone::decode(c));
        let Self { lights: light_sources, emitters, environment, sky, skybox, haze } = self;
        skybox.clone_from(&scene.skybox);
        emitters.prepare(scene, tracer);
        *environment = [to_f64(scene.ambient.sky), to_f64(scene.ambient.ground)];
        *sky = [linear(scene.sky.zenith), linear(scene.sky.horizon), linear(scene.sky.nadir)];
        *haze = scene.haze.map(|h| (h.color.map(linear), f64::from(h.start), f64::from(h.end)));
        light_sources.clear();
        light_sources.extend(lights.iter().filter(|l| l.active).take(MAX_LIGHTS).map(LightSource::new));
        // After the other lights, and not counted in their limit: it is a point, and needs no random numbers.
        if scene.headlight.active {
            let axis = forward.then(|| view.world_from_camera.rotation.map(|row| row[2]));
            light_sources.push(match scene.headlight.to_directional(scene.lighting_space, axis) {
                Some(light) => LightSource::new(&light),
                None => LightSource::headlight(&scene.headlight, view, forward),
            });
        }
        for source in light_sources {
            if scene.lighting_space == LightingSpace::Display {
                for color in [&mut source.ambient, &mut source.diffuse, &mut source.specular] {
                    *color = linear(color.map(|x| x as f32));
                }
            }
            source.cast_shadow &= shadows;
        }
    }

    pub(crate) fn bytes(&self) -> usize {
        self.lights.capacity() * size_of::<LightSource>() + self.emitters.bytes()
    }

    /// Sky color in a direction, for cameras and mirrors.
    fn sky(&self, direction: V3) -> V3 {
        if let Some(image) = &self.skybox {
            let [x, y, z] = direction;
            return texel::at_cube(image, [x, z, -y], 0.0);
        }
        let k = direction[2].abs().min(1.0).sqrt();
        let [zenith, horizon, nadir] = self.sky;
        let to = if direction[2] > 0.0 { zenith } else { nadir };
        [0, 1, 2].map(|c| horizon[c] + k * (to[c] - horizon[c]))
    }
}

/// Result of the paths of a pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PixelEstimate {
    /// Mean radiance, linear.
    pub(crate) color: V3,
    /// Variance of the mean brightness, estimated as if samples were independent: an upper bound. 0 for one sample.
    pub(crate) variance: f64,
    /// Means over the first hits: albedo (1 for mirrors and sky), fraction of mirrored light, normal, distance \[m\] (0
    /// for the sky).
    pub(crate) albedo: V3,
    pub(crate) gloss: f64,
    pub(crate) normal: V3,
    pub(crate) distance: f64,
    /// Number of rays.
    pub(crate) rays: u64,
}

/// The first hit of a camera ray.
#[derive(Clone, Copy, Debug)]
struct FirstHit {
    albedo: V3,
    gloss: f64,
    normal: V3,
    distance: f64,
}

/// One path: its random numbers, its instant, and its number of rays.
#[derive(Debug)]
struct Path<'a> {
    sample: SobolSample,
    time: f64,
    rays: u64,
    stack: &'a mut TraversalStack,
}

impl PathTracer<'_> {
    /// Traces the paths of a pixel.
    #[inline(always)]
    pub(crate) fn pixel<S: Simd>(&self, s: S, at: [usize; 2], stack: &mut TraversalStack) -> PixelEstimate {
        let sequence = SobolSequence::new(at, self.seed);
        let n = f64::from(self.samples);
        let mut out = PixelEstimate::default();
        let mut squares = 0.0;
        for index in 0..self.samples {
            let sample = sequence.sample(index);
            let time = self.motion.map_or(END_TIME, |moving| moving.clock.at(at[1], sample.sample_2d(TIME)[0]));
            let [dx, dy] = sample.sample_2d(IN_PIXEL);
            let mut path = Path { sample, time, rays: 0, stack: &mut *stack };
            let (color, first) = self.radiance(s, &mut path, [at[0] as f64 + dx, at[1] as f64 + dy]);
            out.rays += path.rays;
            // Colors of lights and skies are not checked; a NaN would spread to the neighbors.
            let color = if color.iter().all(|x| x.is_finite()) { color } else { [0.0; 3] };
            let bright = brightness(color);
            squares += bright * bright / n;
            out.color = add_scaled(out.color, 1.0 / n, color);
            out.albedo = add_scaled(out.albedo, 1.0 / n, first.albedo);
            out.gloss += first.gloss / n;
            out.normal = add_scaled(out.normal, 1.0 / n, first.normal);
            out.distance += first.distance / n;
        }
        let bright = brightness(out.color);
        out.variance = (squares - bright * bright).max(0.0) / (n - 1.0).max(1.0);
        out
    }

    /// Pose of the camera at a time.
    fn camera(&self, time: f64) -> PoseF64 {
        match self.motion.and_then(|moving| moving.camera.as_ref()) {
            Some(motion) => motion.at(time),
            None => pose_to_f64(&self.camera_rays.projection.world_from_camera),
        }
    }

    /// Radiance at a point of the image, and the first hit.
    #[inline(always)]
    fn radiance<S: Simd>(&self, s: S, path: &mut Path<'_>, at: [f64; 2]) -> (V3, FirstHit) {
        let (sample, time) = (path.sample, path.time);
        let mut first = FirstHit { albedo: [1.0; 3], gloss: 0.0, normal: [0.0; 3], distance: 0.0 };
        let Some(camera_rays::CameraRay {
            mut ray,
            near_distance: near,
            mut limit,
            footprint: mut width,
            footprint_growth: mut spread,
        }) = self.camera_rays.camera_ray(at, &self.camera(time), || sample.sample_2d(ON_LENS))
        else {
            // No light falls outside of the image circle.
            return ([0.0; 3], first);
        };
        let (mut light, mut throughput) = ([0.0; 3], [1.0; 3]);
        let (mut bounce, mut passes, mut traveled) = (0, 0, near);
        // True as long as only mirrors and glass were hit.
        let mut clear = true;
        // Origin and pdf of a sampled direction; `None` for the camera ray, mirrors and glass.
        let mut chosen: Option<(V3, f64)> = None;
        loop {
            path.rays += 1;
            let hit = self.tracer.closest_hit(s, &ray, limit, time, path.stack);
            let found_hit = hit.and_then(|hit| {
                let footprint = width + spread * hit.distance;
                Some((hit, SurfaceInteraction::new(self.scene, &ray, &hit, footprint)?))
            });
            let Some((hit @ Hit { distance, .. }, point)) = found_hit else {
                let below = usize::from(ray.direction[2] <= 0.0);
                let beyond = if clear { self.lights.sky(ray.direction) } else { self.lights.environment[below] };
                light = add(light, times(throughput, beyond));
                break;
            };
            let dims = 1 + bounce * DIMENSIONS;
            traveled += distance;
            width += spread * distance;
            limit -= distance;
            if point.alpha < 1.0 {
                let chance = sample.sample_2d(dims + TRANSPARENCY + 1_000_000 * passes)[0];
                if !point.front && !point.bsdf.is_glass() || chance >= point.alpha {
                    passes += 1;
                    if passes > MAX_PASSES {
                        break;
                    }
                    ray.origin = offset_origin(&point, -1.0);
                    continue;
                }
            }
            let o = scale(ray.direction, -1.0);
            if bounce == 0 {
                let (matte, gloss) = (
                    point.bsdf.scattered_fraction(),
                    point.bsdf.gloss(OrthonormalBasis::from_normal(point.shading_normal).to_local(o)),
                );
                let albedo = point.bsdf.albedo.map(|x| matte * x + (1.0 - matte));
                first = FirstHit { albedo, gloss, normal: point.shading_normal, distance: traveled };
                if let Some((color, start, end)) = self.lights.haze {
                    let k = ((traveled - start) / (end - start).max(1e-6)).clamp(0.0, 1.0);
                    let k = k * k * (3.0 - 2.0 * k);
                    let flat = [ray.direction[0], ray.direction[1], ray.direction[2].max(0.0)];
                    light = add_scaled(light, k, color.unwrap_or_else(|| self.lights.sky(flat)));
                    throughput = scale(throughput, 1.0 - k);
                }
            }
            let share = chosen.map_or(1.0, |(from, pdf)| self.bsdf_mis_weight(from, pdf, &hit, point.position));
            light = add(light, times(throughput, scale(point.emission, share * (1.0 - point.bsdf.mirror))));
            if bounce > self.max_bounces {
                break;
            }
            light = add(light, times(throughput, self.direct_light(s, &point, o, path, dims)));
            light = add(light, times(throughput, self.sample_emitter_light(s, &point, o, path, bounce, width)));
            let basis = OrthonormalBasis::from_normal(point.shading_normal);
            let [lobe, chance] = sample.sample_2d(dims + LOBE);
            let Some(next) = point.bsdf.sample(basis.to_local(o), lobe, sample.sample_2d(dims + DIRECTION)) else {
                break;
            };
            let onward = basis.to_world(next.direction);
            // A direction below the flat surface though above its smooth normal ends the path, and so does a refracted
            // one above the flat surface.
            let through = next.direction[2] < 0.0;
            if (dot(onward, point.geometric_normal) <= 0.0) != through {
                break;
            }
            throughput = times(throughput, next.weight);
            if bounce >= RR_START {
                let most = throughput.iter().fold(0.0f64, |m, &x| m.max(x)).min(1.0);
                if chance >= most {
                    break;
                }
                throughput = scale(throughput, 1.0 / most);
            }
            if !next.is_specular {
                (clear, spread) = (false, spread.max(MIN_FOOTPRINT_GROWTH));
            }
            bounce += 1;
            ray = Ray { origin: offset_origin(&point, if through { -1.0 } else { 1.0 }), direction: onward };
            chosen = (!next.is_specular).then_some((ray.origin, next.pdf));
            limit = f64::INFINITY;
        }
        (light, first)
    }
}

/// A point slightly above a surface, or below it.
fn offset_origin(point: &SurfaceInteraction, side: f64) -> V3 {
    let far = point.position.iter().fold(1.0f64, |m, x| m.max(x.abs()));
    add_scaled(point.position, side * RAY_OFFSET * far, point.geometric_normal)
}

fn times(a: V3, b: V3) -> V3 {
    [0, 1, 2].map(|k| a[k] * b[k])
}

/// Brightness (luminance) of a color. Source: ITU-R BT.709.
fn brightness([r, g, b]: V3) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

//! Path tracing: light is traced backward from the camera.
//!
//! At every surface, all lights are sampled (one shadow ray each), and one direction is sampled from the BSDF. A path
//! that hits a surface adds its emission; a path that hits no surface adds the environment light. So lights are found
//! by shadow rays only, the environment by paths only: no light counts twice. Emissive surfaces are found by both
//! strategies, with weights of multiple importance sampling (`emitter`). Later bounces end by Russian roulette.
//!
//! Source: Kajiya, The rendering equation, 1986. The units of light are those of
//! [`Renderer`](crate::renderer::Renderer).

mod direct;
mod emitter;
pub(crate) mod eye;
pub(crate) mod film;
mod lamp;
pub(super) mod lobe;
pub(super) mod point;
pub(crate) mod smooth;
pub(super) mod sobol;
mod texel;

#[cfg(test)]
mod tests;

use crate::geometry::bvh::Stack;
use crate::shade::tone;
use crate::shutter::Clock;
use crate::simd::Simd;
use crate::trace::motion::{Motion, NOW, wide};
use crate::trace::{Hit, Tracer};
use crate::visibility::Projection;
use emitter::{Emitters, power_heuristic};
use eye::Eye;
use kinetoscope_scene::Ray;
use kinetoscope_scene::basis::Basis;
use kinetoscope_scene::vector::{V3, along, dot, scale, to_f64};
use kinetoscope_scene::{Light, LightSum, PoseF64, RenderScene, Texture};
use lamp::Lamp;
use point::Point;
use sobol::{Sample, Sequence};
use std::sync::Arc;

/// Largest number of sampled lights; the headlight is counted separately.
const MAX_LAMPS: usize = crate::shade::light::MAX_LIGHTS;
/// Offset of ray origins above a surface, as a fraction of the largest coordinate.
const ABOVE: f64 = 1e-7;
/// Bounces after which Russian roulette starts.
const SURE: u32 = 2;
/// Largest number of transparent surfaces that a path passes.
const MAX_PASSES: u32 = 64;
/// Least growth of the pixel footprint after diffuse scattering, per meter.
const SCATTERED: f64 = 0.1;
/// Dimensions (pairs of random numbers): position in the pixel, and per surface the direction, the lobe with Russian
/// roulette, and transparency.
const IN_PIXEL: u32 = 0;
const ONWARD: u32 = 1;
const CHANCE: u32 = 2;
const THROUGH: u32 = 3;
/// Dimensions per surface: the ones above, and one for each light.
const PAIRS: u32 = 4 + MAX_LAMPS as u32;
/// Far beyond those: the point of the aperture, and the instant.
const ON_LENS: u32 = 1 << 30;
const INSTANT: u32 = (1 << 30) + 1;

/// State that all paths of an image share.
#[derive(Clone, Debug)]
pub(crate) struct Paths<'a> {
    pub(crate) scene: &'a RenderScene,
    pub(crate) tracer: &'a Tracer,
    pub(crate) eye: Eye<'a>,
    pub(crate) moving: Option<&'a Moving>,
    pub(crate) samples: u32,
    pub(crate) max_bounces: u32,
    pub(crate) seed: u32,
    pub(crate) lamps: &'a Lamps,
    pub(crate) ways: Ways,
}

/// Exposure time of the shutter, and motion of the camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moving {
    pub(crate) clock: Clock,
    pub(crate) camera: Option<Motion>,
}

/// Strategies of multiple importance sampling for emissive surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ways {
    Both,
    /// Direct light only: emitters are sampled.
    #[cfg(test)]
    Looking,
    /// BSDF sampling only: paths hit emitters.
    #[cfg(test)]
    Meeting,
}

impl Ways {
    /// Weight of an emitter sample with pdf `own`, where BSDF sampling has the pdf `other`.
    fn looking(self, own: f64, other: f64) -> f64 {
        match self {
            Self::Both => power_heuristic(own, other),
            #[cfg(test)]
            Self::Looking => 1.0,
            #[cfg(test)]
            Self::Meeting => 0.0,
        }
    }

    /// Weight of a BSDF sample with pdf `own` that hits an emitter, where emitter sampling has the pdf `other`.
    fn meeting(self, own: f64, other: f64) -> f64 {
        match self {
            Self::Both => power_heuristic(own, other),
            #[cfg(test)]
            Self::Looking => 0.0,
            #[cfg(test)]
            Self::Meeting => 1.0,
        }
    }
}

/// All light of a frame; keeps its memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lamps {
    lamps: Vec<Lamp>,
    emitters: Emitters,
    /// Radiance of the environment from above and below the horizon.
    dome: [V3; 2],
    /// Sky colors for cameras and mirrors: straight up, at the horizon, straight down.
    sky: [V3; 3],
    /// Image that replaces these sky colors.
    skybox: Option<Arc<Texture>>,
    haze: Option<(Option<V3>, f64, f64)>,
}

impl Lamps {
    /// Prepares the light of a frame. `shadows` enables shadows, `view` is the camera. `forward` is true if its near
    /// plane is measured along the axis.
    pub(crate) fn prepare(
        &mut self,
        scene: &RenderScene,
        tracer: &Tracer,
        lights: &[Light],
        shadows: bool,
        view: &Projection,
        forward: bool,
    ) {
        let linear = |c: [f32; 3]| to_f64(tone::decode(c));
        let Self { lamps, emitters, dome, sky, skybox, haze } = self;
        skybox.clone_from(&scene.skybox);
        emitters.prepare(scene, tracer);
        *dome = [to_f64(scene.ambient.sky), to_f64(scene.ambient.ground)];
        *sky = [linear(scene.sky.zenith), linear(scene.sky.horizon), linear(scene.sky.nadir)];
        *haze = scene.haze.map(|h| (h.color.map(linear), f64::from(h.start), f64::from(h.end)));
        lamps.clear();
        lamps.extend(lights.iter().filter(|l| l.active).take(MAX_LAMPS).map(Lamp::new));
        // After the other lights, and not counted in their limit: it is a point, and needs no random numbers.
        if scene.headlight.active {
            let axis = forward.then(|| view.world_from_camera.rotation.map(|row| row[2]));
            lamps.push(match scene.headlight.along(scene.light_sum, axis) {
                Some(light) => Lamp::new(&light),
                None => Lamp::of_camera(&scene.headlight, view, forward),
            });
        }
        for lamp in lamps {
            if scene.light_sum == LightSum::Display {
                for color in [&mut lamp.ambient, &mut lamp.diffuse, &mut lamp.specular] {
                    *color = linear(color.map(|x| x as f32));
                }
            }
            lamp.cast_shadow &= shadows;
        }
    }

    pub(crate) fn bytes(&self) -> usize {
        self.lamps.capacity() * size_of::<Lamp>() + self.emitters.bytes()
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
pub(crate) struct Found {
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
struct First {
    albedo: V3,
    gloss: f64,
    normal: V3,
    distance: f64,
}

/// One path: its random numbers, its instant, and its number of rays.
#[derive(Debug)]
struct Path<'a> {
    sample: Sample,
    time: f64,
    rays: u64,
    stack: &'a mut Stack,
}

impl Paths<'_> {
    /// Traces the paths of a pixel.
    #[inline(always)]
    pub(crate) fn pixel<S: Simd>(&self, s: S, at: [usize; 2], stack: &mut Stack) -> Found {
        let sequence = Sequence::new(at, self.seed);
        let n = f64::from(self.samples);
        let mut out = Found::default();
        let mut squares = 0.0;
        for index in 0..self.samples {
            let sample = sequence.sample(index);
            let time = self.moving.map_or(NOW, |moving| moving.clock.at(at[1], sample.pair(INSTANT)[0]));
            let [dx, dy] = sample.pair(IN_PIXEL);
            let mut path = Path { sample, time, rays: 0, stack: &mut *stack };
            let (color, first) = self.radiance(s, &mut path, [at[0] as f64 + dx, at[1] as f64 + dy]);
            out.rays += path.rays;
            // Colors of lights and skies are not checked; a NaN would spread to the neighbors.
            let color = if color.iter().all(|x| x.is_finite()) { color } else { [0.0; 3] };
            let bright = brightness(color);
            squares += bright * bright / n;
            out.color = along(out.color, 1.0 / n, color);
            out.albedo = along(out.albedo, 1.0 / n, first.albedo);
            out.gloss += first.gloss / n;
            out.normal = along(out.normal, 1.0 / n, first.normal);
            out.distance += first.distance / n;
        }
        let bright = brightness(out.color);
        out.variance = (squares - bright * bright).max(0.0) / (n - 1.0).max(1.0);
        out
    }

    /// Pose of the camera at a time.
    fn camera(&self, time: f64) -> PoseF64 {
        match self.moving.and_then(|moving| moving.camera.as_ref()) {
            Some(motion) => motion.at(time),
            None => wide(&self.eye.projection.world_from_camera),
        }
    }

    /// Radiance at a point of the image, and the first hit.
    #[inline(always)]
    fn radiance<S: Simd>(&self, s: S, path: &mut Path<'_>, at: [f64; 2]) -> (V3, First) {
        let (sample, time) = (path.sample, path.time);
        let mut first = First { albedo: [1.0; 3], gloss: 0.0, normal: [0.0; 3], distance: 0.0 };
        let Some(eye::First { mut ray, travelled: near, mut limit, mut width, mut spread }) =
            self.eye.look(at, &self.camera(time), || sample.pair(ON_LENS))
        else {
            // No light falls outside of the image circle.
            return ([0.0; 3], first);
        };
        let (mut light, mut kept) = ([0.0; 3], [1.0; 3]);
        let (mut bounce, mut passes, mut travelled) = (0, 0, near);
        // True as long as only mirrors and glass were hit.
        let mut clear = true;
        // Origin and pdf of a sampled direction; `None` for the camera ray, mirrors and glass.
        let mut chosen: Option<(V3, f64)> = None;
        loop {
            path.rays += 1;
            let hit = self.tracer.nearest(s, &ray, limit, time, path.stack);
            let met = hit.and_then(|hit| {
                let footprint = width + spread * hit.distance;
                Some((hit, Point::new(self.scene, &ray, &hit, footprint)?))
            });
            let Some((hit @ Hit { distance, .. }, point)) = met else {
                let below = usize::from(ray.direction[2] <= 0.0);
                let beyond = if clear { self.lamps.sky(ray.direction) } else { self.lamps.dome[below] };
                light = add(light, times(kept, beyond));
                break;
            };
            let dims = 1 + bounce * PAIRS;
            travelled += distance;
            width += spread * distance;
            limit -= distance;
            if point.alpha < 1.0 {
                let chance = sample.pair(dims + THROUGH + 1_000_000 * passes)[0];
                if !point.front && !point.lobe.is_glass() || chance >= point.alpha {
                    passes += 1;
                    if passes > MAX_PASSES {
                        break;
                    }
                    ray.origin = above(&point, -1.0);
                    continue;
                }
            }
            let o = scale(ray.direction, -1.0);
            if bounce == 0 {
                let (matt, gloss) = (point.lobe.rest(), point.lobe.gloss(Basis::of(point.normal).to_local(o)));
                let albedo = point.lobe.albedo.map(|x| matt * x + (1.0 - matt));
                first = First { albedo, gloss, normal: point.normal, distance: travelled };
                if let Some((color, start, end)) = self.lamps.haze {
                    let k = ((travelled - start) / (end - start).max(1e-6)).clamp(0.0, 1.0);
                    let k = k * k * (3.0 - 2.0 * k);
                    let flat = [ray.direction[0], ray.direction[1], ray.direction[2].max(0.0)];
                    light = along(light, k, color.unwrap_or_else(|| self.lamps.sky(flat)));
                    kept = scale(kept, 1.0 - k);
                }
            }
            let share = chosen.map_or(1.0, |(from, likely)| self.met(from, likely, &hit, point.position));
            light = add(light, times(kept, scale(point.emission, share * (1.0 - point.lobe.mirror))));
            if bounce > self.max_bounces {
                break;
            }
            light = add(light, times(kept, self.lit(s, &point, o, path, dims)));
            light = add(light, times(kept, self.glow(s, &point, o, path, bounce, width)));
            let basis = Basis::of(point.normal);
            let [lobe, chance] = sample.pair(dims + CHANCE);
            let Some(next) = point.lobe.choose(basis.to_local(o), lobe, sample.pair(dims + ONWARD)) else { break };
            let onward = basis.to_world(next.direction);
            // A direction below the flat surface though above its smooth normal ends the path, and so does a refracted
            // one above the flat surface.
            let through = next.direction[2] < 0.0;
            if (dot(onward, point.flat) <= 0.0) != through {
                break;
            }
            kept = times(kept, next.weight);
            if bounce >= SURE {
                let most = kept.iter().fold(0.0f64, |m, &x| m.max(x)).min(1.0);
                if chance >= most {
                    break;
                }
                kept = scale(kept, 1.0 / most);
            }
            if !next.mirrored {
                (clear, spread) = (false, spread.max(SCATTERED));
            }
            bounce += 1;
            ray = Ray { origin: above(&point, if through { -1.0 } else { 1.0 }), direction: onward };
            chosen = (!next.mirrored).then_some((ray.origin, next.likely));
            limit = f64::INFINITY;
        }
        (light, first)
    }
}

/// A point slightly above a surface, or below it.
fn above(point: &Point, side: f64) -> V3 {
    let far = point.position.iter().fold(1.0f64, |m, x| m.max(x.abs()));
    along(point.position, side * ABOVE * far, point.flat)
}

fn times(a: V3, b: V3) -> V3 {
    [0, 1, 2].map(|k| a[k] * b[k])
}

fn add(a: V3, b: V3) -> V3 {
    [0, 1, 2].map(|k| a[k] + b[k])
}

/// Brightness (luminance) of a color. Source: ITU-R BT.709.
fn brightness([r, g, b]: V3) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

//! Emissive instances as area lights: at every surface, a point on an emitter is sampled besides the direction that the
//! BSDF samples. Multiple importance sampling combines both by their pdfs.
//!
//! Source: Veach and Guibas, Optimally combining sampling techniques for Monte Carlo rendering, SIGGRAPH 1995 (the
//! power heuristic).

use super::brightness;
use crate::trace::RayTracer;
use crate::trace::motion::END_TIME;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::shape::{AreaSampling, SurfacePoint, TriangleSampling};
use kinetoscope_scene::vector::{V3, dot, sub, to_f64};
use kinetoscope_scene::{Instance, RenderScene};
use std::sync::Arc;

/// The emissive instances of a frame; keeps its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Emitters {
    list: Vec<Emitter>,
    /// Sum of the powers of all emitters, in any unit.
    power: f64,
}

/// An emissive instance.
#[derive(Clone, Debug)]
pub(super) struct Emitter {
    pub(super) instance: u32,
    surface: EmitterShape,
    /// Surface area \[m²\].
    area: f64,
    /// Cumulative power of all emitters up to this one, in any unit.
    cumulative_power: f64,
    /// Probability of sampling this emitter.
    probability: f64,
}

/// A surface whose points can be sampled. Shapes without sampling are only hit by paths.
#[derive(Clone, Debug)]
enum EmitterShape {
    Closed(Shape),
    Triangles(TriangleSampling),
}

impl EmitterShape {
    fn from_shape(shape: &Shape) -> Option<Self> {
        let triangles = shape.triangle_sampling().map(Self::Triangles);
        triangles.or_else(|| shape.area_sampling().map(|_| Self::Closed(shape.clone())))
    }

    /// True if the surface is the mesh of `shape`, compared by address; false for other surfaces.
    fn matches(&self, shape: &Shape) -> bool {
        // Other surfaces hold no data worth keeping.
        matches!((self, shape.mesh()), (Self::Triangles(sampling), Some(mesh)) if Arc::ptr_eq(sampling.mesh(), mesh))
    }

    fn sampling(&self) -> Option<&dyn AreaSampling> {
        match self {
            Self::Closed(shape) => shape.area_sampling(),
            Self::Triangles(sampling) => Some(sampling),
        }
    }

    fn is_one_sided(&self) -> bool {
        matches!(self, Self::Closed(shape) if shape.is_one_sided())
    }
}

impl Emitter {
    /// Samples a point that may be visible from `from`, both in the emitter's frame, by three random numbers in 0..1.
    /// Returns the point and the pdf of its direction \[1/sr\], given this emitter; `None` if the numbers give no
    /// point.
    pub(super) fn sample(&self, from: V3, side: f64, at: [f64; 2]) -> Option<(SurfacePoint, f64)> {
        let (point, density) = self.surface.sampling()?.sample_from(from, side, at)?;
        let density = density.or_else(|| self.pdf_by_area(from, point.position, point.normal))?;
        Some((point, density))
    }

    /// Pdf with which [`sample`](Self::sample) finds the direction from `from` to the visible surface point `at`
    /// \[1/sr\], given this emitter; all in the emitter's frame. `None` if the surface is not sampled there: from
    /// behind if one-sided, or at a grazing angle.
    pub(super) fn pdf(&self, from: V3, at: V3, normal: V3) -> Option<f64> {
        self.surface.sampling()?.pdf_from(from).or_else(|| self.pdf_by_area(from, at, normal))
    }

    fn pdf_by_area(&self, from: V3, at: V3, normal: V3) -> Option<f64> {
        let to = sub(at, from);
        let (square, slant) = (dot(to, to), dot(to, normal));
        // A one-sided surface is invisible from behind.
        if self.surface.is_one_sided() && slant >= 0.0 {
            return None;
        }
        let density = square * square.sqrt() / (slant.abs() * self.area);
        (density > 0.0 && density.is_finite()).then_some(density)
    }

    /// Probability of sampling this emitter.
    pub(super) fn probability(&self) -> f64 {
        self.probability
    }
}

impl Emitters {
    pub(super) fn bytes(&self) -> usize {
        let sums = self.list.iter().map(|emitter| match &emitter.surface {
            EmitterShape::Triangles(sampling) => sampling.bytes(),
            EmitterShape::Closed(_) => 0,
        });
        self.list.capacity() * size_of::<Emitter>() + sums.sum::<usize>()
    }

    /// Finds the emissive instances among those that rays hit.
    pub(super) fn prepare(&mut self, scene: &RenderScene, tracer: &RayTracer) {
        let Self { list, power } = self;
        let (mut count, mut sum) = (0, 0.0);
        for (k, instance) in scene.instances().iter().enumerate() {
            let bright = brightness(to_f64(scene.linear_colors()[k])) * strength(instance);
            if !(bright > 0.0 && bright.is_finite()) || tracer.pose_of(k as u32, END_TIME).is_none() {
                continue;
            }
            // The cumulative areas of a mesh are kept from frame to frame.
            let known = list.get(count).is_some_and(|e| e.instance == k as u32 && e.surface.matches(&instance.shape));
            if !known {
                let Some(surface) = EmitterShape::from_shape(&instance.shape) else { continue };
                let area = surface.sampling().map_or(0.0, AreaSampling::area);
                let emitter = Emitter { instance: k as u32, surface, area, cumulative_power: 0.0, probability: 0.0 };
                match list.get_mut(count) {
                    Some(other) => *other = emitter,
                    None => list.push(emitter),
                }
            }
            let Some(emitter) = list.get_mut(count) else { continue };
            let own = bright * emitter.area;
            if !(own > 0.0 && own.is_finite()) {
                continue;
            }
            sum += own;
            (emitter.cumulative_power, emitter.probability) = (sum, own);
            count += 1;
        }
        list.truncate(count);
        list.iter_mut().for_each(|emitter| emitter.probability /= sum);
        *power = sum;
    }

    /// Samples an emitter with a probability in proportion to its power, by a random number in 0..1; `None` without
    /// emitters.
    pub(super) fn sample(&self, number: f64) -> Option<&Emitter> {
        let place = number * self.power;
        let k = self.list.partition_point(|emitter| emitter.cumulative_power <= place);
        self.list.get(k.min(self.list.len().checked_sub(1)?))
    }

    /// The emitter of an instance; `None` if its surface is not sampled.
    pub(super) fn for_instance(&self, instance: u32) -> Option<&Emitter> {
        let k = self.list.binary_search_by_key(&instance, |emitter| emitter.instance).ok()?;
        self.list.get(k)
    }
}

/// Strength of the emission, relative to the color of the instance.
fn strength(instance: &Instance) -> f64 {
    let material = &instance.material;
    let part = |x: f32| f64::from(x.clamp(0.0, 1.0));
    // Boxes mirror on one face of six.
    let mirrored = if matches!(instance.shape, Shape::Box(_)) { 0.0 } else { part(material.reflectance) };
    f64::from(material.emission.max(0.0)) * (1.0 - mirrored) * part(material.rgba[3])
}

/// Weight of a sample with pdf `own` that another strategy finds with pdf `other`.
pub(super) fn power_heuristic(own: f64, other: f64) -> f64 {
    // Squares of large pdfs may leave the range: their ratio does not.
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}

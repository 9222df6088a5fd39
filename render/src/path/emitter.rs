//! Things that glow, as lights to look for: a point of them is chosen at every surface, besides the direction that the surface
//! chooses itself. Light that both ways may find is shared between them by their densities.
//!
//! Source: Veach and Guibas, Optimally combining sampling techniques for Monte Carlo rendering, SIGGRAPH 1995 (the power
//! heuristic).

use super::brightness;
use crate::trace::Tracer;
use crate::trace::motion::NOW;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::shape::{AreaSampling, SurfacePoint, TriangleSampling};
use kinetoscope_scene::vector::{V3, dot, sub, to_f64};
use kinetoscope_scene::{Instance, RenderScene};
use std::sync::Arc;

/// The things that glow in a frame; keeps its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Emitters {
    list: Vec<Emitter>,
    /// Sum of the powers of all.
    power: f64,
}

/// A thing that glows.
#[derive(Clone, Debug)]
pub(super) struct Emitter {
    pub(super) instance: u32,
    surface: Surface,
    /// \[m²\].
    area: f64,
    /// Power of this and all before, in any unit.
    until: f64,
    /// The part of all choices that are this.
    share: f64,
}

/// A surface of which points are sampled. Those of some shapes are not: paths meet them.
#[derive(Clone, Debug)]
enum Surface {
    Closed(Shape),
    Triangles(TriangleSampling),
}

impl Surface {
    fn of(shape: &Shape) -> Option<Self> {
        let triangles = shape.triangle_sampling().map(Self::Triangles);
        triangles.or_else(|| shape.area_sampling().map(|_| Self::Closed(shape.clone())))
    }

    /// True if it is what `shape` has: meshes are compared by their address.
    fn is_of(&self, shape: &Shape) -> bool {
        // Of others there is nothing that is worth keeping.
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
    /// A point that may be seen from `from`, both in its own frame, sampled by three numbers in 0..1, and the density of its
    /// direction \[1/sr\], of this emitter.
    pub(super) fn choose(&self, from: V3, side: f64, at: [f64; 2]) -> Option<(SurfacePoint, f64)> {
        let (point, density) = self.surface.sampling()?.sample_from(from, side, at)?;
        let density = density.or_else(|| self.density_by_area(from, point.position, point.normal))?;
        Some((point, density))
    }

    /// How likely the direction from `from` to a point of its surface is \[1/sr\]; `None` where it is never chosen.
    pub(super) fn density(&self, from: V3, at: V3, normal: V3) -> Option<f64> {
        self.surface.sampling()?.density_from(from).or_else(|| self.density_by_area(from, at, normal))
    }

    fn density_by_area(&self, from: V3, at: V3, normal: V3) -> Option<f64> {
        let to = sub(at, from);
        let (square, slant) = (dot(to, to), dot(to, normal));
        // From behind, the surface is not there.
        if self.surface.is_one_sided() && slant >= 0.0 {
            return None;
        }
        let density = square * square.sqrt() / (slant.abs() * self.area);
        (density > 0.0 && density.is_finite()).then_some(density)
    }

    /// The part of all choices that are this emitter.
    pub(super) fn share(&self) -> f64 {
        self.share
    }
}

impl Emitters {
    pub(super) fn bytes(&self) -> usize {
        let sums = self.list.iter().map(|emitter| match &emitter.surface {
            Surface::Triangles(sampling) => sampling.bytes(),
            Surface::Closed(_) => 0,
        });
        self.list.capacity() * size_of::<Emitter>() + sums.sum::<usize>()
    }

    /// Finds what glows of what rays meet.
    pub(super) fn prepare(&mut self, scene: &RenderScene, tracer: &Tracer) {
        let Self { list, power } = self;
        let (mut count, mut sum) = (0, 0.0);
        for (k, instance) in scene.instances().iter().enumerate() {
            let bright = brightness(to_f64(scene.linear_colors()[k])) * strength(instance);
            if !(bright > 0.0 && bright.is_finite()) || tracer.pose_of(k as u32, NOW).is_none() {
                continue;
            }
            // Sums over a mesh are kept from frame to frame.
            let known = list.get(count).is_some_and(|e| e.instance == k as u32 && e.surface.is_of(&instance.shape));
            if !known {
                let Some(surface) = Surface::of(&instance.shape) else { continue };
                let area = surface.sampling().map_or(0.0, AreaSampling::area);
                let emitter = Emitter { instance: k as u32, surface, area, until: 0.0, share: 0.0 };
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
            (emitter.until, emitter.share) = (sum, own);
            count += 1;
        }
        list.truncate(count);
        list.iter_mut().for_each(|emitter| emitter.share /= sum);
        *power = sum;
    }

    /// One of them, as often as it is bright, by a number in 0..1; `None` where nothing glows.
    pub(super) fn choose(&self, number: f64) -> Option<&Emitter> {
        let place = number * self.power;
        let k = self.list.partition_point(|emitter| emitter.until <= place);
        self.list.get(k.min(self.list.len().checked_sub(1)?))
    }

    /// The emitter that an instance is.
    pub(super) fn of(&self, instance: u32) -> Option<&Emitter> {
        let k = self.list.binary_search_by_key(&instance, |emitter| emitter.instance).ok()?;
        self.list.get(k)
    }
}

/// How much it glows, for its color.
fn strength(instance: &Instance) -> f64 {
    let material = &instance.material;
    let part = |x: f32| f64::from(x.clamp(0.0, 1.0));
    // Boxes mirror on one face of six.
    let mirrored = if matches!(instance.shape, Shape::Box(_)) { 0.0 } else { part(material.reflectance) };
    f64::from(material.emission.max(0.0)) * (1.0 - mirrored) * part(material.rgba[3])
}

/// The share of light that was found in a way of density `own`, where another way finds it with density `other`.
pub(super) fn power_heuristic(own: f64, other: f64) -> f64 {
    // Squares of large densities may leave the range: their ratio does not.
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}

//! Things that glow, as lights to look for: a point of them is chosen at every surface, besides the direction that the surface
//! chooses itself. Light that both ways may find is shared between them by their densities.
//!
//! Sources: Veach and Guibas, Optimally combining sampling techniques for Monte Carlo rendering, SIGGRAPH 1995 (the power
//! heuristic); Shirley, Wang and Zimmerman, Monte Carlo techniques for direct lighting calculations, 1996 (cones of balls).

use super::brightness;
use crate::trace::Tracer;
use crate::trace::motion::NOW;
use kinetoscope_scene::basis::Basis;
use kinetoscope_scene::sampling::{on_disc, turn};
use kinetoscope_scene::vector::{V3, along, cross, dot, scale, sub, to_f64, unit};
use kinetoscope_scene::{Instance, RenderMesh, RenderScene, Shape};
use std::f64::consts::PI;
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

/// A surface of which points are chosen. Those of capsules, ellipsoids and height fields are not: paths meet them.
#[derive(Clone, Debug)]
enum Surface {
    /// Half lengths \[m\]; seen from +z only.
    Rectangle([f64; 2]),
    /// Radius \[m\].
    Ball(f64),
    /// Half lengths \[m\].
    Brick(V3),
    /// Radius and half length \[m\].
    Cylinder([f64; 2]),
    /// Sums of the areas of the triangles up to each \[m²\].
    Triangles(Arc<RenderMesh>, Vec<f64>),
}

/// A point of a surface, in its own frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chosen {
    pub(super) at: V3,
    /// Unit, out of the body.
    pub(super) normal: V3,
    pub(super) triangle: u32,
    /// How likely its direction is \[1/sr\], of this emitter.
    pub(super) density: f64,
}

impl Surface {
    fn of(shape: &Shape) -> Option<Self> {
        match shape {
            Shape::Plane(plane) => {
                let half = plane.half.map(f64::from);
                // 0 is without an end.
                half.iter().all(|h| *h > 0.0 && h.is_finite()).then_some(Self::Rectangle(half))
            }
            Shape::Sphere(sphere) => Some(Self::Ball(sphere.radius.into())),
            Shape::Box(brick) => Some(Self::Brick(to_f64(brick.half))),
            Shape::Cylinder(round) => Some(Self::Cylinder([round.radius.into(), round.half_length.into()])),
            Shape::Mesh(mesh) => {
                let mesh = &mesh.mesh;
                let areas = (0..mesh.triangles().len()).scan(0.0, |sum, k| {
                    let [a, b, c] = corners(mesh, k);
                    let across = cross(sub(b, a), sub(c, a));
                    *sum += 0.5 * dot(across, across).sqrt();
                    Some(*sum)
                });
                Some(Self::Triangles(Arc::clone(mesh), areas.collect()))
            }
            _ => None,
        }
    }

    /// Whether it is what `shape` has: meshes are looked at by their address.
    fn is_of(&self, shape: &Shape) -> bool {
        // Of others there is nothing that is worth keeping.
        matches!((self, shape), (Self::Triangles(mesh, _), Shape::Mesh(other)) if Arc::ptr_eq(mesh, &other.mesh))
    }

    /// \[m²\].
    fn area(&self) -> f64 {
        match self {
            Self::Rectangle([a, b]) => 4.0 * a * b,
            Self::Ball(r) => 4.0 * PI * r * r,
            Self::Brick([a, b, c]) => 8.0 * (a * b + b * c + c * a),
            Self::Cylinder([r, h]) => 2.0 * PI * r * (r + 2.0 * h),
            Self::Triangles(_, sums) => sums.last().copied().unwrap_or(0.0),
        }
    }

    /// A point of the surface, evenly by its area, chosen by a number for the side and two for the place on it.
    fn point(&self, side: f64, [a, b]: [f64; 2]) -> (V3, V3, u32) {
        match self {
            Self::Rectangle([x, y]) => ([x * (2.0 * a - 1.0), y * (2.0 * b - 1.0), 0.0], [0.0, 0.0, 1.0], 0),
            Self::Ball(r) => {
                let z = 2.0 * a - 1.0;
                let ([cos, sin], flat) = (turn(b), (1.0 - z * z).max(0.0).sqrt());
                let normal = [flat * cos, flat * sin, z];
                (scale(normal, *r), normal, 0)
            }
            Self::Brick(half) => {
                let faces = [half[1] * half[2], half[2] * half[0], half[0] * half[1]];
                let mut left = side * 2.0 * faces.iter().sum::<f64>();
                let mut face = 0;
                while face < 5 && left >= faces[face / 2] {
                    left -= faces[face / 2];
                    face += 1;
                }
                let (axis, sign) = (face / 2, if face % 2 == 0 { 1.0 } else { -1.0 });
                let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
                let (mut at, mut normal) = ([0.0; 3], [0.0; 3]);
                (at[axis], normal[axis]) = (sign * half[axis], sign);
                (at[j], at[k]) = (half[j] * (2.0 * a - 1.0), half[k] * (2.0 * b - 1.0));
                (at, normal, 0)
            }
            Self::Cylinder([r, h]) => {
                let round = 2.0 * h / (r + 2.0 * h);
                if side < round {
                    let [cos, sin] = turn(a);
                    return ([r * cos, r * sin, h * (2.0 * b - 1.0)], [cos, sin, 0.0], 0);
                }
                let sign = if side - round < 0.5 * (1.0 - round) { 1.0 } else { -1.0 };
                let [x, y] = on_disc([a, b]);
                ([r * x, r * y, sign * h], [0.0, 0.0, sign], 0)
            }
            Self::Triangles(mesh, sums) => {
                let place = side * sums.last().copied().unwrap_or(0.0);
                let k = sums.partition_point(|&sum| sum <= place).min(sums.len().saturating_sub(1));
                let [p, q, r] = corners(mesh, k);
                // Source: Turk, Generating random points in triangles, Graphics Gems, 1990.
                let root = a.sqrt();
                let at = along(along(scale(p, 1.0 - root), root * (1.0 - b), q), root * b, r);
                (at, unit(cross(sub(q, p), sub(r, p))).unwrap_or([0.0, 0.0, 1.0]), k as u32)
            }
        }
    }
}

fn corners(mesh: &RenderMesh, triangle: usize) -> [V3; 3] {
    mesh.triangles()[triangle].map(|i| to_f64(mesh.positions()[i as usize]))
}

impl Emitter {
    /// A point that may be seen from `from`, in its own frame, chosen by three numbers in 0..1.
    pub(super) fn choose(&self, from: V3, side: f64, at: [f64; 2]) -> Option<Chosen> {
        if let Some((radius, square)) = self.outside_of_ball(from) {
            // A direction in the cone around the ball.
            let (distance, sine2) = (square.sqrt(), radius * radius / square);
            let lost = sine2 / (1.0 + (1.0 - sine2).max(0.0).sqrt());
            let low = at[0] * lost;
            let (cos, sin2) = (1.0 - low, (low * (2.0 - low)).max(0.0));
            let ([c, s], sin) = (turn(at[1]), sin2.sqrt());
            let basis = Basis::of(scale(from, -1.0 / distance));
            let direction = basis.to_world([sin * c, sin * s, cos]);
            let far = distance * cos - (radius * radius - square * sin2).max(0.0).sqrt();
            let normal = unit(along(from, far, direction))?;
            return Some(Chosen { at: scale(normal, radius), normal, triangle: 0, density: 1.0 / (2.0 * PI * lost) });
        }
        let (at, normal, triangle) = self.surface.point(side, at);
        let density = self.density(from, at, normal)?;
        Some(Chosen { at, normal, triangle, density })
    }

    /// How likely the direction from `from` to a point of its surface is \[1/sr\]; `None` where it is never chosen.
    pub(super) fn density(&self, from: V3, at: V3, normal: V3) -> Option<f64> {
        if let Some((radius, square)) = self.outside_of_ball(from) {
            let sine2 = radius * radius / square;
            return Some((1.0 + (1.0 - sine2).max(0.0).sqrt()) / (2.0 * PI * sine2));
        }
        let to = sub(at, from);
        let (square, slant) = (dot(to, to), dot(to, normal));
        // From behind a rectangle is not there.
        if matches!(self.surface, Surface::Rectangle(_)) && slant >= 0.0 {
            return None;
        }
        let density = square * square.sqrt() / (slant.abs() * self.area);
        (density > 0.0 && density.is_finite()).then_some(density)
    }

    /// Of a ball that `from` is outside of: its radius, and the square of the distance.
    fn outside_of_ball(&self, from: V3) -> Option<(f64, f64)> {
        let Surface::Ball(radius) = self.surface else { return None };
        let square = dot(from, from);
        (square > radius * radius * (1.0 + 1e-9)).then_some((radius, square))
    }

    /// The part of all choices that are this emitter.
    pub(super) fn share(&self) -> f64 {
        self.share
    }
}

impl Emitters {
    pub(super) fn bytes(&self) -> usize {
        let sums = self.list.iter().map(|emitter| match &emitter.surface {
            Surface::Triangles(_, sums) => sums.capacity() * size_of::<f64>(),
            _ => 0,
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
                let area = surface.area();
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

/// How much it glows, for its colour.
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

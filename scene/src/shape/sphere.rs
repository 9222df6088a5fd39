//! A sphere.

use super::area_sampling::{AreaSampling, SurfacePoint};
use super::closed_form::{ClosedForm, HullPart, Intersection};
use super::interval::sphere_interval;
use super::revolution::{arc, revolve};
use crate::Ray;
use crate::basis::OrthonormalBasis;
use crate::mesh::TriMesh;
use crate::sampling::cos_sin_turns;
use crate::vector::{V3, add_scaled, dot, norm, normalize, scale};
use std::f64::consts::PI;

/// A sphere centered at the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Radius \[m\].
    pub radius: f32,
}

impl ClosedForm for Sphere {
    fn sizes(&self) -> Vec<f32> {
        vec![self.radius]
    }

    fn bounds(&self) -> [V3; 2] {
        let r = f64::from(self.radius);
        [[-r; 3], [r; 3]]
    }

    fn tessellate(&self, segments: usize) -> TriMesh {
        let quarter = std::f64::consts::FRAC_PI_2;
        revolve(&arc(self.radius.into(), 0.0, -quarter, quarter, segments.div_ceil(2)), segments)
    }

    fn support(&self, direction: V3) -> f64 {
        f64::from(self.radius) * norm(direction)
    }

    fn hull(&self, add: &mut dyn FnMut(HullPart)) {
        add(HullPart::Ellipsoid { center: [0.0; 3], radii: [self.radius.into(); 3] });
    }

    #[inline(always)]
    fn intersect(&self, ray: &Ray, limit: f64) -> Option<Intersection> {
        let radius = f64::from(self.radius);
        let t = sphere_interval(ray.origin, ray.direction, radius).first(limit)?;
        Some(Intersection { t, normal: scale(add_scaled(ray.origin, t, ray.direction), 1.0 / radius) })
    }

    fn area_sampling(&self) -> Option<&dyn AreaSampling> {
        Some(self)
    }
}

impl Sphere {
    /// Radius, and squared distance of a point outside from the center; `None` for a point inside or on the surface.
    fn outside_distance(&self, from: V3) -> Option<(f64, f64)> {
        let (radius, square) = (f64::from(self.radius), dot(from, from));
        (square > radius * radius * (1.0 + 1e-9)).then_some((radius, square))
    }
}

/// From outside, directions in the cone around the sphere are sampled. Source: Shirley, Wang and Zimmerman, Monte Carlo
/// techniques for direct lighting calculations, 1996.
impl AreaSampling for Sphere {
    fn area(&self) -> f64 {
        let r = f64::from(self.radius);
        4.0 * PI * r * r
    }

    fn sample(&self, _side: f64, [a, b]: [f64; 2]) -> SurfacePoint {
        let z = 2.0 * a - 1.0;
        let ([cos, sin], flat) = (cos_sin_turns(b), (1.0 - z * z).max(0.0).sqrt());
        let normal = [flat * cos, flat * sin, z];
        SurfacePoint { position: scale(normal, self.radius.into()), normal, triangle: 0 }
    }

    fn sample_from(&self, from: V3, side: f64, at: [f64; 2]) -> Option<(SurfacePoint, Option<f64>)> {
        let Some((radius, square)) = self.outside_distance(from) else { return Some((self.sample(side, at), None)) };
        let (distance, sine2) = (square.sqrt(), radius * radius / square);
        let one_minus_cos_max = sine2 / (1.0 + (1.0 - sine2).max(0.0).sqrt());
        let low = at[0] * one_minus_cos_max;
        let (cos, sin2) = (1.0 - low, (low * (2.0 - low)).max(0.0));
        let ([c, s], sin) = (cos_sin_turns(at[1]), sin2.sqrt());
        let basis = OrthonormalBasis::from_normal(scale(from, -1.0 / distance));
        let direction = basis.to_world([sin * c, sin * s, cos]);
        let far = distance * cos - (radius * radius - square * sin2).max(0.0).sqrt();
        let normal = normalize(add_scaled(from, far, direction))?;
        let point = SurfacePoint { position: scale(normal, radius), normal, triangle: 0 };
        Some((point, Some(1.0 / (2.0 * PI * one_minus_cos_max))))
    }

    fn pdf_from(&self, from: V3) -> Option<f64> {
        let (radius, square) = self.outside_distance(from)?;
        let sine2 = radius * radius / square;
        Some((1.0 + (1.0 - sine2).max(0.0).sqrt()) / (2.0 * PI * sine2))
    }
}

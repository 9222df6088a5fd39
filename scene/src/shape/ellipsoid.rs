//! An ellipsoid.

use super::area_sampling::AreaSampling;
use super::closed_form::{ClosedForm, HullPart, Intersection};
use super::interval::sphere_interval;
use super::sphere::Sphere;
use crate::Ray;
use crate::mesh::TriMesh;
use crate::vector::{V3, add_scaled, norm, normalize, to_f64};

/// An ellipsoid centered at the origin, with its axes along x, y and z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Half lengths along x, y and z \[m\].
    pub radii: [f32; 3],
}

impl ClosedForm for Ellipsoid {
    fn sizes(&self) -> Vec<f32> {
        self.radii.to_vec()
    }

    fn bounds(&self) -> [V3; 2] {
        let radii = to_f64(self.radii);
        [radii.map(|r| -r), radii]
    }

    fn tessellate(&self, segments: usize) -> TriMesh {
        Sphere { radius: 1.0 }.tessellate(segments).scaled(to_f64(self.radii))
    }

    fn support(&self, direction: V3) -> f64 {
        norm([0, 1, 2].map(|k| f64::from(self.radii[k]) * direction[k]))
    }

    fn hull(&self, add: &mut dyn FnMut(HullPart)) {
        add(HullPart::Ellipsoid { center: [0.0; 3], radii: to_f64(self.radii) });
    }

    #[inline(always)]
    fn intersect(&self, ray: &Ray, limit: f64) -> Option<Intersection> {
        let radii = to_f64(self.radii);
        let round = |v: V3| [0, 1, 2].map(|k| v[k] / radii[k]);
        let t = sphere_interval(round(ray.origin), round(ray.direction), 1.0).first(limit)?;
        // The gradient of x²/a² + y²/b² + z²/c².
        let normal = normalize(round(round(add_scaled(ray.origin, t, ray.direction))))?;
        Some(Intersection { t, normal })
    }

    fn area_sampling(&self) -> Option<&dyn AreaSampling> {
        None
    }
}

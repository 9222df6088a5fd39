//! A capsule.

use super::area_sampling::AreaSampling;
use super::closed_form::{ClosedForm, HullPart, Intersection};
use super::interval::{Interval, cylinder_interval, slab_interval, sphere_interval};
use super::revolution::{arc, revolve};
use crate::Ray;
use crate::mesh::TriMesh;
use crate::vector::{V3, add_scaled, norm, normalize};

/// A capsule centered at the origin: a cylinder along z with a hemisphere at each end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// Radius \[m\].
    pub radius: f32,
    /// Half the length of the cylindrical part \[m\].
    pub half_length: f32,
}

impl ClosedForm for Capsule {
    fn sizes(&self) -> Vec<f32> {
        vec![self.radius, self.half_length]
    }

    fn bounds(&self) -> [V3; 2] {
        let r = f64::from(self.radius);
        let z = r + f64::from(self.half_length);
        [[-r, -r, -z], [r, r, z]]
    }

    fn tessellate(&self, segments: usize) -> TriMesh {
        let (r, h) = (f64::from(self.radius), f64::from(self.half_length));
        let (quarter, steps) = (std::f64::consts::FRAC_PI_2, segments.div_ceil(4));
        let mut profile = arc(r, -h, -quarter, 0.0, steps);
        profile.extend(arc(r, h, 0.0, quarter, steps));
        revolve(&profile, segments)
    }

    fn support(&self, direction: V3) -> f64 {
        f64::from(self.radius) * norm(direction) + f64::from(self.half_length) * direction[2].abs()
    }

    fn hull(&self, add: &mut dyn FnMut(HullPart)) {
        let (r, h) = (f64::from(self.radius), f64::from(self.half_length));
        [-h, h].into_iter().for_each(|z| add(HullPart::Ellipsoid { center: [0.0, 0.0, z], radii: [r; 3] }));
    }

    #[inline(always)]
    fn intersect(&self, ray: &Ray, limit: f64) -> Option<Intersection> {
        let (o, d) = (ray.origin, ray.direction);
        let (r, h) = (f64::from(self.radius), f64::from(self.half_length));
        let side = cylinder_interval(o, d, r);
        // The spheres at the ends are inside of the infinite cylinder.
        if side.is_empty() {
            return None;
        }
        let middle = side.intersection(slab_interval(o[2], d[2], h));
        let middle = if middle.is_empty() { Interval::EMPTY } else { middle };
        let whole = [h, -h].iter().fold(middle, |all, end| all.hull(sphere_interval([o[0], o[1], o[2] - end], d, r)));
        let t = whole.first(limit)?;
        let [x, y, z] = add_scaled(o, t, d);
        Some(Intersection { t, normal: normalize([x, y, z - z.clamp(-h, h)])? })
    }

    fn area_sampling(&self) -> Option<&dyn AreaSampling> {
        None
    }
}

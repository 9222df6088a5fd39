//! A cylinder.

use super::area_sampling::{AreaSampling, SurfacePoint};
use super::closed_form::{ClosedForm, HullPart, Intersection};
use super::interval::{cylinder_interval, slab_interval};
use super::revolution::revolve;
use crate::Ray;
use crate::mesh::TriMesh;
use crate::sampling::{cos_sin_turns, sample_disk};
use crate::vector::{V3, add_scaled, normalize};
use std::f64::consts::PI;

/// A solid cylinder with flat ends, centered at the origin, with its axis along z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// Radius \[m\].
    pub radius: f32,
    /// Half the length \[m\].
    pub half_length: f32,
}

impl Cylinder {
    /// Radius and half length \[m\].
    #[inline(always)]
    fn size(&self) -> [f64; 2] {
        [self.radius.into(), self.half_length.into()]
    }
}

impl ClosedForm for Cylinder {
    fn sizes(&self) -> Vec<f32> {
        vec![self.radius, self.half_length]
    }

    fn bounds(&self) -> [V3; 2] {
        let [r, h] = self.size();
        [[-r, -r, -h], [r, r, h]]
    }

    fn tessellate(&self, segments: usize) -> TriMesh {
        let [r, h] = self.size();
        revolve(&[[0., -h], [r, -h], [r, h], [0., h]], segments)
    }

    fn support(&self, direction: V3) -> f64 {
        let ([x, y, z], [r, h]) = (direction, self.size());
        r * x.hypot(y) + h * z.abs()
    }

    fn hull(&self, add: &mut dyn FnMut(HullPart)) {
        let [r, h] = self.size();
        [-h, h].into_iter().for_each(|z| add(HullPart::Ellipsoid { center: [0.0, 0.0, z], radii: [r, r, 0.0] }));
    }

    #[inline(always)]
    fn intersect(&self, ray: &Ray, limit: f64) -> Option<Intersection> {
        let (o, d, [radius, half_length]) = (ray.origin, ray.direction, self.size());
        let (side, ends) = (cylinder_interval(o, d, radius), slab_interval(o[2], d[2], half_length));
        let t = side.intersection(ends).first(limit)?;
        // True if the intersection is at an end.
        let flat = if t == ends.enter || t == ends.leave { t != side.enter && t != side.leave } else { false };
        let [x, y, _] = add_scaled(o, t, d);
        let normal = if flat { [0.0, 0.0, 1.0] } else { normalize([x, y, 0.0])? };
        Some(Intersection { t, normal })
    }

    /// Index of the face: 0 side, 1 lower end, 2 upper end.
    fn face(&self, intersection: &Intersection, ray: &Ray) -> usize {
        match intersection.normal {
            [0.0, 0.0, _] => 1 + usize::from(ray.at(intersection.t)[2] >= 0.0),
            _ => 0,
        }
    }

    fn area_sampling(&self) -> Option<&dyn AreaSampling> {
        Some(self)
    }
}

impl AreaSampling for Cylinder {
    fn area(&self) -> f64 {
        let [r, h] = self.size();
        2.0 * PI * r * (r + 2.0 * h)
    }

    fn sample(&self, side: f64, [a, b]: [f64; 2]) -> SurfacePoint {
        let [r, h] = self.size();
        let round = 2.0 * h / (r + 2.0 * h);
        if side < round {
            let [cos, sin] = cos_sin_turns(a);
            let position = [r * cos, r * sin, h * (2.0 * b - 1.0)];
            return SurfacePoint { position, normal: [cos, sin, 0.0], triangle: 0 };
        }
        let sign = if side - round < 0.5 * (1.0 - round) { 1.0 } else { -1.0 };
        let [x, y] = sample_disk([a, b]);
        SurfacePoint { position: [r * x, r * y, sign * h], normal: [0.0, 0.0, sign], triangle: 0 }
    }
}

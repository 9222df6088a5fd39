//! A box.

use super::area_sampling::{AreaSampling, SurfacePoint};
use super::closed_form::{ClosedForm, HullPart, Intersection};
use super::interval::slab_interval;
use crate::Ray;
use crate::mesh::TriMesh;
use crate::vector::{V3, to_f64};

/// A box centered at the origin, with faces normal to the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Box {
    /// Half lengths along x, y and z \[m\].
    pub half: [f32; 3],
}

impl Box {
    fn corner(&self, corner: usize) -> [f32; 3] {
        [0, 1, 2].map(|k| if corner >> k & 1 == 1 { self.half[k] } else { -self.half[k] })
    }
}

impl ClosedForm for Box {
    fn sizes(&self) -> Vec<f32> {
        self.half.to_vec()
    }

    fn bounds(&self) -> [V3; 2] {
        let half = to_f64(self.half);
        [half.map(|h| -h), half]
    }

    fn tessellate(&self, _segments: usize) -> TriMesh {
        let positions = (0..8).map(|corner| self.corner(corner)).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|q: &[u32; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
        TriMesh::from_triangles(positions, triangles)
    }

    fn support(&self, direction: V3) -> f64 {
        (0..3).map(|k| f64::from(self.half[k]) * direction[k].abs()).sum()
    }

    fn hull(&self, add: &mut dyn FnMut(HullPart)) {
        (0..8).for_each(|corner| add(HullPart::Point(to_f64(self.corner(corner)))));
    }

    #[inline(always)]
    fn intersect(&self, ray: &Ray, limit: f64) -> Option<Intersection> {
        let slabs = [0, 1, 2].map(|k| slab_interval(ray.origin[k], ray.direction[k], self.half[k].into()));
        let t = slabs[0].intersection(slabs[1]).intersection(slabs[2]).first(limit)?;
        let axis = slabs.iter().position(|s| t == s.enter || t == s.leave).unwrap_or(2);
        Some(Intersection { t, normal: [0, 1, 2].map(|k| if k == axis { 1.0 } else { 0.0 }) })
    }

    /// Index of the face at the intersection, 0 to 5: -x, +x, -y, +y, -z, +z.
    fn face(&self, intersection: &Intersection, ray: &Ray) -> usize {
        let axis = intersection.normal.iter().position(|&n| n != 0.0).unwrap_or(2);
        2 * axis + usize::from(ray.at(intersection.t)[axis] >= 0.0)
    }

    fn area_sampling(&self) -> Option<&dyn AreaSampling> {
        Some(self)
    }
}

impl AreaSampling for Box {
    fn area(&self) -> f64 {
        let [a, b, c] = to_f64(self.half);
        8.0 * (a * b + b * c + c * a)
    }

    fn sample(&self, side: f64, [a, b]: [f64; 2]) -> SurfacePoint {
        let half = to_f64(self.half);
        let faces = [half[1] * half[2], half[2] * half[0], half[0] * half[1]];
        let mut left = side * 2.0 * faces.iter().sum::<f64>();
        let mut face = 0;
        while face < 5 && left >= faces[face / 2] {
            left -= faces[face / 2];
            face += 1;
        }
        let (axis, sign) = (face / 2, if face % 2 == 0 { 1.0 } else { -1.0 });
        let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
        let (mut position, mut normal) = ([0.0; 3], [0.0; 3]);
        (position[axis], normal[axis]) = (sign * half[axis], sign);
        (position[j], position[k]) = (half[j] * (2.0 * a - 1.0), half[k] * (2.0 * b - 1.0));
        SurfacePoint { position, normal, triangle: 0 }
    }
}

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
    /// Texture coordinates of a point of the surface, with v upward in the image, and their number per meter: the root of
    /// the ratio of areas, in the texture and on the face. `images` are the repetitions of the texture across and along a
    /// face.
    ///
    /// The image is across x and along y on the faces normal to z, y and z on those normal to x, x and z on those normal
    /// to y. On opposite faces, one image is a mirror image. Source: MuJoCo's classic renderer, from 3.12 on.
    pub fn face_coordinates(&self, point: V3, images: [f32; 2]) -> ([f64; 2], f64) {
        let half = to_f64(self.half);
        let at = [0, 1, 2].map(|k| point[k] / half[k]);
        let normal = if at[0].abs() >= at[1].abs() && at[0].abs() >= at[2].abs() {
            0
        } else if at[1].abs() >= at[2].abs() {
            1
        } else {
            2
        };
        let [across, along] = Self::FACE_AXES[normal];
        let [columns, rows] = images.map(f64::from);
        let uv = [(0.5 + 0.5 * at[across]) * columns, 1.0 - (0.5 - 0.5 * at[along]) * rows];
        (uv, ((columns * rows).abs() / (4.0 * half[across] * half[along])).sqrt())
    }

    /// Axes across and along the image on the faces normal to each axis.
    pub const FACE_AXES: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

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

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of the faces and their coordinates on one image per face, computed by hand: the image begins at the upper left
    /// corner, where the axis across it is at its least and the axis along it at its largest.
    #[test]
    fn coordinates_on_faces() {
        let cuboid = Box { half: [0.5, 0.25, 2.0] };
        for (point, across, down) in [
            // A quarter of the way across x, from a quarter below the upper end of y.
            ([-0.25, 0.125, 2.0], 0.25, 0.25),
            ([-0.25, 0.125, -2.0], 0.25, 0.25),
            ([0.5, 0.125, -1.0], 0.75, 0.75),
            ([-0.5, 0.125, -1.0], 0.75, 0.75),
            ([0.25, -0.25, 1.0], 0.75, 0.25),
            ([0.25, 0.25, 1.0], 0.75, 0.25),
        ] {
            for images in [[1.0f32, 1.0], [3.0, 2.0]] {
                let (found, density) = cuboid.face_coordinates(point, images);
                let expected = [across * f64::from(images[0]), 1.0 - down * f64::from(images[1])];
                assert_eq!(found, expected, "{point:?} {images:?}");
                // A step across and a step along the face: coordinates change by the root of the product.
                let normal = (0..3).find(|&k| point[k].abs() == f64::from(cuboid.half[k])).expect("a face");
                let moved = |axis: usize| {
                    let mut at = point;
                    at[axis] += 0.0625;
                    let (uv, _) = cuboid.face_coordinates(at, images);
                    (uv[0] - found[0]).hypot(uv[1] - found[1]) / 0.0625
                };
                let steps: Vec<f64> = (0..3).filter(|&axis| axis != normal).map(moved).collect();
                assert!((density - (steps[0] * steps[1]).sqrt()).abs() < 1e-9, "{point:?}: {density} {steps:?}");
            }
        }
    }
}

//! A plane.

use super::area_sampling::{AreaSampling, SurfacePoint};
use super::closed_form::{ClosedForm, HullPart, Intersection};
use crate::Ray;
use crate::mesh::TriMesh;
use crate::vector::V3;

/// The plane z = 0, visible from +z only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Half lengths along x and y \[m\]; 0 means infinite.
    pub half: [f32; 2],
}

impl Plane {
    /// A plane that is infinite in both directions.
    pub const INFINITE: Self = Self { half: [0.0, 0.0] };

    /// Half lengths along x and y \[m\]; +inf along an infinite axis.
    #[inline(always)]
    fn extent(&self) -> [f64; 2] {
        self.half.map(|h| if h == 0.0 { f64::INFINITY } else { h.into() })
    }
}

impl ClosedForm for Plane {
    fn sizes(&self) -> Vec<f32> {
        self.half.iter().copied().filter(|&h| h != 0.0).collect()
    }

    fn bounds(&self) -> [V3; 2] {
        let [x, y] = self.extent();
        [[-x, -y, 0.0], [x, y, 0.0]]
    }

    fn tessellate(&self, _segments: usize) -> TriMesh {
        let [x, y] = self.half.map(|h| if h == 0.0 { 100.0 } else { h });
        let positions = vec![[-x, -y, 0.], [x, -y, 0.], [x, y, 0.], [-x, y, 0.]];
        TriMesh::from_triangles(positions, vec![[0, 1, 2], [0, 2, 3]])
    }

    fn support(&self, direction: V3) -> f64 {
        let along = |k: usize| match (f64::from(self.half[k]), direction[k].abs()) {
            (_, 0.0) => 0.0,
            (0.0, _) => f64::INFINITY,
            (half, along) => half * along,
        };
        along(0) + along(1)
    }

    fn hull(&self, add: &mut dyn FnMut(HullPart)) {
        let [x, y] = self.extent();
        [[-x, -y], [x, -y], [x, y], [-x, y]].into_iter().for_each(|[x, y]| add(HullPart::Point([x, y, 0.0])));
    }

    #[inline(always)]
    fn intersect(&self, ray: &Ray, limit: f64) -> Option<Intersection> {
        let (o, d, half) = (ray.origin, ray.direction, self.extent());
        if d[2] >= 0.0 {
            return None;
        }
        let t = -o[2] / d[2];
        let inside = (0..2).all(|k| (o[k] + t * d[k]).abs() <= half[k]);
        (t >= 0.0 && t <= limit && inside).then_some(Intersection { t: t + 0.0, normal: [0.0, 0.0, 1.0] })
    }

    fn area_sampling(&self) -> Option<&dyn AreaSampling> {
        if self.half.iter().all(|h| *h > 0.0 && h.is_finite()) { Some(self) } else { None }
    }

    fn is_one_sided(&self) -> bool {
        true
    }
}

impl AreaSampling for Plane {
    fn area(&self) -> f64 {
        let [a, b] = self.extent();
        4.0 * a * b
    }

    fn sample(&self, _side: f64, [a, b]: [f64; 2]) -> SurfacePoint {
        let [x, y] = self.extent();
        let position = [x * (2.0 * a - 1.0), y * (2.0 * b - 1.0), 0.0];
        SurfacePoint { position, normal: [0.0, 0.0, 1.0], triangle: 0 }
    }
}

//! A plane.

use super::{RayShape, Touch};
use crate::geometry::assets::Assets;
use crate::geometry::bvh::Stack;
use kinetoscope_scene::Ray;
use kinetoscope_scene::vector::V3;

/// The plane z = 0, hit from +z only.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    half: [f64; 2],
}

impl Plane {
    pub(super) fn of(shape: &kinetoscope_scene::shape::Plane, _assets: &mut Assets) -> Self {
        // 0 is MuJoCo's way to say that it has no end.
        Self { half: shape.half.map(|h| if h == 0.0 { f64::INFINITY } else { h.into() }) }
    }
}

impl RayShape for Plane {
    #[inline(always)]
    fn touch(&self, ray: &Ray, limit: f64, _stack: &mut Stack) -> Option<Touch> {
        let (o, d) = (ray.origin, ray.direction);
        if d[2] >= 0.0 {
            return None;
        }
        let t = -o[2] / d[2];
        let inside = (0..2).all(|k| (o[k] + t * d[k]).abs() <= self.half[k]);
        (t >= 0.0 && t <= limit && inside).then_some(Touch { t: t + 0.0, normal: [0.0, 0.0, 1.0] })
    }

    fn bounds(&self) -> Option<[V3; 2]> {
        let [x, y] = self.half;
        (x.is_finite() && y.is_finite()).then_some([[-x, -y, 0.0], [x, y, 0.0]])
    }
}

//! A cylinder with round ends.

use super::interval::{Interval, ball, slab, tube};
use super::{RayShape, Touch};
use crate::geometry::assets::Assets;
use crate::geometry::bvh::Stack;
use kinetoscope_scene::Ray;
use kinetoscope_scene::vector::{V3, along, unit};

/// A cylinder along z with half a ball on each end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Capsule {
    radius: f64,
    half_length: f64,
}

impl Capsule {
    pub(super) fn of(shape: &kinetoscope_scene::shape::Capsule, _assets: &mut Assets) -> Self {
        Self { radius: shape.radius.into(), half_length: shape.half_length.into() }
    }
}

impl RayShape for Capsule {
    #[inline(always)]
    fn touch(&self, ray: &Ray, limit: f64, _stack: &mut Stack) -> Option<Touch> {
        let (o, d, r, h) = (ray.origin, ray.direction, self.radius, self.half_length);
        let side = tube(o, d, r);
        // The balls at the ends are inside of the tube.
        if side.is_empty() {
            return None;
        }
        let middle = side.and(slab(o[2], d[2], h));
        let middle = if middle.is_empty() { Interval::EMPTY } else { middle };
        let whole = [h, -h].iter().fold(middle, |all, end| all.or(ball([o[0], o[1], o[2] - end], d, r)));
        let t = whole.first(limit)?;
        let [x, y, z] = along(o, t, d);
        Some(Touch { t, normal: unit([x, y, z - z.clamp(-h, h)])? })
    }

    fn bounds(&self) -> Option<[V3; 2]> {
        let (r, z) = (self.radius, self.radius + self.half_length);
        Some([[-r, -r, -z], [r, r, z]])
    }
}

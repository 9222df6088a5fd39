//! A cylinder.

use super::interval::{slab, tube};
use super::{RayShape, Touch};
use crate::geometry::assets::Assets;
use crate::geometry::bvh::Stack;
use kinetoscope_scene::Ray;
use kinetoscope_scene::vector::{V3, along, unit};

/// A cylinder along z with flat ends.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cylinder {
    radius: f64,
    half_length: f64,
}

impl Cylinder {
    pub(super) fn of(shape: &kinetoscope_scene::shape::Cylinder, _assets: &mut Assets) -> Self {
        Self { radius: shape.radius.into(), half_length: shape.half_length.into() }
    }
}

impl RayShape for Cylinder {
    #[inline(always)]
    fn touch(&self, ray: &Ray, limit: f64, _stack: &mut Stack) -> Option<Touch> {
        let (o, d) = (ray.origin, ray.direction);
        let (side, ends) = (tube(o, d, self.radius), slab(o[2], d[2], self.half_length));
        let t = side.and(ends).first(limit)?;
        // The end that decided, if one did.
        let flat = if t == ends.enter || t == ends.leave { t != side.enter && t != side.leave } else { false };
        let [x, y, _] = along(o, t, d);
        let normal = if flat { [0.0, 0.0, 1.0] } else { unit([x, y, 0.0])? };
        Some(Touch { t, normal })
    }

    /// The side, the lower end, the upper one.
    fn face(&self, touch: &Touch, ray: &Ray) -> usize {
        match touch.normal {
            [0.0, 0.0, _] => 1 + usize::from(ray.at(touch.t)[2] >= 0.0),
            _ => 0,
        }
    }

    fn bounds(&self) -> Option<[V3; 2]> {
        let (r, h) = (self.radius, self.half_length);
        Some([[-r, -r, -h], [r, r, h]])
    }
}

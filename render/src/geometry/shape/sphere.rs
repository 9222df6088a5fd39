//! A ball.

use super::interval::ball;
use super::{RayShape, Touch};
use crate::geometry::assets::Assets;
use crate::geometry::bvh::Stack;
use kinetoscope_scene::Ray;
use kinetoscope_scene::vector::{V3, along, scale};

/// A ball.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sphere {
    radius: f64,
}

impl Sphere {
    pub(super) fn of(shape: &kinetoscope_scene::shape::Sphere, _assets: &mut Assets) -> Self {
        Self { radius: shape.radius.into() }
    }
}

impl RayShape for Sphere {
    #[inline(always)]
    fn touch(&self, ray: &Ray, limit: f64, _stack: &mut Stack) -> Option<Touch> {
        let t = ball(ray.origin, ray.direction, self.radius).first(limit)?;
        Some(Touch { t, normal: scale(along(ray.origin, t, ray.direction), 1.0 / self.radius) })
    }

    fn bounds(&self) -> Option<[V3; 2]> {
        Some([[-self.radius; 3], [self.radius; 3]])
    }
}

//! A stretched ball.

use super::interval::ball;
use super::{RayShape, Touch};
use crate::geometry::assets::Assets;
use crate::geometry::bvh::Stack;
use kinetoscope_scene::Ray;
use kinetoscope_scene::vector::{V3, along, unit};

/// A ball stretched along its axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ellipsoid {
    radii: V3,
}

impl Ellipsoid {
    pub(super) fn of(shape: &kinetoscope_scene::shape::Ellipsoid, _assets: &mut Assets) -> Self {
        Self { radii: shape.radii.map(f64::from) }
    }
}

impl RayShape for Ellipsoid {
    #[inline(always)]
    fn touch(&self, ray: &Ray, limit: f64, _stack: &mut Stack) -> Option<Touch> {
        let round = |v: V3| [0, 1, 2].map(|k| v[k] / self.radii[k]);
        let t = ball(round(ray.origin), round(ray.direction), 1.0).first(limit)?;
        // The gradient of x²/a² + y²/b² + z²/c².
        let normal = unit(round(round(along(ray.origin, t, ray.direction))))?;
        Some(Touch { t, normal })
    }

    fn bounds(&self) -> Option<[V3; 2]> {
        Some([self.radii.map(|r| -r), self.radii])
    }
}

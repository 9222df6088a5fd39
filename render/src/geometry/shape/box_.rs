//! A box.

use super::interval::slab;
use super::{RayShape, Touch};
use crate::geometry::assets::Assets;
use crate::geometry::bvh::Stack;
use kinetoscope_scene::Ray;
use kinetoscope_scene::vector::V3;

/// A box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Box {
    half: V3,
}

impl Box {
    pub(super) fn of(shape: &kinetoscope_scene::shape::Box, _assets: &mut Assets) -> Self {
        Self { half: shape.half.map(f64::from) }
    }
}

impl RayShape for Box {
    #[inline(always)]
    fn touch(&self, ray: &Ray, limit: f64, _stack: &mut Stack) -> Option<Touch> {
        let slabs = [0, 1, 2].map(|k| slab(ray.origin[k], ray.direction[k], self.half[k]));
        let t = slabs[0].and(slabs[1]).and(slabs[2]).first(limit)?;
        let axis = slabs.iter().position(|s| t == s.enter || t == s.leave).unwrap_or(2);
        Some(Touch { t, normal: [0, 1, 2].map(|k| if k == axis { 1.0 } else { 0.0 }) })
    }

    /// Two of each axis, the negative one first.
    fn face(&self, touch: &Touch, ray: &Ray) -> usize {
        let axis = touch.normal.iter().position(|&n| n != 0.0).unwrap_or(2);
        2 * axis + usize::from(ray.at(touch.t)[axis] >= 0.0)
    }

    fn bounds(&self) -> Option<[V3; 2]> {
        Some([self.half.map(|h| -h), self.half])
    }
}

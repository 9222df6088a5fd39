//! The trait of shapes that rays hit.

use crate::geometry::bvh::TraversalStack;
use crate::geometry::packet::{Packet, WIDTH};
use crate::simd::Simd;
use kinetoscope_scene::Ray;
use kinetoscope_scene::shape::{ClosedForm, Intersection};

/// Intersections of the rays of a packet, one per lane.
pub(crate) type Intersections = [Option<Intersection>; WIDTH];

/// Ray intersection of a shape.
pub(crate) trait RayShape {
    /// The nearest surface at a distance from 0 to `limit` \[m\], both included; `None` if the ray hits nothing there.
    fn intersect(&self, ray: &Ray, limit: f64, stack: &mut TraversalStack) -> Option<Intersection>;

    /// Packet version of `intersect`: the same bits for every ray, up to its limit. All lanes of `touches` are `None`
    /// before; lanes whose ray hits the shape are written.
    #[inline(always)]
    fn intersect_packet<S: Simd>(&self, _s: S, packet: &Packet, stack: &mut TraversalStack, touches: &mut Intersections)
    where
        Self: Sized,
    {
        intersect_each(self, packet, stack, touches);
    }
}

impl<T: ClosedForm> RayShape for T {
    #[inline(always)]
    fn intersect(&self, ray: &Ray, limit: f64, _stack: &mut TraversalStack) -> Option<Intersection> {
        self.intersect(ray, limit)
    }
}

/// Intersects one ray after the other.
#[inline(always)]
pub(super) fn intersect_each(
    shape: &impl RayShape,
    packet: &Packet,
    stack: &mut TraversalStack,
    touches: &mut Intersections,
) {
    for (k, touch) in touches.iter_mut().enumerate().filter(|(k, _)| packet.is_active(*k)) {
        *touch = shape.intersect(&packet.ray(k), packet.limit(k), stack);
    }
}

/// Work compiled separately for each kind of shape.
pub(crate) trait ShapeVisitor {
    fn run<T: RayShape>(self, shape: &T);
}

//! The trait of shapes that rays hit.

use crate::geometry::bvh::Stack;
use crate::geometry::packet::{Packet, WIDTH};
use crate::simd::Simd;
use kinetoscope_scene::Ray;
use kinetoscope_scene::shape::{ClosedForm, Intersection};

/// Intersections of the rays of a packet, lane by lane.
pub(crate) type Touches = [Option<Intersection>; WIDTH];

/// The operations of a shape.
pub(crate) trait RayShape {
    /// The nearest surface at a distance from 0 to `limit`, both included.
    fn touch(&self, ray: &Ray, limit: f64, stack: &mut Stack) -> Option<Intersection>;

    /// The same forevery ray of a packet, up to its limit, to the bit. Of what `touches` were before only those of lanes
    /// without a ray may stay.
    #[inline(always)]
    fn touch_packet<S: Simd>(&self, _s: S, packet: &Packet, stack: &mut Stack, touches: &mut Touches)
    where
        Self: Sized,
    {
        touch_each(self, packet, stack, touches);
    }
}

impl<T: ClosedForm> RayShape for T {
    #[inline(always)]
    fn touch(&self, ray: &Ray, limit: f64, _stack: &mut Stack) -> Option<Intersection> {
        self.intersect(ray, limit)
    }
}

/// One ray after the other.
#[inline(always)]
pub(super) fn touch_each(shape: &impl RayShape, packet: &Packet, stack: &mut Stack, touches: &mut Touches) {
    for (k, touch) in touches.iter_mut().enumerate().filter(|(k, _)| packet.has(*k)) {
        *touch = shape.touch(&packet.ray(k), packet.limit(k), stack);
    }
}

/// Work that does not depend on the kind of shape, compiled for each.
pub(crate) trait ForShape {
    fn run<T: RayShape>(self, shape: &T);
}

//! What rays hit: one shape per file, all of them in one list.
//!
//! The shapes are those of [`kinetoscope_scene::Shape`], in their own frames. Planes are seen from the front, solids from both sides: a
//! ray that begins inside hits the way out. The rasterizer and MuJoCo's `mj_ray` see the same.

mod interval;

use super::bvh::Stack;
use super::packet::{Packet, WIDTH};
use super::vector::V3;
use crate::geometry::assets::Assets;
use crate::geometry::ray::Ray;
use crate::simd::Simd;
use kinetoscope_scene::Shape;

/// Where a ray touches a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Touch {
    /// Distance along the ray \[m\].
    pub(crate) t: f64,
    /// Unit normal of the surface, of either sign.
    pub(crate) normal: V3,
}

/// What the rays of a packet touch, lane by lane.
pub(crate) type Touches = [Option<Touch>; WIDTH];

/// What a shape must be able to do.
pub(crate) trait RayShape {
    /// The nearest surface at a distance from 0 to `limit`, both included.
    fn touch(&self, ray: &Ray, limit: f64, stack: &mut Stack) -> Option<Touch>;

    /// The same for every ray of a packet, up to its limit, to the bit. Of what `touches` were before only those of lanes
    /// without a ray may stay.
    #[inline(always)]
    fn touch_packet<S: Simd>(&self, _s: S, packet: &Packet, stack: &mut Stack, touches: &mut Touches)
    where
        Self: Sized,
    {
        touch_each(self, packet, stack, touches);
    }

    /// Which smooth part of the surface a ray touches, of shapes with a closed form: numbered as the rasterizer's.
    fn face(&self, _touch: &Touch, _ray: &Ray) -> usize {
        0
    }

    /// Smallest and largest coordinates; `None` for a shape without an end.
    fn bounds(&self) -> Option<[V3; 2]>;
}

/// One ray after the other.
#[inline(always)]
fn touch_each(shape: &impl RayShape, packet: &Packet, stack: &mut Stack, touches: &mut Touches) {
    for (k, touch) in touches.iter_mut().enumerate().filter(|(k, _)| packet.has(*k)) {
        *touch = shape.touch(&packet.ray(k), packet.limit(k), stack);
    }
}

/// Work that does not depend on the kind of shape, compiled for each.
pub(crate) trait ForShape {
    fn run<T: RayShape>(self, shape: &T);
}

/// Declares the shapes: a module with a type of its own each, made from the scene's shape of the same name.
macro_rules! ray_shapes {
    ($($module:ident :: $Name:ident,)*) => {
        $(pub(crate) mod $module;)*

        /// A shape, ready for rays.
        #[derive(Clone, Debug)]
        pub(crate) enum Solid {
            $($Name($module::$Name),)*
        }

        impl Solid {
            /// The shape of a scene; what is built once for an asset comes from `assets`.
            pub(crate) fn of(shape: &Shape, assets: &mut Assets) -> Self {
                match shape { $(Shape::$Name(shape) => Self::$Name($module::$Name::of(shape, assets)),)* }
            }

            /// Smallest and largest coordinates; `None` for a shape without an end.
            pub(crate) fn bounds(&self) -> Option<[V3; 2]> {
                match self { $(Self::$Name(shape) => shape.bounds(),)* }
            }

            /// Does the work with the shape itself.
            #[inline(always)]
            pub(crate) fn with<W: ForShape>(&self, work: W) {
                match self { $(Self::$Name(shape) => work.run(shape),)* }
            }

            /// Which smooth part of the surface a ray touches.
            pub(crate) fn face(&self, touch: &Touch, ray: &Ray) -> usize {
                match self { $(Self::$Name(shape) => shape.face(touch, ray),)* }
            }

            /// The nearest surface at a distance from 0 to `limit`, both included.
            pub(crate) fn touch(&self, ray: &Ray, limit: f64, stack: &mut Stack) -> Option<Touch> {
                match self { $(Self::$Name(shape) => shape.touch(ray, limit, stack),)* }
            }
        }
    };
}

ray_shapes! {
    plane::Plane,
    sphere::Sphere,
    capsule::Capsule,
    ellipsoid::Ellipsoid,
    cylinder::Cylinder,
    box_::Box,
    mesh::Mesh,
    height_field::HeightField,
}

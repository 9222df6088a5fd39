//! What rays hit: one shape per file, all of them in one list.
//!
//! The shapes are those of [`kinetoscope_scene::Shape`], in their own frames. Planes are seen from the front, solids from both sides: a
//! ray that begins inside hits the way out. The rasterizer and MuJoCo's `mj_ray` see the same.

mod interval;
mod ray_shape;

use super::bvh::Stack;
use crate::geometry::assets::Assets;
use kinetoscope_scene::Ray;
use kinetoscope_scene::Shape;
use kinetoscope_scene::vector::V3;
use ray_shape::touch_each;
pub(crate) use ray_shape::{ForShape, RayShape, Touch, Touches};

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

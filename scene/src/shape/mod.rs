//! What can be drawn: one shape per file, all of them in one list.
//!
//! Sizes have MuJoCo's meaning: half lengths, the axis of round things along z, the centre at the origin.

mod crease;
mod deformation;
mod grid;
mod lod;
pub mod render_mesh;
mod shape_impl;

use crate::mesh::TriMesh;
pub use deformation::smooth_normals;
pub(crate) use grid::revolve;
pub use lod::Level;
pub use render_mesh::{Cluster, RenderMesh};
use shape_impl::{ShapeImpl, largest, norm};

/// Declares the shapes: a module with a type of its own each.
macro_rules! shapes {
    ($($(#[$doc:meta])* $module:ident :: $Name:ident,)*) => {
        $(mod $module; pub use $module::$Name;)*

        /// The surface of something, in its own frame.
        #[derive(Clone, Debug)]
        pub enum Shape {
            $($(#[$doc])* $Name($Name),)*
        }

        impl Shape {
            /// The module of every kind of shape.
            pub const MODULES: &'static [&'static str] = &[$(stringify!($module)),*];

            /// The name of the kind.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$Name(_) => stringify!($module).trim_end_matches('_'),)* }
            }

            /// Triangles of the surface, counter-clockwise seen from outside, with about `segments` edges around a circle.
            /// Infinite planes become 200 m wide.
            pub fn tessellate(&self, segments: usize) -> TriMesh {
                match self { $(Self::$Name(shape) => ShapeImpl::tessellate(shape, segments.clamp(3, 1024)),)* }
            }

            /// Smallest and largest coordinates \[m\]; infinite where the shape is.
            pub fn aabb(&self) -> [[f32; 3]; 2] {
                match self { $(Self::$Name(shape) => ShapeImpl::aabb(shape),)* }
            }

            /// The largest coordinate along a direction, times the length of the direction \[m\]; infinite where the shape is.
            pub fn support(&self, direction: [f64; 3]) -> f64 {
                match self { $(Self::$Name(shape) => ShapeImpl::support(shape, direction),)* }
            }

            /// The first size that is not a positive finite number.
            pub fn bad_size(&self) -> Option<f32> {
                let sizes = match self { $(Self::$Name(shape) => ShapeImpl::sizes(shape),)* };
                sizes.into_iter().find(|s| !(s.is_finite() && *s > 0.0))
            }
        }

        $(impl From<$Name> for Shape {
            fn from(shape: $Name) -> Self {
                Self::$Name(shape)
            }
        })*
    };
}

shapes! {
    /// A plane, seen from +z only.
    plane::Plane,
    /// A ball.
    sphere::Sphere,
    /// A cylinder with round ends.
    capsule::Capsule,
    /// A ball stretched along its axes.
    ellipsoid::Ellipsoid,
    /// A cylinder with flat ends.
    cylinder::Cylinder,
    /// A box.
    box_::Box,
    /// Triangles.
    mesh::Mesh,
    /// Terrain over a grid.
    height_field::HeightField,
}

#[cfg(test)]
mod tests;

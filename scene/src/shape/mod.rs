//! Shapes: the geometry of each kind in its own file, and all kinds in one enum.
//!
//! Sizes have MuJoCo's meaning: half lengths, round shapes along z, the center at the origin. A shape has a
//! [closed form](ClosedForm) or is [made of triangles](Triangulated).

mod area_sampling;
mod closed_form;
mod crease;
mod deformation;
mod interval;
mod lod;
pub(crate) mod render_mesh;
mod revolution;
mod triangulated;

use crate::Ray;
use crate::mesh::TriMesh;
use crate::vector::{V3, to_f64};
pub use area_sampling::{AreaSampling, SurfacePoint};
pub use closed_form::{ClosedForm, ClosedFormVisitor, HullPart, Intersection};
pub use deformation::smooth_normals;
pub use lod::LodLevel;
pub use render_mesh::{Cluster, RenderMesh};
pub(crate) use revolution::revolve;
use std::sync::Arc;
pub use triangulated::{TriangleSampling, Triangulated};

/// Declares the shapes: for each kind, a module with its type.
macro_rules! shapes {
    (
        closed_forms { $($(#[$doc:meta])* $module:ident :: $Name:ident,)* }
        triangulated { $($(#[$triangles_doc:meta])* $triangles_module:ident :: $TrianglesName:ident,)* }
    ) => {
        $(mod $module; pub use $module::$Name;)*
        $(mod $triangles_module; pub use $triangles_module::$TrianglesName;)*

        /// A surface, in its own frame.
        #[derive(Clone, Debug)]
        pub enum Shape {
            $($(#[$doc])* $Name($Name),)*
            $($(#[$triangles_doc])* $TrianglesName($TrianglesName),)*
        }

        impl Shape {
            /// Module names of all kinds of shapes, such as `box_`.
            pub const MODULES: &'static [&'static str] = &[$(stringify!($module),)* $(stringify!($triangles_module)),*];

            /// Name of the kind, such as `box`.
            pub fn name(&self) -> &'static str {
                match self {
                    $(Self::$Name(_) => stringify!($module).trim_end_matches('_'),)*
                    $(Self::$TrianglesName(_) => stringify!($triangles_module).trim_end_matches('_'),)*
                }
            }

            fn geometry(&self) -> ShapeKind<'_> {
                match self {
                    $(Self::$Name(shape) => ShapeKind::ClosedForm(shape),)*
                    $(Self::$TrianglesName(shape) => ShapeKind::Triangulated(shape),)*
                }
            }

            /// Runs an operation on a shape with a closed form, compiled for each kind; `None` for triangles.
            #[inline(always)]
            pub fn with_closed_form<W: ClosedFormVisitor>(&self, work: W) -> Option<W::Output> {
                match self {
                    $(Self::$Name(shape) => Some(work.visit(shape)),)*
                    $(Self::$TrianglesName(_) => None,)*
                }
            }
        }

        $(impl From<$Name> for Shape {
            fn from(shape: $Name) -> Self {
                Self::$Name(shape)
            }
        })*
        $(impl From<$TrianglesName> for Shape {
            fn from(shape: $TrianglesName) -> Self {
                Self::$TrianglesName(shape)
            }
        })*
    };
}

shapes! {
    closed_forms {
        /// A plane, visible from +z only.
        plane::Plane,
        /// A sphere.
        sphere::Sphere,
        /// A capsule.
        capsule::Capsule,
        /// An ellipsoid.
        ellipsoid::Ellipsoid,
        /// A cylinder with flat ends.
        cylinder::Cylinder,
        /// A box.
        box_::Box,
    }
    triangulated {
        /// A triangle mesh.
        mesh::Mesh,
        /// A height field.
        height_field::HeightField,
    }
}

/// The two kinds of geometry.
enum ShapeKind<'a> {
    ClosedForm(&'a dyn ClosedForm),
    Triangulated(&'a dyn Triangulated),
}

impl Shape {
    /// Triangulates the surface, counter-clockwise seen from outside, with about `segments` (clamped to 3..=1024) edges
    /// around a circle. Meshes and height fields return their own triangles.
    ///
    /// A plane becomes 200 m long along an infinite axis.
    pub fn tessellate(&self, segments: usize) -> TriMesh {
        match self.geometry() {
            ShapeKind::ClosedForm(shape) => shape.tessellate(segments.clamp(3, 1024)),
            ShapeKind::Triangulated(shape) => shape.mesh().to_tri_mesh(),
        }
    }

    /// Prepared triangles of a shape that is made of triangles; `None` for other shapes.
    #[inline]
    pub fn mesh(&self) -> Option<&Arc<RenderMesh>> {
        match self.geometry() {
            ShapeKind::ClosedForm(_) => None,
            ShapeKind::Triangulated(shape) => Some(shape.mesh()),
        }
    }

    /// Smallest and largest coordinates in the frame of the shape \[m\]; infinite for an infinite shape.
    pub fn aabb(&self) -> [[f32; 3]; 2] {
        match self.geometry() {
            // A sum of two single-precision numbers is the same, whether it is rounded once or through double
            // precision.
            ShapeKind::ClosedForm(shape) => shape.bounds().map(|corner| corner.map(|x| x as f32)),
            ShapeKind::Triangulated(shape) => shape.mesh().bounds(),
        }
    }

    /// Smallest and largest coordinates in the frame of the shape \[m\]; `None` for an infinite shape.
    pub fn bounds(&self) -> Option<[V3; 2]> {
        let bounds = match self.geometry() {
            ShapeKind::ClosedForm(shape) => shape.bounds(),
            ShapeKind::Triangulated(shape) => shape.mesh().bounds().map(to_f64),
        };
        bounds.as_flattened().iter().all(|x| x.is_finite()).then_some(bounds)
    }

    /// Support function: the largest coordinate along a direction in the frame of the shape, times the length of the
    /// direction \[m\].
    ///
    /// Infinite along an infinite axis of a plane.
    pub fn support(&self, direction: V3) -> f64 {
        match self.geometry() {
            ShapeKind::ClosedForm(shape) => shape.support(direction),
            ShapeKind::Triangulated(shape) => extent(shape.mesh().positions(), direction)[1],
        }
    }

    /// Smallest and largest coordinates along a direction in the frame of the shape, times the length of the direction
    /// \[m\]; infinite along an infinite axis of a plane.
    pub fn extent(&self, direction: V3) -> [f64; 2] {
        match self.geometry() {
            ShapeKind::ClosedForm(shape) => [-shape.support(direction.map(|x| -x)), shape.support(direction)],
            ShapeKind::Triangulated(shape) => extent(shape.mesh().positions(), direction),
        }
    }

    /// Calls `add` for points and ellipsoids, in the frame of the shape. Their common convex hull is the convex hull of
    /// the shape; it is infinite for an infinite plane.
    pub fn hull(&self, add: &mut dyn FnMut(HullPart)) {
        match self.geometry() {
            ShapeKind::ClosedForm(shape) => shape.hull(add),
            ShapeKind::Triangulated(shape) => {
                shape.mesh().positions().iter().for_each(|p| add(HullPart::Point(to_f64(*p))));
            }
        }
    }

    /// Returns the nearest intersection of a ray and a shape with a closed form, at a distance from 0 to `limit` \[m\],
    /// both included; always `None` for meshes and height fields.
    #[inline]
    pub fn intersect(&self, ray: &Ray, limit: f64) -> Option<Intersection> {
        self.with_closed_form(Intersect(ray, limit)).flatten()
    }

    /// Index of the smooth face at an intersection with a shape with a closed form, such as 0 to 5 for a box; 0 for
    /// meshes and height fields.
    pub fn face(&self, intersection: &Intersection, ray: &Ray) -> usize {
        match self.geometry() {
            ShapeKind::ClosedForm(shape) => shape.face(intersection, ray),
            ShapeKind::Triangulated(_) => 0,
        }
    }

    /// True for a surface that is visible only from the +z side of its own frame, such as a plane.
    pub fn is_one_sided(&self) -> bool {
        matches!(self.geometry(), ShapeKind::ClosedForm(shape) if shape.is_one_sided())
    }

    /// Area sampling of a shape with a closed form; `None` if paths find its light by chance only, and for triangles.
    pub fn area_sampling(&self) -> Option<&dyn AreaSampling> {
        match self.geometry() {
            ShapeKind::ClosedForm(shape) => shape.area_sampling(),
            ShapeKind::Triangulated(_) => None,
        }
    }

    /// Area sampling of a mesh; `None` for height fields, whose light paths find by chance only, and for shapes with a
    /// closed form.
    pub fn triangle_sampling(&self) -> Option<TriangleSampling> {
        match self.geometry() {
            ShapeKind::ClosedForm(_) => None,
            ShapeKind::Triangulated(shape) => shape.area_sampling(),
        }
    }

    /// First size \[m\] that is not positive and finite; `None` if all sizes are valid.
    pub fn invalid_size(&self) -> Option<f32> {
        let sizes = match self.geometry() {
            ShapeKind::ClosedForm(shape) => shape.sizes(),
            ShapeKind::Triangulated(shape) => shape.sizes(),
        };
        sizes.into_iter().find(|s| !(s.is_finite() && *s > 0.0))
    }
}

/// Operation that returns the nearest intersection of a ray up to a distance.
struct Intersect<'a>(&'a Ray, f64);

impl ClosedFormVisitor for Intersect<'_> {
    type Output = Option<Intersection>;

    #[inline(always)]
    fn visit<T: ClosedForm>(self, shape: &T) -> Self::Output {
        shape.intersect(self.0, self.1)
    }
}

/// Smallest and largest coordinates of points along a direction, times its length; without points, +inf and -inf.
fn extent(points: &[[f32; 3]], [x, y, z]: V3) -> [f64; 2] {
    let along = points.iter().map(|p| x * f64::from(p[0]) + y * f64::from(p[1]) + z * f64::from(p[2]));
    along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

#[cfg(test)]
mod tests;

//! [`ClosedForm`]: the geometry of one kind of shape.

use super::area_sampling::AreaSampling;
use crate::Ray;
use crate::mesh::TriMesh;
use crate::vector::V3;

/// An intersection of a ray and a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intersection {
    /// Distance along the ray \[m\].
    pub t: f64,
    /// Unit normal of the surface, in either direction.
    pub normal: V3,
}

/// A part of a shape, in the frame of the shape. The convex hull of all parts is the convex hull of the shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HullPart {
    /// A point \[m\].
    Point(V3),
    /// An ellipsoid with axes along x, y and z; a disc if one of its radii is 0.
    Ellipsoid {
        /// Center \[m\].
        center: V3,
        /// Half lengths \[m\].
        radii: V3,
    },
}

/// Geometry of a shape with a closed form, in its own frame: a convex solid that contains the origin, or a plane.
///
/// Shapes that are not convex are [made of triangles](super::Triangulated).
pub trait ClosedForm {
    /// Sizes \[m\] that must be positive and finite.
    fn sizes(&self) -> Vec<f32>;

    /// Smallest and largest coordinates in the frame of the shape \[m\]; infinite for an infinite shape.
    fn bounds(&self) -> [V3; 2];

    /// Triangles of the surface, counter-clockwise seen from outside, with about `segments` edges around a circle.
    fn tessellate(&self, segments: usize) -> TriMesh;

    /// Support function: the largest coordinate along a direction, times the length of the direction \[m\].
    fn support(&self, direction: V3) -> f64;

    /// Calls `add` for each part. The shape is the convex hull of its parts.
    fn hull(&self, add: &mut dyn FnMut(HullPart));

    /// Returns the nearest intersection at a distance from 0 to `limit` \[m\], both included; `None` without one.
    ///
    /// A ray that begins inside of a solid intersects it at its exit. A plane is intersected from +z only.
    fn intersect(&self, ray: &Ray, limit: f64) -> Option<Intersection>;

    /// Index of the smooth face at an intersection, from 0; less than
    /// [`IDS_OF_PRIMITIVE`](crate::RenderScene::IDS_OF_PRIMITIVE).
    fn face(&self, _intersection: &Intersection, _ray: &Ray) -> usize {
        0
    }

    /// Area sampling of the surface, for shapes that emit light.
    ///
    /// With `None`, only paths that hit the shape by chance find its light, which is unbiased but noisy.
    fn area_sampling(&self) -> Option<&dyn AreaSampling>;

    /// True for a surface that is visible only from the +z side of its own frame, such as a plane.
    fn is_one_sided(&self) -> bool {
        false
    }
}

/// An operation on a shape with a closed form, compiled for each kind of shape.
pub trait ClosedFormVisitor {
    /// Result of the operation.
    type Output;

    /// Runs the operation on a shape.
    fn visit<T: ClosedForm>(self, shape: &T) -> Self::Output;
}

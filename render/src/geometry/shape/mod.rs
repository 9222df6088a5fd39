//! Shapes that rays hit, each in its own frame.
//!
//! Shapes with a closed form come with their intersections ([`ClosedForm`]); triangles get a BVH, height fields a
//! pyramid. Planes are hit from the front, solids from both sides: a ray that begins inside hits the exit. The
//! rasterizer and MuJoCo's `mj_ray` agree with that.

pub(crate) mod height_field;
pub(crate) mod mesh;
mod ray_shape;

use crate::geometry::assets::AssetCache;
#[cfg(test)]
use crate::geometry::bvh::TraversalStack;
use height_field::HeightField;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::shape::{ClosedForm, ClosedFormVisitor};
use kinetoscope_scene::vector::V3;
#[cfg(test)]
use kinetoscope_scene::{Ray, shape::Intersection};
use mesh::Mesh;
use ray_shape::intersect_each;
pub(crate) use ray_shape::{Intersections, RayShape, ShapeVisitor};

/// A shape prepared for rays.
#[derive(Clone, Debug)]
pub(crate) enum RayGeometry {
    ClosedForm(Shape),
    Mesh(Mesh),
    HeightField(HeightField),
}

impl RayGeometry {
    /// Prepares a shape of a scene; BVHs and pyramids are shared through `assets`.
    pub(crate) fn from_shape(shape: &Shape, assets: &mut AssetCache) -> Self {
        match (shape, shape.mesh()) {
            (Shape::HeightField(field), _) => Self::HeightField(HeightField::from_shape(field, assets)),
            (_, Some(mesh)) => Self::Mesh(Mesh::from_mesh(mesh, assets)),
            (_, None) => Self::ClosedForm(shape.clone()),
        }
    }

    /// Bounding box in the frame of the shape: smallest and largest coordinates \[m\]; `None` for an unbounded shape.
    pub(crate) fn bounds(&self) -> Option<[V3; 2]> {
        match self {
            Self::ClosedForm(shape) => shape.bounds(),
            Self::Mesh(shape) => Some(shape.bounds()),
            Self::HeightField(shape) => Some(shape.bounds()),
        }
    }

    /// The nearest surface at a distance from 0 to `limit` \[m\], both included, for a single ray; `None` if the ray
    /// hits nothing there.
    #[cfg(test)]
    pub(crate) fn intersect(&self, ray: &Ray, limit: f64, stack: &mut TraversalStack) -> Option<Intersection> {
        match self {
            Self::ClosedForm(shape) => shape.intersect(ray, limit),
            Self::Mesh(shape) => shape.intersect(ray, limit, stack),
            Self::HeightField(shape) => shape.intersect(ray, limit, stack),
        }
    }

    /// Runs `work` on the concrete shape.
    #[inline(always)]
    pub(crate) fn with<W: ShapeVisitor>(&self, work: W) {
        match self {
            Self::ClosedForm(shape) => {
                shape.with_closed_form(ClosedFormAdapter(work));
            }
            Self::Mesh(shape) => work.run(shape),
            Self::HeightField(shape) => work.run(shape),
        }
    }
}

/// Adapter for work on a shape that has a closed form.
struct ClosedFormAdapter<W>(W);

impl<W: ShapeVisitor> ClosedFormVisitor for ClosedFormAdapter<W> {
    type Output = ();

    #[inline(always)]
    fn visit<T: ClosedForm>(self, shape: &T) {
        self.0.run(shape);
    }
}

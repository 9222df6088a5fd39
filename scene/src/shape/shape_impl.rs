//! The trait of shapes, and parts that their files share.

use crate::mesh::TriMesh;

/// The operations of a shape.
pub(super) trait ShapeImpl {
    /// Triangles of the surface, counter-clockwise seen from outside, with about `segments` edges around a circle.
    fn tessellate(&self, segments: usize) -> TriMesh;

    /// Smallest and largest coordinates \[m\]; infinite where the shape is.
    fn aabb(&self) -> [[f32; 3]; 2];

    /// The largest coordinate along a direction, times the length of the direction \[m\].
    fn support(&self, direction: [f64; 3]) -> f64;

    /// The sizes that must be positive and finite.
    fn sizes(&self) -> Vec<f32>;
}

/// Length of a vector.
pub(super) fn norm(a: [f64; 3]) -> f64 {
    a.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The largest coordinate of points along a direction, times its length; negative infinity without points.
pub(super) fn largest(points: &[[f32; 3]], direction: [f64; 3]) -> f64 {
    let [x, y, z] = direction;
    let along = |p: &[f32; 3]| x * f64::from(p[0]) + y * f64::from(p[1]) + z * f64::from(p[2]);
    points.iter().map(along).fold(f64::NEG_INFINITY, f64::max)
}

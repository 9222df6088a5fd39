//! A ray against a triangle, without gaps between neighbours.

use super::Ray;
use super::vector::{V3, cross, sub, to_f64, unit};

/// Corners of a triangle \[m\].
pub(crate) type Triangle = [[f32; 3]; 3];

/// A ray, sheared so that it runs along one axis. Source: Woop, Benthin, Wald: Watertight ray/triangle intersection,
/// JCGT 2(1), 2013; in double precision. An edge has the same magnitude, to the bit, in both triangles that share it, so
/// that no ray passes between them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shear {
    origin: V3,
    /// The axis along which the ray is longest comes last.
    axes: [usize; 3],
    by: V3,
}

impl Shear {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> Self {
        let d = ray.direction;
        let [x, y, z] = d.map(f64::abs);
        let last = if x > y && x > z { 0 } else { 1 + usize::from(z >= y) };
        let axes = [(last + 1) % 3, (last + 2) % 3, last];
        let inverse = 1.0 / d[last];
        Self { origin: ray.origin, axes, by: [d[axes[0]] * inverse, d[axes[1]] * inverse, inverse] }
    }

    /// Distance of the plane of a triangle, where the ray is inside of the triangle; from either side. Of any sign.
    #[inline(always)]
    pub(crate) fn distance(&self, triangle: &Triangle) -> Option<f64> {
        let [i, j, k] = self.axes;
        let [a, b, c] = triangle.map(|p| {
            let v =
                [f64::from(p[i]) - self.origin[i], f64::from(p[j]) - self.origin[j], f64::from(p[k]) - self.origin[k]];
            [v[0] - self.by[0] * v[2], v[1] - self.by[1] * v[2], v[2]]
        });
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        let outside = (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0);
        let whole = u + v + w;
        // Zero where the ray runs in the plane of the triangle: its neighbours are hit.
        if outside || whole == 0.0 {
            return None;
        }
        Some((u * a[2] + v * b[2] + w * c[2]) * self.by[2] / whole)
    }
}

/// Unit normal, counter-clockwise corners seen from its tip; `None` for a triangle without an area.
pub(crate) fn normal(triangle: &Triangle) -> Option<V3> {
    let [a, b, c] = triangle.map(to_f64);
    unit(cross(sub(b, a), sub(c, a)))
}

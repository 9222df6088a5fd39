//! Watertight ray-triangle intersection.

use super::packet::{ALL, Packet, WIDTH};
use crate::simd::{D, D3, N, Simd, axes, dot_3};
use kinetoscope_scene::Ray;
use kinetoscope_scene::vector::{V3, cross, dot, normalize, sub, to_f64};

/// Corners of a triangle \[m\].
pub(crate) type Triangle = [[f32; 3]; 3];

/// A ray, sheared so that it runs along one axis. An edge has the same magnitude, to the bit, in both triangles that
/// share it, so that no ray passes between them. Source: Woop, Benthin, Wald: Watertight ray/triangle intersection,
/// JCGT 2(1), 2013; in double precision.
///
/// The side of an edge is the sign of a difference of two products. Rounding keeps order, so that sign is never wrong;
/// but it may be 0. Seen edge-on, a ray in the plane of a triangle would count as inside however far away it passes. So
/// if an edge has a sign of 0, a ray is inside only if it is between the corners along both axes. That holds for every
/// ray inside or on an edge, so it leaves no gap either.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearedRay {
    origin: V3,
    /// Permutation of the axes; the dominant axis of the ray comes last.
    axes: [usize; 3],
    shear: V3,
}

impl ShearedRay {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> Self {
        let d = ray.direction;
        let [x, y, z] = d.map(f64::abs);
        let last = if x > y && x > z { 0 } else { 1 + usize::from(z >= y) };
        let axes = [(last + 1) % 3, (last + 2) % 3, last];
        let inverse = 1.0 / d[last];
        Self { origin: ray.origin, axes, shear: [d[axes[0]] * inverse, d[axes[1]] * inverse, inverse] }
    }

    /// Distance of the triangle's plane, of any sign, from either side; `None` if the ray's line is outside of the
    /// triangle or in its plane.
    #[inline(always)]
    pub(crate) fn distance(&self, triangle: &Triangle) -> Option<f64> {
        let [i, j, k] = self.axes;
        let [a, b, c] = triangle.map(|p| {
            let v =
                [f64::from(p[i]) - self.origin[i], f64::from(p[j]) - self.origin[j], f64::from(p[k]) - self.origin[k]];
            [v[0] - self.shear[0] * v[2], v[1] - self.shear[1] * v[2], v[2]]
        });
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        let outside = (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0);
        let whole = u + v + w;
        // Zero if the ray runs in the plane of the triangle: its neighbors are hit.
        if outside || whole == 0.0 {
            return None;
        }
        let beside = |axis: usize| {
            let [a, b, c] = [a, b, c].map(|p| p[axis]);
            a < 0.0 && b < 0.0 && c < 0.0 || a > 0.0 && b > 0.0 && c > 0.0
        };
        if (u == 0.0 || v == 0.0 || w == 0.0) && (beside(0) || beside(1)) {
            return None;
        }
        Some((u * a[2] + v * b[2] + w * c[2]) * self.shear[2] / whole)
    }
}

/// Packet version of [`ShearedRay`] for rays with the same dominant axis: the same operations in the same order, so the
/// same bits.
#[derive(Clone, Copy)]
pub(crate) struct ShearedPacket<S: Simd> {
    s: S,
    /// In the order of `axes`.
    origin: D3<S>,
    axes: [usize; 3],
    shear: D3<S>,
}

impl<S: Simd> ShearedPacket<S> {
    /// Shears a packet; `None` if the dominant axes of its rays differ.
    #[inline(always)]
    pub(crate) fn new(s: S, packet: &Packet) -> Option<Self> {
        let d = packet.directions(s);
        let (x, y, z) = (d[0].abs(), d[1].abs(), d[2].abs());
        let first = (y.lt(x) & z.lt(x)).to_bitmask();
        let third = y.le(z).to_bitmask() & !first;
        let last = match (first, third) {
            (ALL, _) => 0,
            (0, ALL) => 2,
            (0, 0) => 1,
            _ => return None,
        };
        let [i, j] = [(last + 1) % 3, (last + 2) % 3];
        let origin = packet.origins(s);
        let inverse = D::splat(s, 1.0) / d[last];
        let shear = [d[i] * inverse, d[j] * inverse, inverse];
        Some(Self { s, origin: [origin[i], origin[j], origin[last]], axes: [i, j, last], shear })
    }

    /// Permutation of the axes; the dominant axis of the rays comes last.
    #[inline(always)]
    pub(crate) fn axes(&self) -> [usize; 3] {
        self.axes
    }

    /// Ray origins, in the order of the axes.
    #[inline(always)]
    pub(crate) fn origin(&self) -> D3<S> {
        self.origin
    }

    /// Slopes of the rays along the first and the second axis, per meter along the third.
    #[inline(always)]
    pub(crate) fn slopes(&self) -> [D<S>; 2] {
        [self.shear[0], self.shear[1]]
    }

    /// Slopes of the rays along the first and the second axis per meter along the third, and distance along the ray per
    /// meter along the third.
    #[inline(always)]
    pub(crate) fn shear(&self) -> D3<S> {
        self.shear
    }

    /// Distances of the triangle's plane, and the rays that are inside of the triangle; `None` if no ray is.
    #[inline(always)]
    pub(crate) fn distances(&self, triangle: &Triangle) -> Option<(D<S>, N<S>)> {
        let s = self.s;
        distances(
            s,
            &self.origin,
            &self.shear,
            #[inline(always)]
            |corner, axis| D::splat(s, f64::from(triangle[corner][self.axes[axis]])),
        )
    }
}

/// Distances of the planes of triangles along rays, a pair of them in each lane, and the lanes that are inside; `None`
/// if no lane is. All coordinates are in the order of a [`ShearedRay`]'s axes: ray origins, shears, and corners (corner,
/// axis).
#[inline(always)]
pub(crate) fn distances<S: Simd>(
    s: S,
    origin: &D3<S>,
    by: &D3<S>,
    corner: impl Fn(usize, usize) -> D<S>,
) -> Option<(D<S>, N<S>)> {
    let [a, b, c] = axes(
        #[inline(always)]
        |k| {
            let [x, y, z] = [corner(k, 0) - origin[0], corner(k, 1) - origin[1], corner(k, 2) - origin[2]];
            [x - by[0] * z, y - by[1] * z, z]
        },
    );
    let u = c[0] * b[1] - c[1] * b[0];
    let v = a[0] * c[1] - a[1] * c[0];
    let w = b[0] * a[1] - b[1] * a[0];
    let zero = D::splat(s, 0.0);
    // If an edge value is NaN, so is the distance, and the side does not matter.
    let (least, most) = (u.min(v).min(w), u.max(v).max(w));
    let whole = u + v + w;
    let mut inside = !((least.lt(zero) & zero.lt(most)) | whole.eq(zero));
    let on_edge = inside & (u.eq(zero) | v.eq(zero) | w.eq(zero));
    if inside.to_bitmask() == 0 {
        return None;
    }
    if on_edge.to_bitmask() != 0 {
        for axis in 0..2 {
            let [a, b, c] = [a[axis], b[axis], c[axis]];
            let below = a.lt(zero) & b.lt(zero) & c.lt(zero);
            let above = zero.lt(a) & zero.lt(b) & zero.lt(c);
            inside = inside & !(on_edge & (below | above));
        }
    }
    Some(((u * a[2] + v * b[2] + w * c[2]) * by[2] / whole, inside))
}

/// Packet version of [`normal`]: the same bits for a triangle in each lane, and the lanes whose triangles have an area.
#[inline(always)]
pub(crate) fn normals<S: Simd>(s: S, corner: impl Fn(usize, usize) -> D<S>) -> ([[f64; WIDTH]; 3], N<S>) {
    let p = axes(
        #[inline(always)]
        |axis| corner(1, axis) - corner(0, axis),
    );
    let q = axes(
        #[inline(always)]
        |axis| corner(2, axis) - corner(0, axis),
    );
    let across = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
    let largest = across[0].abs().max(across[1].abs()).max(across[2].abs());
    let across = [across[0] / largest, across[1] / largest, across[2] / largest];
    let by = D::splat(s, 1.0) / dot_3(across, across).sqrt();
    let known = D::splat(s, 0.0).lt(largest) & largest.lt(D::splat(s, f64::INFINITY));
    ([(across[0] * by).array(), (across[1] * by).array(), (across[2] * by).array()], known)
}

/// Unit normal; the corners are counter-clockwise seen from its tip. `None` for a triangle without an area.
pub(crate) fn normal(triangle: &Triangle) -> Option<V3> {
    normalize(cross_product(triangle))
}

/// True if a triangle has finite corners and an area, and so a [`normal`].
#[inline(always)]
pub(crate) fn has_area(triangle: &Triangle) -> bool {
    // Squares of products of two single precision numbers, 1e-180 to 1e157, are in the range of doubles; non-finite
    // corners give a non-finite square.
    let across = cross_product(triangle);
    let square = dot(across, across);
    square > 0.0 && square < f64::INFINITY
}

#[inline(always)]
fn cross_product(triangle: &Triangle) -> V3 {
    let [a, b, c] = triangle.map(to_f64);
    cross(sub(b, a), sub(c, a))
}

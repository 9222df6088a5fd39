//! Functions of three-dimensional vectors as arrays, the form in which meshes and renderers store them.
//!
//! The sums have the order of nalgebra's, so that both have the same bits. The functions are in the inner loops of the
//! renderers.

use nalgebra::RealField;
use std::ops::{Add, Mul, Sub};

/// Three coordinates in double precision.
pub type V3 = [f64; 3];

/// Dot product.
#[inline(always)]
pub fn dot<T: Copy + Add<Output = T> + Mul<Output = T>>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Cross product `a × b`.
#[inline(always)]
pub fn cross<T: Copy + Sub<Output = T> + Mul<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Length.
#[inline(always)]
pub fn norm<T: RealField + Copy>(a: [T; 3]) -> T {
    dot(a, a).sqrt()
}

/// Sum `a + b`.
#[inline(always)]
pub fn add<T: Copy + Add<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Difference `a - b`.
#[inline(always)]
pub fn sub<T: Copy + Sub<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a + k b`.
#[inline(always)]
pub fn add_scaled(a: V3, k: f64, b: V3) -> V3 {
    [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]]
}

/// `k a`.
#[inline(always)]
pub fn scale(a: V3, k: f64) -> V3 {
    a.map(|x| x * k)
}

/// Vector scaled to length 1; `None` for a zero vector and for numbers that are not finite.
#[inline(always)]
pub fn normalize(a: V3) -> Option<V3> {
    // Divided by the largest component first, because squares of tiny or huge numbers leave the range.
    let largest = a.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    // `f64::max` skips NaN.
    if !(largest > 0.0 && a.iter().all(|x| x.is_finite())) {
        return None;
    }
    let a = a.map(|x| x / largest);
    Some(scale(a, 1.0 / dot(a, a).sqrt()))
}

/// Vector divided by its length; `None` if the length is not above `min_norm` or not finite.
#[inline(always)]
pub fn try_normalize<T: RealField + Copy>(a: [T; 3], min_norm: T) -> Option<[T; 3]> {
    let length = norm(a);
    (length > min_norm && length.is_finite()).then(|| a.map(|x| x / length))
}

/// Converts a vector to double precision.
#[inline(always)]
pub fn to_f64(a: [f32; 3]) -> V3 {
    a.map(f64::from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// nalgebra is the reference, in both precisions, for each bit.
    #[test]
    fn same_bits_as_nalgebra() {
        fn check<T: RealField + Copy>(a: [T; 3], b: [T; 3]) {
            let (u, v) = (Vector3::from(a), Vector3::from(b));
            assert!(dot(a, b) == u.dot(&v) && norm(a) == u.norm());
            assert!(cross(a, b) == <[T; 3]>::from(u.cross(&v)));
            assert!(add(a, b) == <[T; 3]>::from(u + v) && sub(a, b) == <[T; 3]>::from(u - v));
            let shorter = u.norm() / nalgebra::convert(2.0);
            assert!(try_normalize(a, shorter) == u.try_normalize(shorter).map(<[T; 3]>::from));
            assert!(try_normalize(a, u.norm()).is_none() && u.try_normalize(u.norm()).is_none());
        }
        for k in 0..100 {
            let x = |i: i32| f64::from(k * 7 + i).sin() * 10f64.powi(k % 9 - 4);
            let (a, b) = ([x(0), x(1), x(2)], [x(3), x(4), x(5)]);
            check(a, b);
            check(a.map(|x| x as f32), b.map(|x| x as f32));
        }
        for wrong in [f64::NAN, f64::INFINITY] {
            assert_eq!(try_normalize([1.0, wrong, 0.0], 0.0), None);
        }
        // Control: another order of the sum has other bits.
        let a = [1e16, -1e16, 1.0];
        assert!(dot(a, [1.0; 3]) == 1.0 && a[0] + (a[1] + a[2]) == 0.0);
    }
}

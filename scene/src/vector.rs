//! Three-dimensional vectors in double precision.

/// Three coordinates.
pub type V3 = [f64; 3];

/// Dot product.
#[inline(always)]
pub fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Cross product `a × b`.
#[inline(always)]
pub fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Difference `a - b`.
#[inline(always)]
pub fn sub(a: V3, b: V3) -> V3 {
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

/// Converts a vector to double precision.
#[inline(always)]
pub fn to_f64(a: [f32; 3]) -> V3 {
    a.map(f64::from)
}

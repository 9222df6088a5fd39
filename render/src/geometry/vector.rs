//! Three numbers.

pub(crate) type V3 = [f64; 3];

#[inline(always)]
pub(crate) fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
pub(crate) fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a + k b`.
#[inline(always)]
pub(crate) fn along(a: V3, k: f64, b: V3) -> V3 {
    [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]]
}

#[inline(always)]
pub(crate) fn scale(a: V3, k: f64) -> V3 {
    a.map(|x| x * k)
}

/// Length 1; `None` where there is no direction.
#[inline(always)]
pub fn unit(a: V3) -> Option<V3> {
    // The largest component first: squares of tiny or huge numbers leave the range.
    let largest = a.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    if !(largest > 0.0 && largest.is_finite()) {
        return None;
    }
    let a = a.map(|x| x / largest);
    Some(scale(a, 1.0 / dot(a, a).sqrt()))
}

#[inline(always)]
pub(crate) fn to_f64(a: [f32; 3]) -> V3 {
    a.map(f64::from)
}

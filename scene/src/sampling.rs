//! Sample warping: points of a disc and directions of a hemisphere from uniform random numbers.

use crate::vector::V3;
use std::f64::consts::PI;

/// Cosine and sine of an angle of `part` turns, 0..=1, by their series. The library's functions differ between
/// machines.
#[inline]
pub fn cos_sin_turns(part: f64) -> [f64; 2] {
    let quarter = (4.0 * part + 0.5) as i64;
    let x = (part - quarter as f64 / 4.0) * (2.0 * PI);
    let (mut cos, mut sin, mut term) = (1.0, x, 1.0);
    // Up to an eighth of a turn, the last terms are below 1e-15.
    for k in 1..9 {
        let k = f64::from(k);
        term *= -(x * x) / ((2.0 * k - 1.0) * (2.0 * k));
        cos += term;
        sin += term * x / (2.0 * k + 1.0);
    }
    match quarter % 4 {
        0 => [cos, sin],
        1 => [-sin, cos],
        2 => [-cos, -sin],
        _ => [sin, -cos],
    }
}

/// Point of the unit disc, uniformly distributed for two uniform numbers in 0..1.
#[inline]
pub fn sample_disk([a, b]: [f64; 2]) -> [f64; 2] {
    let (r, [cos, sin]) = (a.sqrt(), cos_sin_turns(b));
    [r * cos, r * sin]
}

/// Unit direction of the hemisphere around +z, distributed as its cosine to +z for two uniform numbers in 0..1.
#[inline]
pub fn sample_cosine_hemisphere(at: [f64; 2]) -> V3 {
    let [x, y] = sample_disk(at);
    [x, y, (1.0 - at[0]).max(0.0).sqrt()]
}

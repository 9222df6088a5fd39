//! Lenses that are the same all around the optical axis: they turn angles into radii.

/// Where a direction is seen, if `radius` is that of an angle \[rad\] up to `most`.
pub(super) fn project([x, y, z]: [f64; 3], most: f64, radius: impl Fn(f64) -> f64) -> Option<[f64; 2]> {
    let across = x.hypot(y);
    let angle = across.atan2(z);
    if !(angle <= most && across.is_finite()) {
        return None;
    }
    if across == 0.0 {
        // Straight back is a whole circle.
        return (z > 0.0).then_some([0.0; 2]);
    }
    let by = radius(angle) / across;
    Some([x * by, y * by])
}

/// The unit direction that is seen at a point, if `angle` is that of a radius \[rad\]; up to `most` of them.
pub(super) fn unproject([x, y]: [f64; 2], most: f64, angle: impl Fn(f64) -> Option<f64>) -> Option<[f64; 3]> {
    let radius = x.hypot(y);
    if radius == 0.0 {
        return Some([0.0, 0.0, 1.0]);
    }
    let angle = angle(radius).filter(|angle| *angle <= most)?;
    let (sine, cosine) = angle.sin_cos();
    let by = sine / radius;
    Some([x * by, y * by, cosine])
}

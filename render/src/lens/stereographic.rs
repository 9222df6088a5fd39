//! The stereographic (conformal) fisheye: r = 2 f tan(theta / 2).

use super::radial::fisheye;

/// Largest angle \[rad\]: pi would have an infinite radius.
const MAX_ANGLE: f64 = 3.1;

fisheye! {
    /// The stereographic (conformal) fisheye: r = 2 f tan(theta / 2).
    Stereographic: "stereographic", &["fisheye_stereographic", "fisheyeStereographic"];
    angles up to MAX_ANGLE, "above 0, at most 3.1 (pi is infinitely far out)";
    radius: |angle| 2.0 * (0.5 * angle).tan();
    angle: |radius| Some(2.0 * (0.5 * radius).atan());
}

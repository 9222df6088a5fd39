//! The stereographic fisheye, which keeps angles: r = 2 f tan(theta / 2).

use super::radial::fisheye;

/// The largest angle \[rad\]: pi would be infinitely far out.
const MOST: f64 = 3.1;

fisheye! {
    /// The stereographic fisheye, which keeps angles: r = 2 f tan(theta / 2).
    Stereographic: "stereographic", &["fisheye_stereographic", "fisheyeStereographic"];
    angles up to MOST, "above 0, at most 3.1 (pi is infinitely far out)";
    radius: |angle| 2.0 * (0.5 * angle).tan();
    angle: |radius| Some(2.0 * (0.5 * radius).atan());
}

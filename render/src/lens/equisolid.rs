//! The equisolid-angle (equal-area) fisheye: r = 2 f sin(theta / 2).

use super::radial::fisheye;
use std::f64::consts::PI;

fisheye! {
    /// The equisolid-angle (equal-area) fisheye: r = 2 f sin(theta / 2).
    Equisolid: "equisolid", &["fisheye_equisolid", "fisheyeEquisolid", "equal_area"];
    angles up to PI, "above 0, at most pi";
    radius: |angle| 2.0 * (0.5 * angle).sin();
    angle: |radius| (radius <= 2.0).then(|| 2.0 * (0.5 * radius).asin());
}

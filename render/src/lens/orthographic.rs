//! The orthographic fisheye: r = f sin(theta).

use super::radial::fisheye;
use std::f64::consts::FRAC_PI_2;

fisheye! {
    /// The orthographic fisheye, which sees at most a hemisphere: r = f sin(theta).
    Orthographic: "orthographic", &["fisheye_orthographic", "fisheyeOrthographic"];
    angles up to FRAC_PI_2, "above 0, at most pi / 2";
    radius: |angle| angle.sin();
    angle: |radius| (radius <= 1.0).then(|| radius.asin());
}

//! The equidistant fisheye: r = f theta.

use super::radial::fisheye;
use std::f64::consts::PI;

fisheye! {
    /// The equidistant fisheye: r = f theta.
    Equidistant: "equidistant", &["fisheye_equidistant", "fisheyeEquidistant", "linear"];
    angles up to PI, "above 0, at most pi";
    radius: |angle| angle;
    angle: Some;
}

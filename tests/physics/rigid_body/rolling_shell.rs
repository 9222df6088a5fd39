//! A hollow ball rolls down a slope, with 2/3 m r² instead of the solid ball's 2/5 m r²: a = 3/5 g sin θ. The moment is
//! given by the file, not by the shape.
//!
//! Tolerance: as for a solid ball, half of the depth over the radius.

use super::incline::acceleration;
use super::soft_contact::depth;
use crate::lab::*;

const RADIUS: f64 = 0.5;
const MASS: f64 = 0.8;

fn rolling(moment: f64) -> f64 {
    let angle = 10.0_f64.to_radians();
    let ball = Link::sphere("ball", MASS, RADIUS, moment);
    acceleration(slope(angle, 0.8), ball, Pose::translation(0.0, 0.0, RADIUS))
}

#[test]
fn holds() {
    law(module_path!(), "a = 3/5 g sin θ", |m| {
        let (sin, cos) = 10.0_f64.to_radians().sin_cos();
        let a = 3.0 / 5.0 * G * sin;
        let unit = MASS * RADIUS * RADIUS;
        let arm = a * depth(G * cos) / (2.0 * RADIUS);
        let within = (arm, "the arm is half of the depth shorter");
        m.row("acceleration on 10°", "m/s²", a, rolling(2.0 / 3.0 * unit), within);
        m.control("acceleration on 10°", "with the moment of a full ball", rolling(0.4 * unit));
    });
}

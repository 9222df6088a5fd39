//! A cylinder rolls down a slope, with 1/2 m r² instead of the ball's 2/5 m r²: a = 2/3 g sin θ.
//!
//! Tolerance: as for a ball, half of the depth over the radius, with the depth under the whole weight (the contacts of
//! a line share it).

use super::incline::acceleration;
use super::soft_contact::depth;
use crate::lab::*;
use kinetoscope::scene::pose::from_xyz_rpy;
use std::f64::consts::FRAC_PI_2;

const RADIUS: f64 = 0.5;

fn rolling(friction: f64) -> f64 {
    let link = Link::cylinder("cylinder", 2.0, RADIUS, 1.0);
    let on_its_side = from_xyz_rpy([0.0, 0.0, RADIUS], [FRAC_PI_2, 0.0, 0.0]);
    acceleration(slope(10.0_f64.to_radians(), friction), link, on_its_side)
}

#[test]
fn holds() {
    law(module_path!(), "a = 2/3 g sin θ", |m| {
        let (sin, cos) = 10.0_f64.to_radians().sin_cos();
        let a = 2.0 / 3.0 * G * sin;
        let arm = a * depth(G * cos) / (2.0 * RADIUS);
        m.row("acceleration on 10°", "m/s²", a, rolling(0.8), (arm, "the arm is half of the depth shorter"));
        m.control("acceleration on 10°", "without friction", rolling(0.0));
    });
}

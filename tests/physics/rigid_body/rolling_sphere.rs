//! A ball rolls down a slope without slipping. Force at the contact: m a = m g sin θ - f, 2/5 m r² α = f r, a = r α, so
//! a = 5/7 g sin θ.
//!
//! Tolerance: the contact sinks in by δ, and MuJoCo places it in the middle of the overlap, δ/2 closer to the center.
//! The lever arm is shorter by δ/2r, and a changes by 4/7 of that. The tolerance δ/2r covers this, and is far below the
//! 2/7 that rolling takes.

use super::incline::acceleration;
use super::soft_contact::depth;
use crate::lab::*;

const RADIUS: f64 = 0.5;

fn rolling(friction: f64) -> f64 {
    let angle = 10.0_f64.to_radians();
    acceleration(slope(angle, friction), Link::ball("ball", 1.5, RADIUS), Pose::translation(0.0, 0.0, RADIUS))
}

#[test]
fn holds() {
    law(module_path!(), "a = 5/7 g sin θ", |m| {
        let (sin, cos) = 10.0_f64.to_radians().sin_cos();
        let a = 5.0 / 7.0 * G * sin;
        let arm = a * depth(G * cos) / (2.0 * RADIUS);
        m.row("acceleration on 10°", "m/s²", a, rolling(0.8), (arm, "the arm is half of the depth shorter"));
        m.control("acceleration on 10°", "without friction", rolling(0.0));
    });
}

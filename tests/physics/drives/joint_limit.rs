//! Joint limits are as soft as contacts: an effort τ presses the joint beyond its limit by the depth of
//! [`soft_contact`](crate::rigid_body::soft_contact) under A τ = τ/I. A drive never presses: its target is clamped at
//! the limit.
//!
//! Tolerance: the depth is a fixed point of arithmetic, of which e^-100 is left after 2 s: 1e-8 of it. The drive with
//! k/d = 10/s converges to e^-30.

use super::wheel::{MOMENT, Wheel, hinge};
use crate::lab::*;
use crate::rigid_body::soft_contact::depth;

const RANGE: [f64; 2] = [-0.4, 0.7];
const EFFORT: f64 = 0.6;

fn limits(limited: bool) -> Joint {
    if limited { hinge().limit(RANGE[0], RANGE[1], 1e3) } else { hinge() }
}

/// Final position under an effort, without a drive.
fn final_position_under_effort(effort: f64, limited: bool) -> f64 {
    let mut wheel = Wheel::on(weightless(), passive(), limits(limited), MOMENT);
    wheel.set_effort(effort);
    wheel.lab.run(3.0);
    wheel.q()
}

/// Final position of a drive with the target 2 rad.
fn final_position_of_drive(limited: bool) -> f64 {
    let mut wheel = Wheel::on(weightless(), implicit(1e2, 1e1), limits(limited), MOMENT);
    wheel.set_target_position(2.0);
    wheel.lab.run(3.0);
    wheel.q()
}

#[test]
fn holds() {
    law(module_path!(), "q = limit + (1 - d)/d² τ/I dmax² tc²", |m| {
        let beyond = depth(EFFORT / MOMENT);
        let left = (1e-8 * beyond + 1e-15, "what is left of the motion");
        m.row("pressed to the upper limit", "rad", RANGE[1] + beyond, final_position_under_effort(EFFORT, true), left);
        m.row("pressed to the lower limit", "rad", RANGE[0] - beyond, final_position_under_effort(-EFFORT, true), left);
        m.row(
            "driven beyond the upper limit",
            "rad",
            RANGE[1],
            final_position_of_drive(true),
            (1e-11, "e^-30 of the way is left"),
        );
        m.control(
            "pressed to the upper limit",
            "with 1 % more effort",
            final_position_under_effort(1.01 * EFFORT, true),
        );
        m.control("pressed to the lower limit", "without limits", final_position_under_effort(-EFFORT, false));
        m.control("driven beyond the upper limit", "without limits", final_position_of_drive(false));
    });
}

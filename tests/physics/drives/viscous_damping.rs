//! Viscous damping B of a joint: a body with velocity v₀ comes to rest after I v₀/B radians, an effort τ leads to the
//! velocity τ/B, and a velocity drive d holds d v*/(d + B). All three hold in steps of any length if damping is
//! evaluated at the end of the step: the distance is h v₀ Σ (1 + h B/I)^-n = I v₀/B.
//!
//! Tolerance: e^-20 of the motion is left after 2 s.

use super::wheel::{MOMENT, Wheel, hinge};
use crate::lab::*;
use kinetoscope::sim::DriveModel;

const DAMPING: f64 = 0.5;
const START: f64 = 4.0;
const EFFORT: f64 = 0.8;
const DRIVE: f64 = 1.5;

/// Distance to rest, velocity under an effort, and velocity of a drive with the target v₀.
fn damped_motion(model: DriveModel, damping: f64) -> [f64; 3] {
    let wheel =
        |drive: DriveCfg| Wheel::on(weightless(), DriveCfg { model, ..drive }, hinge().dynamics(damping, 0.0), MOMENT);
    let mut coasting = wheel(passive());
    coasting.lab.write_joints(coasting.robot, &[0.0], &[START]);
    coasting.lab.run(2.0);
    let mut pushed = wheel(passive());
    pushed.set_effort(EFFORT);
    pushed.lab.run(2.0);
    let mut driven = wheel(implicit(0.0, DRIVE));
    driven.set_target_velocity(START);
    driven.lab.run(2.0);
    [coasting.q(), pushed.v(), driven.v()]
}

#[test]
fn holds() {
    law(module_path!(), "way = I v₀/B; v = τ/B; v = d v*/(d + B)", |m| {
        for (name, model) in [("implicit", DriveModel::Implicit), ("actuator", DriveModel::Actuator)] {
            let (found, more) = (damped_motion(model, DAMPING), damped_motion(model, 1.01 * DAMPING));
            let rows = [
                ("way to rest", "rad", MOMENT * START / DAMPING),
                ("velocity under an effort", "rad/s", EFFORT / DAMPING),
                ("velocity of a drive", "rad/s", DRIVE * START / (DRIVE + DAMPING)),
            ];
            for (k, (quantity, unit, expected)) in rows.into_iter().enumerate() {
                let quantity = format!("{quantity}, {name}");
                m.row(&quantity, unit, expected, found[k], (1e-7 * expected, "e^-20 of the motion is left"));
                m.control(&quantity, "with 1 % more damping", more[k]);
            }
        }
    });
}

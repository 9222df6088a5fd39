//! A drive without stiffness holds a velocity: I v' = d (v* - v) + τ, so v = (v* + τ/d)(1 - e^(-d t/I)) from rest.
//! Evaluated at the end of the step v(n) = (v* + τ/d)(1 - (1 + h d/I)^-n), at its start with (1 - h d/I)^n.
//!
//! Tolerance: rounding of 200 sums. Against continuous time, h d/I · d t/2I e^(-d t/I), which is at most h d/2I/e: 0.4
//! % of v* at h d/I = 0.02, doubled for the next order. At the end e^-20 is left.

use super::wheel::{MOMENT, Wheel};
use crate::lab::*;

const DAMPING: f64 = 1.0;
const SPEED: f64 = 3.0;
const LOAD: f64 = -0.4;

/// Velocities after 50 ms and 1 s under the load, and the effort after 1 s.
fn velocities_and_effort(drive: DriveCfg, load: f64) -> [f64; 3] {
    let mut wheel = Wheel::new(weightless(), drive);
    wheel.set_target_velocity(SPEED);
    wheel.set_external_torque(load);
    wheel.lab.run(0.05);
    let early = wheel.v();
    wheel.lab.run(0.95);
    [early, wheel.v(), wheel.drive_effort()]
}

#[test]
fn holds() {
    law(module_path!(), "v = (v* + τ/d)(1 - e^(-d t/I)) -> v* + τ/d", |m| {
        let (end, a) = (SPEED + LOAD / DAMPING, 1e-3 * DAMPING / MOMENT);
        let models = [
            ("implicit", implicit(0.0, DAMPING), implicit(0.0, 2.0 * DAMPING), (1.0 + a).powi(-50)),
            ("actuator", explicit(0.0, DAMPING), explicit(0.0, 2.0 * DAMPING), (1.0 - a).powi(50)),
        ];
        for (name, drive, harder, left) in models {
            let (found, free) = (velocities_and_effort(drive.clone(), LOAD), velocities_and_effort(drive, 0.0));
            let hard = velocities_and_effort(harder, LOAD);
            let of = |what: &str| format!("{what}, {name}");
            let rounding = (1e-11, "rounding of 200 sums");
            m.row(&of("velocity after 50 ms"), "rad/s", end * (1.0 - left), found[0], rounding);
            let smooth = end * (1.0 - (-0.05 * DAMPING / MOMENT).exp());
            let within = (a / 2.0 * end, "h d/2I, next order too");
            m.row(&of("the same in continuous time"), "rad/s", smooth, found[0], within);
            m.row(&of("velocity under a load"), "rad/s", end, found[1], (1e-7, "e^-20 of it is left"));
            m.row(&of("effort under a load"), "N m", -LOAD, found[2], (1e-7, "e^-20 of it is left"));
            m.control(&of("velocity after 50 ms"), "with twice the damping", hard[0]);
            m.control(&of("the same in continuous time"), "with twice the damping", hard[0]);
            m.control(&of("velocity under a load"), "without the load", free[1]);
            m.control(&of("effort under a load"), "without the load", free[2]);
        }
    });
}

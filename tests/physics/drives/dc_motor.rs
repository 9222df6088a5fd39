//! The effort of a DC motor falls with its speed: τ = s (1 - v/v₀) up to a limit L. At full command, a wheel under a
//! load τ accelerates with (L + τ)/I until v₁ = v₀ (1 - L/s). From there its velocity is v₀' - (v₀' - v₁) e^(-s t/(I
//! v₀)), with v₀' = v₀ (1 + τ/s). In steps of h the exponential is (1 - h s/(I v₀))^n.
//!
//! Tolerance: rounding of 1000 sums. The continuous solution enters the torque-speed line up to a step later, h s/(I
//! v₀) of the velocity range: 0.2 %.

use super::wheel::{MOMENT, Wheel};
use crate::lab::*;
use kinetoscope::sim::DcMotor;

const STALL: f64 = 1.0;
const LIMIT: f64 = 0.6;
const FREE: f64 = 10.0;

/// Velocities after 20 ms, 1 s and 10 s.
fn velocities(stall: f64, load: f64) -> [f64; 3] {
    let drive = DriveCfg {
        actuators: vec![(".*".into(), DcMotor { saturation_effort: stall }.into())],
        max_effort: Some(LIMIT.into()),
        max_velocity: Some(FREE.into()),
        ..implicit(0.0, 0.0)
    };
    let mut wheel = Wheel::new(weightless(), drive);
    wheel.set_effort(100.0);
    wheel.set_external_torque(load);
    [0.02, 0.98, 9.0].map(|seconds| {
        wheel.lab.run(seconds);
        wheel.v()
    })
}

#[test]
fn holds() {
    law(module_path!(), "τ = min(s (1 - v/v₀), L)", |m| {
        for (name, load) in [("without load", 0.0), ("under a load", -0.2)] {
            let ([early, later, end], [_, other, _]) = (velocities(STALL, load), velocities(1.5 * STALL, load));
            let of = |what: &str| format!("{what} {name}");
            let rounding = (1e-10, "rounding of 1000 steps");
            m.row(&of("velocity after 20 ms"), "rad/s", (LIMIT + load) / MOMENT * 0.02, early, rounding);
            let (corner, free) = (FREE * (1.0 - LIMIT / STALL), FREE * (1.0 + load / STALL));
            let reached = corner * MOMENT / (LIMIT + load);
            let smooth = free - (free - corner) * (-(1.0 - reached) * STALL / (MOMENT * FREE)).exp();
            let late = (1e-3 * STALL / (MOMENT * FREE) * free, "a step late on the line");
            m.row(&of("velocity after 1 s"), "rad/s", smooth, later, late);
            m.row(&of("velocity at the end"), "rad/s", free, end, (1e-7, "e^-19 of it is left"));
            m.control(&of("velocity after 1 s"), "with a stall effort half as large again", other);
            let [pulled, _, fast] = velocities(STALL, load - 0.1);
            m.control(&of("velocity after 20 ms"), "under 0.1 N m more", pulled);
            m.control(&of("velocity at the end"), "under 0.1 N m more", fast);
        }
    });
}

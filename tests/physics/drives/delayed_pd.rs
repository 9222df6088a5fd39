//! A controller with a target delay of D steps behaves like one without delay D steps earlier: q_D(t) = q₀(t - D h),
//! for targets that begin at the start. Measurements are not delayed: the controller responds to a load at once.
//!
//! Tolerance: none, the arithmetic is the same.

use super::wheel::{MOMENT, Wheel};
use crate::lab::*;
use kinetoscope::sim::DelayedPd;

const STEPS: usize = 300;

/// Positions after each step for an oscillating target.
fn positions(delay: u32) -> Vec<f64> {
    let model = DelayedPd { delay, max_delay: delay };
    let drive = DriveCfg { actuators: vec![(".*".into(), model.into())], ..implicit(MOMENT * 400.0, MOMENT * 20.0) };
    let mut wheel = Wheel::new(weightless(), drive);
    (0..STEPS)
        .map(|n| {
            wheel.set_target_position(0.3 + 0.2 * (0.07 * n as f64).sin());
            wheel.set_target_velocity(0.1 * (0.05 * n as f64).cos());
            wheel.lab.run(1e-3);
            wheel.q()
        })
        .collect()
}

/// Velocity after two steps from rest under a load in N m.
fn loaded_velocity(delay: u32, load: f64) -> f64 {
    let model = DelayedPd { delay, max_delay: delay };
    let drive = DriveCfg { actuators: vec![(".*".into(), model.into())], ..implicit(20.0, 1.0) };
    let mut wheel = Wheel::new(weightless(), drive);
    wheel.set_external_torque(load);
    wheel.lab.run(2e-3);
    wheel.v()
}

#[test]
fn holds() {
    law(module_path!(), "q_D(t) = q₀(t - D h)", |m| {
        let at_once = positions(0);
        let apart = |positions: &[f64], delay: usize| {
            positions[delay..].iter().zip(&at_once).map(|(late, now)| (late - now).abs()).fold(0.0, f64::max)
        };
        for delay in [1, 7, 40] {
            let quantity = format!("q_D(t) - q₀(t - D h), D = {delay}");
            m.row(&quantity, "rad", 0.0, apart(&positions(delay), delay as usize), (0.0, "the same arithmetic"));
            m.control(&quantity, "without the delay", apart(&at_once, delay as usize));
        }
        // Two steps of h: the second includes the drive's response to the first.
        let first = 1e-3 / MOMENT;
        let second = first + 1e-3 / MOMENT * (1.0 - 20.0 * 1e-3 * first - first);
        m.row("velocity after two steps under a load", "rad/s", second, loaded_velocity(9, 1.0), (1e-13, "rounding"));
        m.control("velocity after two steps under a load", "without the load", loaded_velocity(9, 0.0));
    });
}

//! A controller at the rate of the simulation, without damping, is a leapfrog: q(n+1) - 2 q(n) + q(n-1) = -(ω h)² q(n),
//! ω² = k/I. From rest at q₀ it has the solution
//!
//! ```text
//! q(n) = q₀ (cos n θ - tan(θ/2) sin n θ),   cos θ = 1 - (ω h)²/2
//! ```
//!
//! which neither grows nor falls as long as ω h < 2. Beyond, cos θ < -1: it grows by |z| = c + √(c² - 1) a step, c = (ω
//! h)²/2 - 1.
//!
//! Tolerance: rounding of 500 steps of a stable recurrence, ten times; of growth, what the second root 1/z leaves of a
//! ratio after 15 steps.

use super::wheel::{MOMENT, Wheel};
use crate::lab::*;
use crate::law::law;
use kinetoscope::prelude::*;

const H: f64 = 1e-3;
const START: f64 = 0.01;

/// Positions before and after the last of `steps` steps at this ω h.
fn swung(rate: f64, explicit: bool, steps: u32) -> [f64; 2] {
    let stiffness = MOMENT * (rate / H) * (rate / H);
    let actuators = if explicit { vec![(".*".into(), IdealPd {}.into())] } else { Vec::new() };
    let mut wheel = Wheel::new(weightless(), DriveCfg { actuators, ..implicit(stiffness, 0.0) });
    wheel.lab.write_joints(wheel.robot, &[START], &[0.0]);
    wheel.aim(0.0);
    let robot = wheel.robot;
    let mut last = [0.0; 2];
    wheel.lab.watch(steps, |_, sim| last = [last[1], sim.robot(robot).get_qpos()[(0, 0)]]);
    last
}

#[test]
fn holds() {
    law(module_path!(), "q(n) = q₀ (cos n θ - tan(θ/2) sin n θ), cos θ = 1 - h² k/2I", |m| {
        for rate in [0.1_f64, 1.0, 1.9] {
            let theta = (1.0 - 0.5 * rate * rate).acos();
            let (sin, cos) = (500.0 * theta).sin_cos();
            let quantity = format!("position after 500 steps, ω h = {rate}");
            let found = swung(rate, true, 500)[1];
            let expected = START * (cos - (0.5 * theta).tan() * sin);
            m.row(&quantity, "rad", expected, found, (1e-11, "rounding of 500 steps, ten times"));
            m.control(&quantity, "with the law at the end of the step", swung(rate, false, 500)[1]);
        }
        let c: f64 = 0.5 * 2.1 * 2.1 - 1.0;
        let growth = |rate: f64| swung(rate, true, 15).map(f64::abs);
        let [before, after] = growth(2.1);
        let z = c + (c * c - 1.0).sqrt();
        m.row("growth in a step, ω h = 2.1", "", z, after / before, (1e-7, "1/z of the other root, 30 times"));
        let [before, after] = growth(1.9);
        m.control("growth in a step, ω h = 2.1", "with ω h = 1.9", after / before);
    });
}

//! A controller at the rate of the simulation, without damping, is a leapfrog scheme: q(n+1) - 2 q(n) + q(n-1) = -(ω
//! h)² q(n), ω² = k/I. From rest at q₀ its solution is
//!
//! ```text
//! q(n) = q₀ (cos n θ - tan(θ/2) sin n θ),   cos θ = 1 - (ω h)²/2
//! ```
//!
//! The amplitude is constant as long as ω h < 2. Beyond, cos θ < -1: the roots -z and -1/z of the recurrence are real,
//! z = c + √(c² - 1), c = (ω h)²/2 - 1. Then q(n) = α (-z)ⁿ + β (-1/z)ⁿ with α and β from q(0) = q₀ and q(1) = q₀ (1 -
//! (ω h)²): growth by z per step, up to the contribution of the second root.
//!
//! Tolerance: rounding. A step rounds six times (target less position, times k, over I, times h, added to v, times h
//! added to q). The rounded numbers have the size of the amplitude Q = q₀/cos(θ/2) times 1 + (ω h)², to ε/2 each. An
//! error in step k is multiplied by sin((n - k) θ)/sin θ in step n: in total n 3 ε Q (1 + (ω h)²)/sin θ. For a growing
//! solution the error grows in proportion, with sinh for sin: the ratio of two positions has the errors of both.

use super::wheel::{MOMENT, Wheel};
use crate::lab::*;
use kinetoscope::sim::IdealPd;

const H: f64 = 1e-3;
const START: f64 = 0.01;

/// Positions before and after the last of `steps` steps at this ω h.
fn last_positions(rate: f64, explicit: bool, steps: u32) -> [f64; 2] {
    let stiffness = MOMENT * (rate / H) * (rate / H);
    let actuators = if explicit { vec![(".*".into(), IdealPd {}.into())] } else { Vec::new() };
    let mut wheel = Wheel::new(weightless(), DriveCfg { actuators, ..implicit(stiffness, 0.0) });
    wheel.lab.write_joints(wheel.robot, &[START], &[0.0]);
    wheel.set_target_position(0.0);
    let robot = wheel.robot;
    let mut last = [0.0; 2];
    wheel.lab.run_with(steps, |_, sim| last = [last[1], sim.robot(robot).qpos()[(0, 0)]]);
    last
}

#[test]
fn holds() {
    law(module_path!(), "q(n) = q₀ (cos n θ - tan(θ/2) sin n θ), cos θ = 1 - h² k/2I", |m| {
        for rate in [0.1_f64, 1.0, 1.9] {
            let theta = (1.0 - 0.5 * rate * rate).acos();
            let (sin, cos) = (500.0 * theta).sin_cos();
            let quantity = format!("position after 500 steps, ω h = {rate}");
            let found = last_positions(rate, true, 500)[1];
            let expected = START * (cos - (0.5 * theta).tan() * sin);
            let size = START / (0.5 * theta).cos() * (1.0 + rate * rate);
            let off = (500.0 * 3.0 * f64::EPSILON * size / theta.sin(), "rounding of 500 steps");
            m.row(&quantity, "rad", expected, found, off);
            m.control(&quantity, "with the law at the end of the step", last_positions(rate, false, 500)[1]);
        }
        let square: f64 = 2.1 * 2.1;
        let c = 0.5 * square - 1.0;
        let growth = |rate: f64| last_positions(rate, true, 15).map(f64::abs);
        let [before, after] = growth(2.1);
        let z = c + (c * c - 1.0).sqrt();
        // Coefficients of the two roots, from q(0) = 1 and q(1) = 1 - (ω h)².
        let large = (1.0 / z + 1.0 - square) / (1.0 / z - z);
        let at = |n: i32| (large * (-z).powi(n) + (1.0 - large) * (-1.0 / z).powi(n)).abs();
        let ratio = at(15) / at(14);
        let sinh = 0.5 * (z - 1.0 / z);
        let off = 2.0 * 15.0 * 3.0 * f64::EPSILON * (1.0 + square) / sinh * ratio;
        m.row("growth in a step, ω h = 2.1", "", ratio, after / before, (off, "rounding of 15 steps"));
        let [before, after] = growth(1.9);
        m.control("growth in a step, ω h = 2.1", "with ω h = 1.9", after / before);
    });
}

//! A step of the target q* of a drive within its limits: I q'' + d q' + k (q - q*) = 0, with ω² = k/I and z = d/(2 I ω)
//! < 1:
//!
//! ```text
//! e(t) = (q* - q)/q* = exp(-z ω t) (cos ω' t + z/√(1 - z²) sin ω' t),   ω' = ω √(1 - z²)
//! first at the target: (π - acos z)/ω';   overshoot: exp(-π z/√(1 - z²));   under a load τ: q* - q = τ/k
//! ```
//!
//! The settling time to 5 % is the last time with |e| = 0.05, found by bisection of the formula. A delay of the target
//! shifts all times by itself.
//!
//! Tolerance: steps of h turn both laws into a slightly different oscillator. Evaluated at the end of the step, k (q +
//! h q') and d (q' + h q''/2) change z by (1 - z²) ω h/2 and ω by z ω h/2. Evaluated at its start, z and ω change by
//! less than that, with d (q' - h q''/2). Times are off by ω h of themselves and two steps. The overshoot is off by d
//! ln/dz of itself, for which π ω h/√(1 - z²) of itself is twice the bound. Of the static error, exp(-15) is left.

use super::variants::{self, Variant};
use super::wheel::{MOMENT, Wheel};
use crate::lab::*;
use std::f64::consts::PI;

const H: f64 = 1e-4;
const OMEGA: f64 = 20.0;
const RATIO: f64 = 0.5;
const AIM: f64 = 0.1;
const LOAD: f64 = 0.3;
const BAND: f64 = 0.05;

/// Step response: times \[s\], relative overshoot, and error under a load \[rad\].
#[derive(Clone, Debug)]
struct Response {
    rise: f64,
    overshoot: f64,
    settling: f64,
    error: f64,
    curve: Vec<[f64; 2]>,
}

fn error(t: f64) -> f64 {
    let root = (1.0 - RATIO * RATIO).sqrt();
    let (sin, cos) = (OMEGA * root * t).sin_cos();
    (-RATIO * OMEGA * t).exp() * (cos + RATIO / root * sin)
}

/// The last time with 5 % of the step left: after the first overshoot and before the smaller undershoot.
fn settling() -> f64 {
    let half_period = PI / (OMEGA * (1.0 - RATIO * RATIO).sqrt());
    assert!(error(half_period) < -BAND && error(2.0 * half_period) < BAND);
    let [mut low, mut high] = [half_period, 2.0 * half_period];
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if error(middle) < -BAND { low = middle } else { high = middle }
    }
    low
}

/// The drive with the poles of the formula; `stiffer` multiplies the stiffness.
fn drive(of: &Variant, stiffer: f64) -> DriveCfg {
    of.drive(MOMENT * stiffer * OMEGA * OMEGA, MOMENT * 2.0 * RATIO * OMEGA)
}

fn response(drive: DriveCfg) -> Response {
    let mut wheel = Wheel::new(with_dt(H, weightless()), drive);
    wheel.set_target_position(AIM);
    let (mut rise, mut highest, mut settling, mut before) = (f64::NAN, 0.0_f64, f64::NAN, [0.0, 0.0]);
    let (robot, mut curve) = (wheel.robot, Vec::new());
    wheel.lab.run_with(7_500, |t, sim| {
        let part = sim.robot(robot).qpos()[(0, 0)] / AIM;
        let crossed = |level: f64| before[0] + (t - before[0]) * (level - before[1]) / (part - before[1]);
        if rise.is_nan() && part >= 1.0 {
            rise = crossed(1.0);
        }
        if part <= 1.0 + BAND && before[1] > 1.0 + BAND {
            settling = crossed(1.0 + BAND);
        }
        highest = highest.max(part);
        before = [t, part];
        if ((t / H).round() as u32).is_multiple_of(50) {
            curve.push([t, part]);
        }
    });
    wheel.set_external_torque(-LOAD);
    wheel.lab.run(1.5);
    Response { rise, overshoot: highest - 1.0, settling, error: AIM - wheel.q(), curve }
}

#[test]
fn holds() {
    law(module_path!(), "q = q* (1 - exp(-z ω t) (cos ω' t + z/√(1 - z²) sin ω' t)); q* - q = τ/k", |m| {
        let root = (1.0 - RATIO * RATIO).sqrt();
        let mut curves =
            vec![("closed form", (0..150).map(|k| 5e-3 * f64::from(k)).map(|t| [t, 1.0 - error(t)]).collect())];
        let variants = variants::all();
        for variant in &variants {
            let (mode, delay) = (variant.name.as_str(), f64::from(variant.delay()) * H);
            let (found, stiff) = (response(drive(variant, 1.0)), response(drive(variant, 2.0)));
            let rise = (PI - RATIO.acos()) / (OMEGA * root) + delay;
            let overshoot = (-PI * RATIO / root).exp();
            let late = delay + settling();
            let static_error = LOAD / (MOMENT * OMEGA * OMEGA);
            let time = |t: f64| (OMEGA * H * t + 2.0 * H, "a first-order step shifts ω by z ω h/2, and time by h");
            let of = |what: &str| format!("{what}, {mode}");
            m.row(&of("first at the target"), "s", rise, found.rise, time(rise));
            let shape = (PI * OMEGA * H / root * overshoot, "a first-order step shifts z by (1 - z²) ω h/2");
            m.row(&of("overshoot of the step"), "", overshoot, found.overshoot, shape);
            m.row(&of("within 5 %"), "s", late, found.settling, time(late));
            let left = (1e-6 * static_error, "exp(-15) of the motion is left");
            m.row(&of("error under a load"), "rad", static_error, found.error, left);
            let without = "with twice the stiffness";
            m.control(&of("first at the target"), without, stiff.rise);
            m.control(&of("overshoot of the step"), without, stiff.overshoot);
            m.control(&of("within 5 %"), without, stiff.settling);
            m.control(&of("error under a load"), without, stiff.error);
            if mode == "implicit" || variant.delay() > 0 {
                curves.push((mode, found.curve));
            }
        }
        m.plot("A drive answers a step of its target", ["time [s]", "part of the step"], false, &curves);
    });
}

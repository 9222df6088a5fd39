//! A drive of any mode and any model whose effort exceeds its limit L gives exactly L, and the wheel moves as under L:
//! I q'' = L. In steps of h from rest, v(n) = n h L/I and q(n) = n (n + 1)/2 h² L/I. A load τ > L moves it with (τ -
//! L)/I.
//!
//! Tolerance: none for the effort; rounding for the motion. Every step adds to numbers of up to x, with half a digit of
//! error in the velocity and, from it, in the position: 200 ε x. (Under a load the far target stays out of reach.)

use super::variants::{self, Variant};
use super::wheel::{MOMENT, Wheel};
use crate::lab::*;

const LIMIT: f64 = 2.0;
const STEPS: u32 = 200;
const LOAD: f64 = 3.0;

/// Smallest effort of the drive, position and velocity after 0.2 s, and velocity under a load after the same time.
fn limited_motion(of: &Variant, limit: f64) -> [f64; 4] {
    let drive = DriveCfg { max_effort: Some(limit.into()), ..of.drive(100.0, 1.0) };
    let run = |load: f64| {
        let mut wheel = Wheel::new(weightless(), drive.clone());
        wheel.set_target_position(100.0);
        // Until the delayed target arrives, the drive holds the wheel in place.
        wheel.lab.run_with(of.delay(), |_, _| ());
        wheel.set_external_torque(load);
        let (robot, mut least) = (wheel.robot, f64::INFINITY);
        wheel.lab.run_with(STEPS, |_, sim| least = least.min(sim.robot(robot).qf()[(0, 0)]));
        (least, wheel.q(), wheel.v())
    };
    let ((least, q, v), (_, _, loaded)) = (run(0.0), run(-LOAD));
    [least, q, v, loaded]
}

#[test]
fn holds() {
    law(module_path!(), "|τ| <= L; I q'' = L + load", |m| {
        let (h, n) = (1e-3, f64::from(STEPS));
        let acceleration = LIMIT / MOMENT;
        for variant in variants::all() {
            let (found, weak) = (limited_motion(&variant, LIMIT), limited_motion(&variant, 0.99 * LIMIT));
            let rounding = |x: f64| n * f64::EPSILON * x.abs();
            let [position, velocity] = [acceleration * h * h * n * (n + 1.0) / 2.0, acceleration * h * n];
            let loaded = (LIMIT - LOAD) / MOMENT * h * n;
            let rows = [
                ("least effort", "N m", LIMIT, 0.0),
                ("position after 0.2 s", "rad", position, rounding(position)),
                ("velocity after 0.2 s", "rad/s", velocity, rounding(velocity)),
                ("velocity under a load", "rad/s", loaded, rounding(loaded)),
            ];
            for (k, (quantity, unit, expected, tolerance)) in rows.into_iter().enumerate() {
                let quantity = format!("{quantity}, {}", variant.name);
                let why = if tolerance == 0.0 { "the same number" } else { "rounding of 200 sums" };
                m.row(&quantity, unit, expected, found[k], (tolerance, why));
                m.control(&quantity, "with a limit 1 % lower", weak[k]);
            }
        }
    });
}

//! Dry friction f stops a wheel: v = v₀ - f t/I, after I v₀/f seconds and I v₀²/2f radians. Below its limit it creeps:
//! MuJoCo's friction is then a damper, R τ = -B v with R = (1 - d)/d/I and B = 1/(d h), so v = (1 - d) h τ/I with d =
//! 0.9999.
//!
//! Steps of h end at v(n) = v₀ - n h f/I, so that the distance is short by h v₀/2.
//!
//! Tolerance: for velocities, rounding. For the distance, the velocity left by the last step, 1 - d of h f/I, for one
//! step, and rounding. The creep is that at rest, 1e-6 of it.

use super::wheel::{MOMENT, Wheel, hinge};
use crate::lab::*;
use kinetoscope::sim::DriveModel;

const FRICTION: f64 = 1.0;
const START: f64 = 2.0;

/// Velocity after 60 ms, and velocity and distance after 0.3 s, three times the stopping time.
fn stopping_motion(drive: DriveCfg, friction: f64) -> [f64; 3] {
    let mut wheel = Wheel::on(weightless(), drive, hinge().dynamics(0.0, friction), MOMENT);
    wheel.lab.write_joints(wheel.robot, &[0.0], &[START]);
    wheel.lab.run(0.06);
    let half = wheel.v();
    wheel.lab.run(0.24);
    [half, wheel.v(), wheel.q()]
}

/// Velocity after 1 s under a load.
fn creep(drive: DriveCfg, load: f64) -> f64 {
    let mut wheel = Wheel::on(weightless(), drive, hinge().dynamics(0.0, FRICTION), MOMENT);
    wheel.set_external_torque(load);
    wheel.lab.run(1.0);
    wheel.v()
}

#[test]
fn holds() {
    law(module_path!(), "v = v₀ - f t/I; way = I v₀²/2f", |m| {
        for (name, drive) in [("row", passive()), ("joint", DriveCfg { model: DriveModel::Actuator, ..passive() })] {
            let (found, smooth) = (stopping_motion(drive.clone(), FRICTION), stopping_motion(drive.clone(), 0.0));
            let of = |what: &str| format!("{what}, {name}");
            let slowed = START - FRICTION * 0.06 / MOMENT;
            m.row(&of("velocity after 60 ms"), "rad/s", slowed, found[0], (1e-9, "rounding of 60 sums"));
            m.row(&of("velocity after 0.3 s"), "rad/s", 0.0, found[1], (1e-9, "rounding"));
            let way = MOMENT * START * START / (2.0 * FRICTION) - 0.5e-3 * START;
            let left = 1e-4 * 1e-3 * FRICTION / MOMENT * 1e-3 + 100.0 * f64::EPSILON * way;
            m.row(&of("way to rest"), "rad", way, found[2], (left, "what the last step leaves"));
            let load = 0.5 * FRICTION;
            let creeps = 1e-4 * 1e-3 * load / MOMENT;
            m.row(&of("creep under half of it"), "rad/s", creeps, creep(drive.clone(), load), (1e-6 * creeps, "rest"));
            m.control(&of("velocity after 60 ms"), "without friction", smooth[0]);
            m.control(&of("velocity after 0.3 s"), "without friction", smooth[1]);
            m.control(&of("way to rest"), "without friction", smooth[2]);
            m.control(&of("creep under half of it"), "under 60 % of it", creep(drive, 0.6 * FRICTION));
        }
    });
}

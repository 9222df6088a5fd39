//! Viscous drag: m v' = -m g - c v. MuJoCo's Euler evaluates damping at the end of the step: v(n+1) = (v(n) - g h)/(1 +
//! h c/m), so v(n) = -(m g/c) (1 - (1 + h c/m)^-n), with the same limit m g/c as continuous time.
//!
//! Tolerance: rounding; e^-25 of the limit is missing at the end.

use crate::lab::*;

const MASS: f64 = 0.4;
const DRAG: f64 = 1.0;

fn falling(linear_damping: f64, seconds: f64) -> f64 {
    let mut lab = Lab::new(earth());
    let cfg = RigidObjectCfg { mass: Some(MASS), linear_damping, ..RigidObjectCfg::default() };
    let id = lab.object(cfg);
    lab.run(seconds);
    lab.body(id).velocity.z
}

#[test]
fn holds() {
    law(module_path!(), "v(n) = -(m g/c) (1 - (1 + h c/m)^-n) -> -m g/c", |m| {
        let limit = -MASS * G / DRAG;
        let after = |n: i32| limit * (1.0 - (1.0 + 1e-3 * DRAG / MASS).powi(-n));
        m.row("velocity after 0.3 s", "m/s", after(300), falling(DRAG, 0.3), (1e-11, "rounding of 300 divisions"));
        m.row("velocity after 10 s", "m/s", limit, falling(DRAG, 10.0), (1e-9, "e^-25 of it is missing"));
        m.control("velocity after 0.3 s", "without drag", falling(0.0, 0.3));
        m.control("velocity after 10 s", "without drag", falling(0.0, 10.0));
    });
}

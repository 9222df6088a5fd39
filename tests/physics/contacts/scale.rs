//! A load on a scale of stiffness k weighs m g: the contact carries it, and the scale, of mass M, sinks by (m + M) g/k,
//! with that effort. In an elevator accelerated by a force F the load weighs m F/(m + M).
//!
//! Tolerance: with critical damping of scale and contacts, e^-90 of the motion is left after 2 s; of the solver, 1e-6
//! of the weight.

use crate::lab::*;
use kinetoscope_testkit::worlds::cube;

const PLATE: f64 = 2.0;
const MASS: f64 = 3.0;
const STIFFNESS: f64 = 1e4;

/// Force on the load and on the plate, effort of the scale, and its displacement.
fn scale_readings(mass: f64, drive: DriveCfg, force: f64) -> [f64; 4] {
    let mut lab = Lab::new(earth());
    let joint = Joint::slide("spring", ["base", "plate"], [0.0, 0.0, 1.0]);
    let text = urdf(&[base(), Link::brick("plate", PLATE, [0.6, 0.6, 0.05])], &[joint]);
    let scale = lab.robot(&text, RobotCfg { uid: "scale".into(), drive, ..RobotCfg::default() });
    lab.object(cube("load", 0.2, mass, [0.05, -0.02, 0.125]));
    let bodies = vec!["load".into(), "scale/plate".into()];
    let id = lab.sim.add_sensor("contact", ContactSensorCfg { bodies, ..ContactSensorCfg::default() }).unwrap();
    lab.set_joint_efforts(scale, &[force]);
    lab.run(2.0);
    let forces = lab.sim.sensor(id).unwrap().net_forces_w();
    let [load, plate] = [forces[(0, 0, 2)], forces[(0, 1, 2)]];
    [load, plate, lab.effort(scale)[0], -lab.q(scale)[0]]
}

#[test]
fn holds() {
    law(module_path!(), "N = m g = -N'; k x = (m + M) g; in a lift N = m F/(m + M)", |m| {
        let total = MASS + PLATE;
        let damping = 2.0 * (STIFFNESS * total).sqrt();
        let scale = implicit(STIFFNESS, damping);
        let (found, heavier) = (scale_readings(MASS, scale.clone(), 0.0), scale_readings(1.01 * MASS, scale, 0.0));
        let rows = [
            ("force on the load", "N", MASS * G),
            ("force on the plate", "N", -MASS * G),
            ("effort of the scale", "N", total * G),
            ("way of the scale", "m", total * G / STIFFNESS),
        ];
        for (k, (quantity, unit, expected)) in rows.into_iter().enumerate() {
            m.row(quantity, unit, expected, found[k], (1e-6 * expected.abs(), "tolerance of the solver"));
            m.control(quantity, "with 1 % more on it", heavier[k]);
        }
        let force = 60.0;
        let expected = MASS * force / total;
        let lifted = scale_readings(MASS, passive(), force)[0];
        m.row("force on the load in a lift", "N", expected, lifted, (1e-6 * expected, "tolerance of the solver"));
        m.control("force on the load in a lift", "in a stationary lift", found[0]);
    });
}

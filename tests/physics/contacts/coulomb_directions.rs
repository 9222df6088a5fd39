//! Friction opposes the motion and has the same magnitude in all directions: f = -μ N v/|v|. Elliptic cones satisfy
//! this. A pyramid with its edges along x and y is smaller between them: |f_x| + |f_y| <= μ N, which is μ N/√2 at 45°.
//!
//! A ball slides without spin. Its one contact moves with the ball along a straight line, because friction rotates the
//! ball only about the horizontal axis across that line. The ball slides for 2 v/(7 μ g); the law uses the first half.
//! The sum of friction over the sum of normal forces is therefore exact, even if the ball hops. (Corners of a plate,
//! which rotates slightly, would move in other directions than the plate.)
//!
//! Tolerance: rounding of one sum per step, each force to half a digit, and each force from a solver that adds some 20
//! numbers.

use crate::lab::*;
use kinetoscope::sim::FrictionCone;
use kinetoscope_testkit::worlds::ball;
use nalgebra::{Rotation2, Vector2};

const FRICTION: f64 = 0.3;
const SPEED: f64 = 4.0;
/// The ball slides for 0.388 s, and twice as long with half of the friction.
const STEPS: u32 = 194;

/// Rounding of the sums.
const ROUNDING: f64 = STEPS as f64 * 20.0 * f64::EPSILON / 2.0;

/// Ratio of friction to normal force, as a vector, for a ball that slides at this angle to x.
fn friction_ratio(angle: f64, cone: FrictionCone, coefficient: f64) -> Vector2<f64> {
    let mut lab = Lab::new(SimulationManagerCfg { cone, ..slope(0.0, coefficient) });
    let ball = lab.object(ball("ball", 0.2, 1.5, [0.0, 0.0, 0.2]));
    let id = lab.sim.add_sensor("contact", ContactSensorCfg::for_bodies("ball")).unwrap();
    lab.run(0.5);
    let way = Rotation2::new(angle) * Vector2::x();
    lab.write_velocity(ball, [SPEED * way.x, SPEED * way.y, 0.0], [0.0; 3]);
    let (mut friction, mut normal) = (Vector2::zeros(), 0.0);
    lab.run_with(STEPS, |_, sim| {
        let sensor = sim.sensor(id).unwrap();
        let force = sensor.friction_forces_w();
        friction += Vector2::new(force[(0, 0, 0)], force[(0, 0, 1)]);
        normal += sensor.net_forces_w()[(0, 0, 2)];
    });
    friction / normal
}

/// Components along the direction at this angle to x, and across it.
fn components(friction: Vector2<f64>, angle: f64) -> [f64; 2] {
    let way = Rotation2::new(angle) * Vector2::x();
    [friction.dot(&way), way.perp(&friction)]
}

#[test]
fn holds() {
    law(module_path!(), "f = -μ N v/|v|", |m| {
        let rounding = (ROUNDING, "rounding of sums");
        for degrees in [0.0_f64, 22.5, 45.0, 70.0] {
            let angle = degrees.to_radians();
            let [along, across] = components(friction_ratio(angle, FrictionCone::Elliptic, FRICTION), angle);
            let [weak, beside] = components(friction_ratio(angle + 0.1, FrictionCone::Elliptic, 0.5 * FRICTION), angle);
            m.row(&format!("along the motion, {degrees}°"), "", -FRICTION, along, rounding);
            m.control(&format!("along the motion, {degrees}°"), "with half the friction", weak);
            m.row(&format!("across the motion, {degrees}°"), "", 0.0, across, rounding);
            m.control(&format!("across the motion, {degrees}°"), "of a motion 0.1 rad beside", beside);
        }
        let skew = 22.5_f64.to_radians();
        let [between, skewed] = components(friction_ratio(skew, FrictionCone::Pyramidal, FRICTION), skew);
        m.control("along the motion, 22.5°", "with a pyramid", between);
        m.control("across the motion, 22.5°", "with a pyramid", skewed);
        let half = 45.0_f64.to_radians();
        let [edge, _] = components(friction_ratio(half, FrictionCone::Pyramidal, FRICTION), half);
        m.control("along the motion, 45°", "with a pyramid", edge);
        let least = -FRICTION / 2.0_f64.sqrt();
        m.row("along the motion, 45°, pyramid", "", least, edge, rounding);
        let [round, _] = components(friction_ratio(half, FrictionCone::Elliptic, FRICTION), half);
        m.control("along the motion, 45°, pyramid", "with a cone", round);
    });
}

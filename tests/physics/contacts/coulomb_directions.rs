//! Friction is against the motion, and as large in all directions: f = -μ N v/|v|. Elliptic cones do that. A pyramid
//! with its edges along x and y is smaller between them: |f_x| + |f_y| <= μ N, which is μ N/√2 at 45°.
//!
//! Tolerance: the size is exact at every contact and step. The corners of a plate that turns move in other directions than the
//! plate, by the angle of the spin's part of their velocity, and the plate leaves the direction in which it began: friction is
//! off by the largest of these angles across, and by half of its square along. Between the edges of a pyramid the part along
//! the diagonal is the same for all directions.

use crate::lab::*;
use crate::law::law;
use kinetoscope::prelude::*;
use kinetoscope::sim::Cone;
use nalgebra::{Rotation2, Vector2};

const FRICTION: f64 = 0.3;

/// Sums of floating point numbers: 400 steps of four contacts.
const ROUNDING: f64 = 1e-12;

/// Friction in parts of the normal force, of a plate that slides at this angle to x, and the largest angle between that
/// direction and the velocity of a corner \[rad\].
fn slid(angle: f64, cone: Cone, coefficient: f64) -> (Vector2<f64>, f64) {
    let mut lab = Lab::new(SimulationManagerCfg { cone, ..slope(0.0, coefficient) });
    let plate = lab.object(RigidObjectCfg {
        uid: "plate".into(),
        shape: ObjectShape::Box { size: [0.4, 0.4, 0.02] },
        mass: Some(1.5),
        init_pose: Pose::translation(0.0, 0.0, 0.01),
        ..RigidObjectCfg::default()
    });
    let id = lab.sim.add_sensor("contact", ContactSensorCfg::of("plate")).unwrap();
    lab.run(0.5);
    let way = Rotation2::new(angle) * Vector2::x();
    lab.write_velocity(plate, [2.0 * way.x, 2.0 * way.y, 0.0], [0.0; 3]);
    let (mut friction, mut normal, mut off) = (Vector2::zeros(), 0.0, 0.0_f64);
    lab.watch(400, |_, sim| {
        let plate = body(sim, plate);
        let velocity = plate.velocity.xy();
        // Lower corners are 0.2 √2 from the vertical axis and 0.01 below the middle.
        let corner = plate.spin.z.abs() * 0.2 * 2.0_f64.sqrt() + plate.spin.xy().norm() * 0.01;
        off = off.max((way.perp(&velocity).abs() + corner) / velocity.norm());
        let sensor = sim.sensor(id).unwrap();
        let force = sensor.friction_forces_w();
        friction += Vector2::new(force[(0, 0, 0)], force[(0, 0, 1)]);
        normal += sensor.net_forces_w()[(0, 0, 2)];
    });
    (friction / normal, off)
}

/// Parts along the direction at this angle to x, and across it.
fn parts(friction: Vector2<f64>, angle: f64) -> [f64; 2] {
    let way = Rotation2::new(angle) * Vector2::x();
    [friction.dot(&way), way.perp(&friction)]
}

#[test]
fn holds() {
    law(module_path!(), "f = -μ N v/|v|", |m| {
        for degrees in [0.0_f64, 22.5, 45.0, 70.0] {
            let angle = degrees.to_radians();
            let (friction, off) = slid(angle, Cone::Elliptic, FRICTION);
            let [along, across] = parts(friction, angle);
            let [weak, beside] = parts(slid(angle + 0.1, Cone::Elliptic, 0.5 * FRICTION).0, angle);
            let less = (FRICTION * off * off / 2.0 + ROUNDING, "corners move at an angle to the plate");
            m.row(&format!("along the motion, {degrees}°"), "", -FRICTION, along, less);
            m.control(&format!("along the motion, {degrees}°"), "with half the friction", weak);
            m.row(
                &format!("across the motion, {degrees}°"),
                "",
                0.0,
                across,
                (FRICTION * off + ROUNDING, "corners move at an angle to the plate"),
            );
            m.control(&format!("across the motion, {degrees}°"), "of a motion 0.1 rad beside", beside);
        }
        let skew = 22.5_f64.to_radians();
        let [between, skewed] = parts(slid(skew, Cone::Pyramidal, FRICTION).0, skew);
        m.control("along the motion, 22.5°", "with a pyramid", between);
        m.control("across the motion, 22.5°", "with a pyramid", skewed);
        let half = 45.0_f64.to_radians();
        let [edge, _] = parts(slid(half, Cone::Pyramidal, FRICTION).0, half);
        m.control("along the motion, 45°", "with a pyramid", edge);
        let least = -FRICTION / 2.0_f64.sqrt();
        m.row(
            "along the motion, 45°, pyramid",
            "",
            least,
            edge,
            (ROUNDING, "the same for all directions between two edges"),
        );
        let [round, _] = parts(slid(half, Cone::Elliptic, FRICTION).0, half);
        m.control("along the motion, 45°, pyramid", "with a cone", round);
    });
}

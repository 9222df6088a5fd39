//! Ranges to moving shapes. A ray along x passes at the height b over the center of a ball of radius R that approaches
//! along x: it measures x(t) - √(R² - b²), x(t) = D - v t. A ray toward the axis, at D, of a brick of edge a that
//! rotates with ω measures D - a/(2 cos φ), where φ is ω t modulo quarter turns, within 45°. A ray to a capsule that
//! rotates in a plane around D measures D - l/2 - R when its end faces the ray, and D - R after a quarter turn.
//!
//! Tolerance: motions without forces are exact. The ray targets have single precision in sizes and poses, 6e-8 of 3 m,
//! with several rounding errors: 1e-6 m.

use crate::lab::*;
use kinetoscope::sensors::ray::pattern::Custom;
use std::f64::consts::FRAC_PI_4;

const AWAY: f64 = 3.0;
const RADIUS: f64 = 0.3;
const OVER: f64 = 0.12;
const EDGE: f64 = 0.5;
const LENGTH: f64 = 0.8;
/// Positions of the three shapes along y \[m\].
const LANES: [f64; 3] = [0.0, 5.0, 10.0];

/// Ranges to ball, brick and capsule after `seconds`.
fn ranges(speed: f64, spin: f64, seconds: f64) -> [f64; 3] {
    let mut lab = Lab::new(weightless());
    let turned = nalgebra::UnitQuaternion::from_euler_angles(0.0, std::f64::consts::FRAC_PI_2, 0.0);
    let shapes = [
        ("ball", ObjectShape::Sphere { radius: RADIUS }, Pose::translation(AWAY, LANES[0], -OVER)),
        ("brick", ObjectShape::Box { size: [EDGE, EDGE, 0.4] }, Pose::translation(AWAY, LANES[1], 0.0)),
        (
            "rod",
            ObjectShape::Capsule { radius: RADIUS / 2.0, length: LENGTH },
            Pose::from_parts([AWAY, LANES[2], 0.0].into(), turned),
        ),
    ];
    let ids = shapes.map(|(uid, shape, init_pose)| {
        lab.object(RigidObjectCfg { uid: uid.into(), shape, init_pose, ..RigidObjectCfg::default() })
    });
    lab.write_velocity(ids[0], [-speed, 0.0, 0.0], [0.0; 3]);
    lab.write_velocity(ids[1], [0.0; 3], [0.0, 0.0, spin]);
    lab.write_velocity(ids[2], [0.0; 3], [0.0, 0.0, spin]);
    let starts = LANES.map(|y| [0.0, y, 0.0]).to_vec();
    let pattern = Custom { starts, directions: vec![[1.0, 0.0, 0.0]; 3] }.into();
    let rays = lab.sim.add_sensor("rays", RayCasterCfg { pattern, ..RayCasterCfg::default() }).unwrap();
    lab.run(seconds);
    let found = lab.sim.sensor(rays).unwrap().distances();
    std::array::from_fn(|k| found[(0, k)])
}

#[test]
fn holds() {
    law(module_path!(), "ball: D - v t - √(R² - b²); brick: D - a/(2 cos φ)", |m| {
        let (speed, spin) = (1.3, FRAC_PI_4);
        let single = (1e-6, "single precision of poses and sizes");
        let still = ranges(0.0, 0.0, 0.1);
        for seconds in [0.4, 0.7, 1.2, 2.0] {
            let found = ranges(speed, spin, seconds);
            let ball = AWAY - speed * seconds - (RADIUS * RADIUS - OVER * OVER).sqrt();
            let turn = spin * seconds;
            let face = turn - (turn / (2.0 * FRAC_PI_4)).round() * 2.0 * FRAC_PI_4;
            let brick = AWAY - EDGE / (2.0 * face.cos());
            let of = |what: &str| format!("range to the {what} after {seconds} s");
            m.row(&of("ball"), "m", ball, found[0], single);
            m.control(&of("ball"), "standing still", still[0]);
            m.row(&of("brick"), "m", brick, found[1], single);
            m.control(&of("brick"), "turning half as fast", ranges(speed, 0.5 * spin, seconds)[1]);
        }
        let quarter = ranges(0.0, spin, 2.0)[2];
        m.row("range to the end of the rod", "m", AWAY - LENGTH / 2.0 - RADIUS / 2.0, still[2], single);
        m.row("range to its side after a quarter turn", "m", AWAY - RADIUS / 2.0, quarter, single);
        m.control("range to the end of the rod", "after a quarter turn", quarter);
        m.control("range to its side after a quarter turn", "standing still", still[2]);
    });
}

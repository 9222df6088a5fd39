//! A pendulum that swings by 90° to each side: T = 4 K(sin θ₀/2) √(I/(m g l)), where K is the complete elliptic
//! integral.
//!
//! Tolerance: RK4's (ω h)⁴ per radian is 1e-11 of the period. The zero crossings are linearly interpolated where the
//! acceleration is 0, with an error below h³. In total 1e-9 of the period.

use crate::lab::*;
use crate::rigid_body::dzhanibekov::complete_elliptic;

const LENGTH: f64 = 1.0;

/// Period \[s\] of a point mass that starts at rest at `angle`, from its passages of the lowest point.
fn period(cfg: SimulationManagerCfg, angle: f64) -> f64 {
    let mut lab = Lab::new(cfg);
    let joint = Joint::hinge("pivot", ["base", "bob"], [0.0, 1.0, 0.0]);
    let robot = lab.mechanism(&urdf(&[base(), Link::point("bob", 1.0, [0.0, 0.0, -LENGTH])], &[joint]));
    lab.write_joints(robot, &[angle], &[0.0]);
    let steps = (8.0 / lab.dt()).round() as u32;
    lab.period(robot, steps)
}

#[test]
fn holds() {
    law(module_path!(), "T = 4 K(sin θ₀/2) √(I/(m g l))", |m| {
        for degrees in [10.0_f64, 90.0, 150.0] {
            let angle = degrees.to_radians();
            let pendulum = ((LENGTH * LENGTH + POINT_MOMENT) / (G * LENGTH)).sqrt();
            let expected = 4.0 * complete_elliptic((0.5 * angle).sin()) * pendulum;
            let quantity = format!("period at {degrees}°");
            let found = period(rk4(earth()), angle);
            m.row(&quantity, "s", expected, found, (1e-9 * expected, "RK4 and crossings off straight lines"));
            m.control(&quantity, "at an angle 1 % smaller", period(rk4(earth()), 0.99 * angle));
        }
    });
}

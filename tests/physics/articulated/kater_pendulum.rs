//! Kater's pendulum: a body suspended at l from its center of mass swings with the same period as suspended at k²/l on
//! the other side, where k is its radius of gyration. The period is that of a point mass at l + k²/l. I = m (k² + l²),
//! and I/(m l) is symmetric in l and k²/l.
//!
//! Tolerance: as for `pendulum_period`, 1e-9 of the period.

use crate::lab::*;
use crate::rigid_body::dzhanibekov::complete_elliptic;

const MASS: f64 = 2.0;
const GYRATION: f64 = 0.3;
const NEAR: f64 = 0.2;
const ANGLE: f64 = 0.5;

/// Period of the pendulum suspended at `length` from its center of mass.
fn period(length: f64) -> f64 {
    let mut lab = Lab::new(rk4(earth()));
    let moment = MASS * GYRATION * GYRATION;
    let body = Link::new("body", MASS, [moment, moment, 0.01]).at([0.0, 0.0, -length]);
    let robot = lab.mechanism(&urdf(&[base(), body], &[Joint::hinge("pivot", ["base", "body"], [0.0, 1.0, 0.0])]));
    lab.write_joints(robot, &[ANGLE], &[0.0]);
    lab.period(robot, 5_000)
}

#[test]
fn holds() {
    law(module_path!(), "T(l) = T(k²/l) = 4 K(sin θ₀/2) √((l + k²/l)/g)", |m| {
        let far = GYRATION * GYRATION / NEAR;
        let expected = 4.0 * complete_elliptic((0.5 * ANGLE).sin()) * ((NEAR + far) / G).sqrt();
        let order = (1e-9 * expected, "RK4 and crossings off straight lines");
        for (name, length) in [("near pivot", NEAR), ("far pivot", far)] {
            let quantity = format!("period at the {name}");
            m.row(&quantity, "s", expected, period(length), order);
            m.control(&quantity, "with the pivot 1 % farther", period(1.01 * length));
        }
    });
}

//! Mechanical similarity: a pendulum three times as long swings √3 times as slowly (Landau, Lifshitz, Mechanics, § 10).
//! With a step √3 times as long, Euler's recursion has the same numbers: h² g/L is unchanged, and velocities are scaled
//! by 1/√3.
//!
//! Tolerance: rounding, 2000 steps; 1e-10. Control: the same step for both.

use crate::lab::*;

/// Angle and velocity after 2000 steps.
fn final_state(length: f64, dt: f64) -> [f64; 2] {
    let mut lab = Lab::new(with_dt(dt, earth()));
    let joint = Joint::hinge("pivot", ["base", "rod"], [0.0, 1.0, 0.0]);
    let moment = length * length / 12.0;
    let rod = Link::new("rod", 1.0, [moment, moment, 1e-3 * moment]).at([0.0, 0.0, -length / 2.0]);
    let robot = lab.mechanism(&urdf(&[base(), rod], &[joint]));
    lab.write_joints(robot, &[1.1], &[0.0]);
    lab.sim.update(2000);
    assert_healthy(&lab.sim);
    [lab.q(robot)[0], lab.v(robot)[0]]
}

#[test]
fn holds() {
    law(module_path!(), "q(3 L, √3 t) = q(L, t), q̇(3 L, √3 t) = q̇(L, t)/√3", |m| {
        let root = 3.0_f64.sqrt();
        let ([q, v], [long_q, long_v]) = (final_state(0.6, 1e-3), final_state(1.8, root * 1e-3));
        let rounding = (1e-10, "rounding of 2000 steps");
        m.row("angle of the long one", "rad", q, long_q, rounding);
        m.row("velocity of the long one", "rad/s", v / root, long_v, rounding);
        let [same_q, same_v] = final_state(1.8, 1e-3);
        m.control("angle of the long one", "at the same time", same_q);
        m.control("velocity of the long one", "at the same time", same_v);
    });
}

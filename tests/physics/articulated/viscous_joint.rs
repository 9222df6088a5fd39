//! A wheel with viscous damping: I ω' = -c ω. MuJoCo's Euler evaluates the damping at the end of the step, ω(n+1) =
//! ω(n)/(1 + h c/I), so that ω(n) = ω₀ (1 + h c/I)^-n, which converges to ω₀ e^(-c t/I) with the step.
//!
//! Tolerance: rounding of 1000 divisions.

use crate::lab::*;

const MOMENT: f64 = 0.05;
const DAMPING: f64 = 0.1;
const START: f64 = 7.0;

/// Angular velocity after a second.
fn final_velocity(damping: f64) -> f64 {
    let joint = Joint::hinge("bearing", ["base", "wheel"], [0.0, 0.0, 1.0]).dynamics(damping, 0.0);
    let mut lab = Lab::new(earth());
    let robot = lab.mechanism(&urdf(&[base(), Link::new("wheel", 1.0, [MOMENT; 3])], &[joint]));
    lab.write_joints(robot, &[0.0], &[START]);
    lab.run(1.0);
    lab.v(robot)[0]
}

#[test]
fn holds() {
    law(module_path!(), "ω = ω₀ (1 + h c/I)^(-t/h)", |m| {
        let found = final_velocity(DAMPING);
        let stepped = START * (1.0 + 1e-3 * DAMPING / MOMENT).powi(-1000);
        m.row("angular velocity after 1 s", "rad/s", stepped, found, (1e-11, "rounding of 1000 divisions"));
        m.control("angular velocity after 1 s", "without oil", final_velocity(0.0));
    });
}

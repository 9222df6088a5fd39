//! Two wheels, the second coupled with the ratio n to the first: an effort τ on the first acts on the inertia I₁ + n²
//! I₂.
//!
//! Tolerance: as for `atwood_machine`, the compliance of the coupling affects positions and not velocities. Rounding of
//! 500 sums: 1e-12.

use crate::lab::*;

const MOMENTS: [f64; 2] = [0.2, 0.05];
const RATIO: f64 = -3.0;
const EFFORT: f64 = 1.3;

/// Velocities of both wheels after half a second.
fn velocities(coupled: bool) -> [f64; 2] {
    let wheel = |name, moment| Link::new(name, 1.0, [moment; 3]);
    let z = [0.0, 0.0, 1.0];
    let second = Joint::hinge("second_joint", ["base", "second"], z).at([0.5, 0.0, 0.0]);
    let second = if coupled { second.mimic("first_joint", RATIO) } else { second };
    let mut lab = Lab::new(weightless());
    let links = [base(), wheel("first", MOMENTS[0]), wheel("second", MOMENTS[1])];
    let robot = lab.mechanism(&urdf(&links, &[Joint::hinge("first_joint", ["base", "first"], z), second]));
    lab.set_joint_efforts(robot, &[EFFORT, 0.0]);
    lab.run(0.5);
    let v = lab.v(robot);
    [v[0], v[1]]
}

#[test]
fn holds() {
    law(module_path!(), "τ = (I₁ + n² I₂) q̈", |m| {
        let ([first, second], [alone, idle]) = (velocities(true), velocities(false));
        let speed = 0.5 * EFFORT / (MOMENTS[0] + RATIO * RATIO * MOMENTS[1]);
        let rounding = (1e-12, "rounding of 500 steps");
        m.row("velocity of the first wheel after 0.5 s", "rad/s", speed, first, rounding);
        m.row("velocity of the second wheel after 0.5 s", "rad/s", RATIO * speed, second, rounding);
        m.control("velocity of the first wheel after 0.5 s", "without the gear", alone);
        m.control("velocity of the second wheel after 0.5 s", "without the gear", idle);
    });
}

//! A ball starts with v₀ and no spin. Friction slows it and spins it up until it rolls. The angular momentum about a
//! point of the ground is conserved: m v₀ r = m v r + 2/5 m r² v/r, so v = 5/7 v₀ at the end for any friction. It
//! slides for t = 2 v₀/(7 μ g).
//!
//! Tolerance: the contact point is half of the depth above the ground's plane and closer to the center, as in
//! `rolling_sphere`: v₀ δ/2r. During sliding, MuJoCo's elliptic cones treat a contact that slips with v as if it were μ
//! B v deeper, so that the ball hops slightly before it settles. The friction is μ times the normal force at every
//! step, and the mean of the normal force is m (g + c), with the mean upward acceleration c (law `sliding_block`), up
//! to the solver's tolerance.

use super::sliding_block::SOLVER;
use super::soft_contact::depth;
use crate::lab::*;

const RADIUS: f64 = 0.5;
const START: f64 = 1.0;
const FRICTION: f64 = 0.1;

/// Mean deceleration from 0.1 s to 0.2 s, mean upward acceleration in that time, and the velocity after 1 s.
fn roll_out(friction: f64) -> [f64; 3] {
    let mut lab = Lab::new(slope(0.0, friction));
    let robot = lab.free(&urdf(&[Link::ball("ball", 3.0, RADIUS)], &[]), [0.0, 0.0, RADIUS - depth(G)]);
    lab.write_root_velocity(robot, [START, 0.0, 0.0], [0.0; 3]);
    lab.run(0.1);
    let before = lab.root(robot).velocity;
    lab.run(0.1);
    let gained = (lab.root(robot).velocity - before) / 0.1;
    lab.run(0.8);
    [-gained.x, gained.z, lab.root(robot).velocity.x]
}

#[test]
fn holds() {
    law(module_path!(), "v' = -μ (g + c) until t = 2 v₀/(7 μ g), then v = 5/7 v₀", |m| {
        let arm = START * depth(G) / (2.0 * RADIUS);
        let ([slowed, risen, rolling], [_, _, rough], slippery) = (roll_out(FRICTION), roll_out(0.3), roll_out(0.0));
        let sliding = "deceleration while it slides, less μ c";
        m.row(sliding, "m/s²", FRICTION * G, slowed - FRICTION * risen, (SOLVER, "tolerance of the solver"));
        m.row("velocity in the end", "m/s", 5.0 / 7.0 * START, rolling, (arm, "the arm is half of the depth shorter"));
        m.row("velocity in the end, three times the friction", "m/s", 5.0 / 7.0 * START, rough, (arm, "as before"));
        m.control(sliding, "without friction", slippery[0] - FRICTION * slippery[1]);
        m.control("velocity in the end", "without friction", slippery[2]);
        m.control("velocity in the end, three times the friction", "without friction", slippery[2]);
    });
}

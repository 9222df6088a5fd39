//! A block slides down a slope that is steeper than its friction: a = g (sin θ - μ cos θ).
//!
//! Elliptic cones keep the friction at its limit, against the motion, at every step. Bodies on soft contacts hop: the
//! mean normal force N is m g cos θ plus the rate of the momentum perpendicular to the slope, and friction follows it.
//! With the means a along and c across the slope,
//!
//! ```text
//! a + μ c = g (sin θ - μ cos θ)
//! ```
//!
//! holds for any hops, and c vanishes with time.
//!
//! Tolerance: the solver's, 1e-8 of the cost of a step.
//!
//! Pyramids have four edges at every contact. The edge against the motion gives μ of its force as friction and is
//! pushed by B μ v. The two edges beside it give no friction and are pushed by K r, where r is the depth, at most the
//! depth δ at rest. Friction is thus low by at most 2 K δ/(B μ v), and by 2 K δ/(B μ) ln(v₂/v₁)/(v₂ - v₁) in the mean
//! between two velocities.

use super::incline::{Descent, FROM, UNTIL, descent};
use super::soft_contact::{MAX_IMPEDANCE, TIME_CONSTANT, depth};
use crate::lab::*;
use kinetoscope::sim::FrictionCone;

/// The solver stops when a step gains less than this \[m/s²\].
pub(crate) const SOLVER: f64 = 1e-6;

fn sliding(friction: f64, cone: FrictionCone) -> Descent {
    let cfg = SimulationManagerCfg { cone, ..slope(30.0_f64.to_radians(), friction) };
    descent(cfg, Link::brick("block", 1.2, [0.4, 0.4, 0.1]), Pose::translation(0.0, 0.0, 0.05))
}

/// Mean friction deficit of pyramids \[m/s²\] while the velocity grows from `a` [`FROM`] to `a` [`UNTIL`].
fn friction_deficit(friction: f64, a: f64, across_gravity: f64) -> f64 {
    let [stiffness, damping] = [1.0 / (MAX_IMPEDANCE * TIME_CONSTANT).powi(2), 2.0 / (MAX_IMPEDANCE * TIME_CONSTANT)];
    let at_one = 2.0 * stiffness * depth(across_gravity / 4.0) / (damping * friction);
    at_one * (UNTIL / FROM).ln() / (a * (UNTIL - FROM))
}

#[test]
fn holds() {
    law(module_path!(), "a + μ c = g (sin θ - μ cos θ)", |m| {
        const FRICTION: f64 = 0.3;
        let (sin, cos) = 30.0_f64.to_radians().sin_cos();
        let a = G * (sin - FRICTION * cos);
        let with_hops = |friction, cone| {
            let Descent { along, across } = sliding(friction, cone);
            along + FRICTION * across
        };
        let quantity = "a + μ c on 30°, elliptic cones";
        let elliptic = with_hops(FRICTION, FrictionCone::Elliptic);
        m.row(quantity, "m/s²", a, elliptic, (SOLVER, "tolerance of the solver"));
        m.control(quantity, "without friction", with_hops(0.0, FrictionCone::Elliptic));
        let quantity = "a + μ c on 30°, pyramids";
        let edges = FRICTION * G * cos * friction_deficit(FRICTION, a, G * cos) + SOLVER;
        m.row(quantity, "m/s²", a, with_hops(FRICTION, FrictionCone::Pyramidal), (edges, "edges beside the motion"));
        m.control(quantity, "with twice the friction", with_hops(0.6, FrictionCone::Pyramidal));
    });
}

//! A block slides down a slope that is steeper than its friction: a = g (sin θ - μ cos θ).
//!
//! Elliptic cones have the friction at its limit, against the motion, at every step. Soft contacts hop, so that the normal
//! force N is m g cos θ in the mean only up to the momentum that the block has gained away from the slope, and so is
//! the friction: with the means a along and c across,
//!
//! ```text
//! a + μ c = g (sin θ - μ cos θ)
//! ```
//!
//! holds for any hops, and c vanishes with the time.
//!
//! Tolerance: the solver's, 1e-8 of the cost of a step; and c itself, which is known, times μ.
//!
//! Pyramids have four edges at every contact; the one against the motion gives μ of its force as friction and is pushed by
//! B μ v, the two beside it give none and are pushed by K r, r being the depth, which is at most that at rest, δ. So friction
//! lacks at most 2 K δ/(B μ v), and 2 K δ/(B μ) ln(v₂/v₁)/(v₂ - v₁) in the mean between two velocities.

use super::incline::{Descent, FROM, UNTIL, descent};
use super::soft_contact::{LARGEST, TIME, depth};
use crate::lab::*;
use crate::law::law;
use crate::urdf::Link;
use kinetoscope::prelude::*;
use kinetoscope::sim::Cone;

/// The solver ends where a step gains less than this \[m/s²\].
const SOLVER: f64 = 1e-6;

fn sliding(friction: f64, cone: Cone) -> Descent {
    let cfg = SimulationManagerCfg { cone, ..slope(30.0_f64.to_radians(), friction) };
    descent(cfg, Link::brick("block", 1.2, [0.4, 0.4, 0.1]), Pose::translation(0.0, 0.0, 0.05))
}

/// What pyramids lack of friction, in the mean while the velocity goes from `a` [`FROM`] to `a` [`UNTIL`].
fn lacking(friction: f64, a: f64, across_gravity: f64) -> f64 {
    let [stiffness, damping] = [1.0 / (LARGEST * TIME).powi(2), 2.0 / (LARGEST * TIME)];
    let at_one = 2.0 * stiffness * depth(across_gravity / 4.0) / (damping * friction);
    at_one * (UNTIL / FROM).ln() / (a * (UNTIL - FROM))
}

#[test]
fn holds() {
    law(module_path!(), "a = g (sin θ - μ cos θ)", |m| {
        const FRICTION: f64 = 0.3;
        let (sin, cos) = 30.0_f64.to_radians().sin_cos();
        let a = G * (sin - FRICTION * cos);
        let elliptic = sliding(FRICTION, Cone::Elliptic);
        let hops = FRICTION * elliptic.across.abs();
        m.row("acceleration on 30°, elliptic cones", "m/s²", a, elliptic.along, (hops + SOLVER, "momentum of hops"));
        let with_hops = elliptic.along + FRICTION * elliptic.across;
        m.row("the same with the momentum of hops", "m/s²", a, with_hops, (SOLVER, "tolerance of the solver"));
        let none = sliding(0.0, Cone::Elliptic);
        m.control("acceleration on 30°, elliptic cones", "without friction", none.along);
        m.control("the same with the momentum of hops", "without friction", none.along + FRICTION * none.across);
        let pyramid = sliding(FRICTION, Cone::Pyramidal);
        let edges = FRICTION * (G * cos * lacking(FRICTION, a, G * cos) + pyramid.across.abs());
        m.row("acceleration on 30°, pyramids", "m/s²", a, pyramid.along, (edges, "edges beside the motion, and hops"));
        m.control("acceleration on 30°, pyramids", "with twice the friction", sliding(0.6, Cone::Pyramidal).along);
    });
}

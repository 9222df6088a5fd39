//! A block on a slope sticks for tan θ < μ and slides with a = g (sin θ - μ cos θ) for tan θ > μ: 5 % below and above.
//!
//! Below the threshold, soft friction creeps, by the law `stick_creep`. Above it, the momentum c of hops contributes,
//! as in `sliding_block`: a + μ c = g (sin θ - μ cos θ).
//!
//! Tolerance: below the threshold, h tan θ/w = 2.4 % of the load moves to the lower corners: (2.4 %)² of the creep; the
//! upper corners still carry enough to stick. Above it, the solver's tolerance.

use super::incline::{Descent, descent};
use super::sliding_block::SOLVER;
use super::stick_creep;
use crate::lab::*;

const FRICTION: f64 = 0.5;
const HEIGHT: f64 = 0.02;

fn block() -> Link {
    Link::brick("block", 1.2, [0.4, 0.4, HEIGHT])
}

/// Velocity after 2 s on a slope with tan θ = `part` times the friction.
fn velocity(part: f64, friction: f64) -> f64 {
    let mut lab = Lab::new(slope((part * FRICTION).atan(), friction));
    let robot = lab.free(&urdf(&[block()], &[]), [0.0, 0.0, 0.5 * HEIGHT]);
    lab.run(2.0);
    lab.root(robot).velocity.x
}

#[test]
fn holds() {
    law(module_path!(), "tan θ < μ: only creep; tan θ > μ: a + μ c = g (sin θ - μ cos θ)", |m| {
        let below = velocity(0.95, FRICTION);
        // Half the height over half the width, times tan θ.
        let tipping = 0.5 * HEIGHT * 0.95 * FRICTION / 0.2;
        let creep = stick_creep::expected((0.95 * FRICTION).atan(), IMPRATIO, tipping);
        let why = "(2.4 %)² of what goes to the lower corners";
        m.row("velocity at 0.95 μ", "m/s", creep, below, (tipping * tipping * creep, why));
        m.control("velocity at 0.95 μ", "with 10 % less friction", velocity(0.95, 0.9 * FRICTION));
        let angle = (1.05 * FRICTION).atan();
        let slides = |friction| descent(slope(angle, friction), block(), Pose::translation(0.0, 0.0, 0.5 * HEIGHT));
        let a = G * (angle.sin() - FRICTION * angle.cos());
        let with_hops = |Descent { along, across }| along + FRICTION * across;
        let quantity = "a + μ c at 1.05 μ";
        m.row(quantity, "m/s²", a, with_hops(slides(FRICTION)), (SOLVER, "tolerance of the solver"));
        m.control(quantity, "with 10 % more friction", with_hops(slides(1.1 * FRICTION)));
    });
}

//! A block on a slope stays where tan θ < μ and slides with a = g (sin θ - μ cos θ) where tan θ > μ: 5 % below and above.
//!
//! Tolerance: below, the creep of soft friction, 1e-5 m/s with impratio 100 (law `stick_creep`). Above, the momentum
//! of hops, as in `sliding_block`.

use super::incline::descent;
use crate::lab::*;
use crate::law::law;
use crate::urdf::{Link, urdf};
use kinetoscope::prelude::*;

const FRICTION: f64 = 0.5;

fn block() -> Link {
    Link::brick("block", 1.2, [0.4, 0.4, 0.05])
}

/// Velocity after 2 s where tan θ is `part` of the friction.
fn velocity(part: f64, friction: f64) -> f64 {
    let mut lab = Lab::new(slope((part * FRICTION).atan(), friction));
    let robot = lab.free(&urdf(&[block()], &[]), [0.0, 0.0, 0.025]);
    lab.run(2.0);
    lab.root(robot).velocity.x
}

#[test]
fn holds() {
    law(module_path!(), "tan θ < μ: v = 0; tan θ > μ: a = g (sin θ - μ cos θ)", |m| {
        let below = velocity(0.95, FRICTION);
        m.row("velocity at 0.95 μ", "m/s", 0.0, below, (1e-4, "creep of soft friction"));
        m.control("velocity at 0.95 μ", "with 10 % less friction", velocity(0.95, 0.9 * FRICTION));
        let angle = (1.05 * FRICTION).atan();
        let slides = |friction| descent(slope(angle, friction), block(), Pose::translation(0.0, 0.0, 0.025));
        let a = G * (angle.sin() - FRICTION * angle.cos());
        let slid = slides(FRICTION);
        let hops = (FRICTION * slid.across.abs() + 1e-6, "momentum of hops, tolerance of the solver");
        m.row("acceleration at 1.05 μ", "m/s²", a, slid.along, hops);
        m.control("acceleration at 1.05 μ", "with 10 % more friction", slides(1.1 * FRICTION).along);
    });
}

//! Sticking bodies creep: MuJoCo's friction is a damper. A friction row holds with `R f = -B v` at rest, with `R = (1 -
//! d)/d A/impratio` and `B = 2/(dmax tc)`. A flat block on four corners has f = m g sin θ/4 in each and A = 1/m:
//!
//! ```text
//! v = (1 - d)/d g sin θ/4 dmax tc/(2 impratio),   d of the depth under m g cos θ/4
//! ```
//!
//! Tolerance: friction at the base tips the block, so that h tan θ/w = 1 % of the load moves to the lower corners. This
//! changes their d in one direction and that of the upper corners in the other: (1 %)² of the creep remains. The law
//! checks that creep occurs, its magnitude, and that impratio divides it.

use super::soft_contact::{MAX_IMPEDANCE, TIME_CONSTANT, depth, impedance};
use crate::lab::*;

const ANGLE: f64 = 10.0;

fn creep(impratio: f64) -> f64 {
    let mut lab = Lab::new(SimulationManagerCfg { impratio, ..slope(ANGLE.to_radians(), 1.0) });
    let robot = lab.free(&urdf(&[Link::brick("block", 1.2, [0.4, 0.4, 0.02])], &[]), [0.0, 0.0, 0.01]);
    lab.run(2.0);
    lab.root(robot).velocity.x
}

/// Creep velocity of a flat block on a slope of this angle \[rad\]. The lower corners carry the fraction `tipping` of
/// their load more and the upper ones as much less; the corners act as parallel dampers.
pub(super) fn expected(angle: f64, impratio: f64, tipping: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    let damping = |load: f64| {
        let d = impedance(depth(load * G * cos / 4.0));
        d / (1.0 - d)
    };
    let damping = 0.5 * (damping(1.0 - tipping) + damping(1.0 + tipping));
    G * sin / 4.0 / damping * MAX_IMPEDANCE * TIME_CONSTANT / (2.0 * impratio)
}

#[test]
fn holds() {
    law(module_path!(), "v = (1 - d)/d g sin θ/4 dmax tc/(2 impratio)", |m| {
        let v = expected(ANGLE.to_radians(), 1.0, 0.0);
        for impratio in [1.0, 10.0, 100.0] {
            let quantity = format!("creep on 10°, impratio {impratio}");
            let tipping = (1e-4 * v / impratio, "(1 %)² of what goes to the lower corners");
            m.row(&quantity, "m/s", v / impratio, creep(impratio), tipping);
            m.control(&quantity, "with an impratio twice as large", creep(2.0 * impratio));
        }
    });
}

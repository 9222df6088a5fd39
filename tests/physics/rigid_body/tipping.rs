//! A block on a slope with high friction stands while its weight is above its base, tan θ < w/h, and tips over beyond:
//! 5 % below and above. After tipping it lies on its long side, rotated by a quarter turn.
//!
//! Tolerance: for the standing block, the lower edge sinks in deeper than the upper one, at most by the depth under the
//! whole weight on its two corners, over the width of 0.2 m. For the lying block it is the same on a longer side.

use super::soft_contact::depth;
use crate::lab::*;
use std::f64::consts::FRAC_PI_2;

/// The rotation after 4 s \[rad\].
fn rotation(part: f64, height: f64) -> f64 {
    let mut lab = Lab::new(slope((part * 0.5_f64).atan(), 3.0));
    let block = Link::brick("block", 2.0, [0.2, 0.3, height]);
    let robot = lab.free(&urdf(&[block], &[]), [0.0, 0.0, height / 2.0]);
    lab.run(4.0);
    lab.root(robot).rotation.angle()
}

#[test]
fn holds() {
    law(module_path!(), "tan θ < w/h: stands; tan θ > w/h: tips by π/2", |m| {
        let edges = (depth(G / 2.0) / 0.2, "the depth of an edge under all of the weight");
        m.row("turn at 0.95 w/h", "rad", 0.0, rotation(0.95, 0.4), edges);
        m.row("turn at 1.05 w/h", "rad", FRAC_PI_2, rotation(1.05, 0.4), edges);
        m.control("turn at 0.95 w/h", "with a block 10 % higher", rotation(0.95, 0.44));
        m.control("turn at 1.05 w/h", "with a block 10 % lower", rotation(1.05, 0.36));
    });
}

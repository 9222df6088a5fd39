//! A ball at rest sinks in by r = (1 - d)/d² g dmax² tc² for any mass, where d is the impedance at that depth
//! ([`soft_contact`](super::soft_contact)).
//!
//! Tolerance: a fixed point of arithmetic, compared with a simulation in which e^-100 of the motion is left after 2 s:
//! 1e-8 of the depth.

use super::soft_contact::depth;
use crate::lab::*;

const RADIUS: f64 = 0.1;

fn sunk(mass: f64, gravity: f64) -> f64 {
    let mut lab = Lab::new(SimulationManagerCfg { gravity: Vector3::new(0.0, 0.0, -gravity), ..slope(0.0, 1.0) });
    let robot = lab.free(&urdf(&[Link::ball("ball", mass, RADIUS)], &[]), [0.0, 0.0, RADIUS]);
    lab.run(2.0);
    RADIUS - lab.root(robot).position.z
}

#[test]
fn holds() {
    law(module_path!(), "r = (1 - d(r))/d(r)² g dmax² tc²", |m| {
        for (where_, gravity) in [("on earth", G), ("on the moon", 1.62), ("on Jupiter", 24.79)] {
            let expected = depth(gravity);
            let quantity = format!("depth {where_}");
            m.row(&quantity, "m", expected, sunk(1.0, gravity), (1e-8 * expected, "what is left of the motion"));
            m.control(&quantity, "with 1 % more gravity", sunk(1.0, 1.01 * gravity));
        }
        let heavy = sunk(50.0, G);
        m.row("depth of 50 kg", "m", depth(G), heavy, (1e-8 * depth(G), "what is left of the motion"));
        m.control("depth of 50 kg", "without gravity", sunk(50.0, 0.0));
    });
}

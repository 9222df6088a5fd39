//! A table on four legs at (±a, ±b) with a load W' at (x, y) on it. The lever rule gives the sum of two legs on one
//! side: (W + W')/2 ± W' x/2a, and ± W' y/2b. The distribution between them depends on their compliance: equally soft
//! legs under a stiff table have planar forces, W/4 + W'/4 (1 ± x/a ± y/b).
//!
//! Tolerance: the table sinks by 0.1 mm on one side, which tilts it by 0.1 mrad and shifts its load by 0.1 mm of 0.4 m:
//! 5e-4. The depth grows slightly slower than the force (d = 0.9 to 0.91 in `soft_contact`), by 2 %, which applies to
//! the asymmetric part.

use crate::lab::*;
use kinetoscope_testkit::worlds::cube;

const TABLE: f64 = 6.0;
const LEG: f64 = 0.5;
const LOAD: f64 = 4.0;
const HALF: [f64; 2] = [0.4, 0.25];
const AT: [f64; 2] = [0.22, -0.08];
const HEIGHT: f64 = 0.3;

/// Signs of the legs' x and y coordinates.
const SIDES: [[f64; 2]; 4] = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];

/// Upward forces on the four legs.
fn legs(load: f64, at: [f64; 2]) -> [f64; 4] {
    let mut links = vec![Link::brick("top", TABLE, [1.0, 0.7, 0.04])];
    let mut joints = Vec::new();
    for (k, side) in SIDES.iter().enumerate() {
        let name = format!("leg{k}");
        links.push(Link::ball(&name, LEG, 0.03));
        let place = [side[0] * HALF[0], side[1] * HALF[1], 0.03 - HEIGHT];
        joints.push(Joint::fixed(&format!("glue{k}"), ["top", &name]).at(place));
    }
    let mut lab = Lab::new(slope(0.0, 1.0));
    lab.free(&urdf(&links, &joints), [0.0, 0.0, HEIGHT]);
    lab.object(cube("load", 0.1, load, [at[0], at[1], HEIGHT + 0.02 + 0.05]));
    let bodies = (0..4).map(|k| format!("leg{k}")).collect();
    let id = lab.sim.add_sensor("scales", ContactSensorCfg { bodies, ..ContactSensorCfg::default() }).unwrap();
    lab.run(3.0);
    let forces = lab.sim.sensor(id).unwrap().net_forces_w();
    std::array::from_fn(|k| forces[(0, k, 2)])
}

#[test]
fn holds() {
    law(module_path!(), "two legs: (W + W')/2 ± W' x/2a; one: W/4 + W'/4 (1 ± x/a ± y/b)", |m| {
        let (found, moved) = (legs(LOAD, AT), legs(LOAD, [0.9 * AT[0], 0.8 * AT[1]]));
        let (heavier, bare) = (legs(1.01 * LOAD, AT), legs(1e-3, AT));
        let (own, load) = ((TABLE + 4.0 * LEG) * G, LOAD * G);
        let share = |k: usize| SIDES[k][0] * AT[0] / HALF[0] + SIDES[k][1] * AT[1] / HALF[1];
        let pair = |forces: &[f64; 4], axis: usize| -> f64 {
            (0..4).filter(|k| SIDES[*k][axis] > 0.0).map(|k| forces[k]).sum()
        };
        let tilt = (5e-4 * (own + load), "the table tilts by 0.1 mrad");
        for (axis, name) in ["front", "left"].into_iter().enumerate() {
            let quantity = format!("both {name} legs");
            let expected = (own + load) / 2.0 + load * AT[axis] / (2.0 * HALF[axis]);
            m.row(&quantity, "N", expected, pair(&found, axis), tilt);
            m.control(&quantity, "with the load nearer to the middle", pair(&moved, axis));
        }
        m.row("all legs", "N", own + load, found.iter().sum(), (1e-6 * (own + load), "tolerance of the solver"));
        m.control("all legs", "with 1 % more on it", heavier.iter().sum());
        for (k, name) in ["front left", "front right", "back left", "back right"].into_iter().enumerate() {
            let quantity = format!("{name} leg");
            let expected = own / 4.0 + load / 4.0 * (1.0 + share(k));
            m.row(&quantity, "N", expected, found[k], (0.02 * load / 4.0, "softer where more is carried, 2 %"));
            m.control(&quantity, "without the load", bare[k]);
        }
    });
}

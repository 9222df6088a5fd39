//! A free rod is struck at one end. The impulse P moves its center with P/m and rotates it with P (L/2)/(m L²/12). The
//! velocity at x from the center, with the strike at -L/2, is P/m (1 - 6 x/L). At two thirds of the rod from the
//! strike, x = L/6, the velocity is zero: the center of percussion. The struck end moves with 4 P/m.
//!
//! Tolerance: rounding of one step.

use crate::lab::*;

const LENGTH: f64 = 1.2;
const MASS: f64 = 0.5;
const FORCE: f64 = 300.0;

/// Velocities across the rod at the struck end and at two thirds of it; both points are frames of fixed links.
fn velocities(off_center: bool) -> [f64; 2] {
    let moment = MASS * LENGTH * LENGTH / 12.0;
    let mut lab = Lab::new(weightless());
    let frame = |name| Link::new(name, 0.0, [0.0; 3]);
    let links = [Link::new("rod", MASS, [1e-6, moment, moment]), frame("end"), frame("percussion")];
    let at = |name, child, x| Joint::fixed(name, ["rod", child]).at([x, 0.0, 0.0]).turned([0.0, 0.0, 0.3]);
    let joints = [at("a", "end", -LENGTH / 2.0), at("b", "percussion", LENGTH / 6.0)];
    let robot = lab.free(&urdf(&links, &joints), [1.0, 2.0, 3.0]);
    let torque = if off_center { -FORCE * LENGTH / 2.0 } else { 0.0 };
    lab.set_link_wrench(robot, "rod", Vector3::new(0.0, FORCE, 0.0), Vector3::new(0.0, 0.0, torque));
    lab.run(1e-3);
    // The rod has rotated by 2.5e-3 rad: world velocities of its points are transformed to its axes.
    ["end", "percussion"].map(|link| {
        let v = lab.sim.robot(robot).link_velocity(link).unwrap();
        let turned = lab.root(robot).rotation.inverse() * Vector3::new(v[(0, 0)], v[(0, 1)], v[(0, 2)]);
        turned.y
    })
}

#[test]
fn holds() {
    law(module_path!(), "v(x) = P/m (1 - 6 x/L): 4 P/m at the struck end, 0 at 2 L/3 from it", |m| {
        let [end, percussion] = velocities(true);
        let central = velocities(false);
        let impulse = FORCE * 1e-3;
        // The axes have rotated by ω h = 2.5 mrad since the velocity was P/m along the old y, which adds a cosine.
        let spin = impulse * (LENGTH / 2.0) / (MASS * LENGTH * LENGTH / 12.0);
        let cosine = (spin * 1e-3).cos();
        let rounding = (1e-12, "rounding of one step");
        let (of_center, of_turn) = (impulse / MASS * cosine, spin);
        m.row("velocity of the struck end", "m/s", of_center + of_turn * LENGTH / 2.0, end, rounding);
        m.row("velocity at 2 L/3", "m/s", of_center - of_turn * LENGTH / 6.0, percussion, rounding);
        m.control("velocity of the struck end", "struck in the middle", central[0]);
        m.control("velocity at 2 L/3", "struck in the middle", central[1]);
    });
}

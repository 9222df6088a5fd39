//! A double pendulum of two rods falls from the horizontal: its energy, counted by the judge from the URDF, stays.
//!
//! Tolerance: RK4 is off by (ω h)⁴/120 per radian, at up to 15 rad/s and 1 ms 4e-10 of the energy; of some 50 rad in 5 s
//! half are as fast: 1e-8 of the 20 J that fall, 2e-7 J. Euler is off by ω h/2.

use super::newton_euler::{Motion, Tree, joints};
use super::subjects::EARTH;
use crate::lab::*;
use crate::law::{law, worse};
use crate::urdf::{Joint, Link, base, urdf};
use kinetoscope::prelude::*;

/// Two rods of 1 kg and 1 m.
pub(crate) fn text() -> String {
    let rod = |name| Link::new(name, 1.0, [1.0 / 12.0, 1.0 / 12.0, 1e-3]).at([0.0, 0.0, -0.5]);
    let upper = Joint::hinge("upper", ["base", "a"], [0.0, 1.0, 0.0]);
    let lower = Joint::hinge("lower", ["a", "b"], [0.0, 1.0, 0.0]).at([0.0, 0.0, -1.0]);
    urdf(&[base(), rod("a"), rod("b")], &[upper, lower])
}

/// Largest change of the energy in 5 s \[J\], and the change over time.
fn change(cfg: SimulationManagerCfg) -> (f64, Vec<[f64; 2]>) {
    let mut lab = Lab::new(cfg);
    let robot = lab.mechanism(&text());
    let tree = Tree::parse(&text());
    lab.write_joints(robot, &[std::f64::consts::FRAC_PI_2, 0.0], &[0.0, 0.0]);
    let energy = |sim: &SimulationManager| {
        let robot = sim.robot(robot);
        let (q, v) = (robot.get_qpos().row(0).to_vec(), robot.get_qvel().row(0).to_vec());
        tree.energy(&joints(robot.joint_names(), &q, &v, &[0.0; 2]), Motion::rest(EARTH), EARTH)
    };
    let start = energy(&lab.sim);
    let (mut worst, mut curve) = (0.0_f64, Vec::new());
    lab.watch(5_000, |t, sim| {
        let change = (energy(sim) - start).abs();
        worst = worse(worst, change);
        if ((t * 1e3).round() as u32).is_multiple_of(20) {
            curve.push([t, change.max(1e-12)]);
        }
    });
    (worst, curve)
}

#[test]
fn holds() {
    law(module_path!(), "T + V = const", |m| {
        let ((by_rk4, curve), (by_euler, euler)) = (change(rk4(earth())), change(earth()));
        m.row("largest change of the energy in 5 s", "J", 0.0, by_rk4, (2e-7, "1e-8 of the 20 J that fall"));
        m.control("largest change of the energy in 5 s", "with Euler", by_euler);
        let axes = ["time [s]", "change of the energy [J]"];
        m.plot("Double pendulum, h = 1 ms", axes, true, &[("RK4", curve), ("Euler", euler)]);
    });
}

//! A double pendulum of two rods falls from the horizontal: its energy, computed by the reference from the URDF, is
//! conserved.
//!
//! Tolerance: the energy change of an RK4 step is known from explicit steps of the rods
//! ([`double_pendulum`](crate::numerical::double_pendulum)). The bound adds all 5000 steps with the same sign, and
//! rounding of half a digit of each state variable in each step. Control: Euler.

use super::newton_euler::{Motion, Tree, joints};
use super::test_robots::EARTH;
use crate::lab::*;
use crate::numerical::double_pendulum::{Method, RodState};
use std::f64::consts::FRAC_PI_2;

const START: ([f64; 2], [f64; 2]) = ([FRAC_PI_2, 0.0], [0.0, 0.0]);
const STEPS: u32 = 5_000;

/// URDF of two rods of 1 kg and 1 m.
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
    lab.write_joints(robot, &START.0, &START.1);
    let energy = |sim: &SimulationManager| {
        let robot = sim.robot(robot);
        let (q, v) = (robot.qpos().row(0).to_vec(), robot.qvel().row(0).to_vec());
        tree.energy(&joints(robot.joint_names(), &q, &v, &[0.0; 2]), Motion::rest(EARTH), EARTH)
    };
    let start = energy(&lab.sim);
    let (mut worst, mut curve) = (0.0_f64, Vec::new());
    lab.run_with(STEPS, |t, sim| {
        let change = (energy(sim) - start).abs();
        worst = max_or_nan(worst, change);
        if ((t * 1e3).round() as u32).is_multiple_of(20) {
            curve.push([t, change.max(1e-12)]);
        }
    });
    (worst, curve)
}

/// Largest energy change of the rods over as many steps \[J\]: explicit RK4 steps, and rounding.
fn bound() -> f64 {
    let mut rods = RodState::from_joints(START.0, START.1);
    let mut bound = 0.0;
    for _ in 0..STEPS {
        let next = rods.step(Method::RungeKutta, 1e-3);
        bound += (next.energy() - rods.energy()).abs() + next.rounding_of_energy();
        rods = next;
    }
    bound
}

#[test]
fn holds() {
    law(module_path!(), "T + V = const", |m| {
        let ((by_rk4, curve), (by_euler, euler)) = (change(rk4(earth())), change(earth()));
        m.row("largest change of the energy in 5 s", "J", 0.0, by_rk4, (bound(), "what the steps of RK4 change it by"));
        m.control("largest change of the energy in 5 s", "with Euler", by_euler);
        let axes = ["time [s]", "change of the energy [J]"];
        m.plot("Double pendulum, h = 1 ms", axes, true, &[("RK4", curve), ("Euler", euler)]);
    });
}

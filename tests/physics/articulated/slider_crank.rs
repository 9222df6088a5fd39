//! A slider-crank: crank r, rod l. The slider is at x = r cos θ + √(l² - r² sin² θ), with x' = -r θ' sin θ (1 + r cos
//! θ/√(l² - r² sin² θ)). The loop is closed by a weld of the slider to a pin at the end of the rod.
//!
//! Tolerance: as for `four_bar`, a velocity v(n+1) satisfies the loop at q(n) and is compared at q(n+1), with an error
//! of h |dk/dθ| ω², k = x'/θ'. Over a turn, with ω² from the energy, |dk/dθ| ω² is at most 11.6 m/s²: 1.16e-2 m/s. The
//! weld, a critically damped spring of the time constant 2 h, is stretched by at most (2 h)² of that: 4.7e-5 m.

use crate::lab::*;
use kinetoscope::sim::WeldCfg;

const CRANK: f64 = 0.1;
const ROD: f64 = 0.35;

/// Largest errors of the slider's position and velocity in 2 s.
fn errors(closed: bool) -> [f64; 2] {
    let links = [
        base(),
        Link::new("crank", 1.0, [1e-3, 1e-3, 5e-3]),
        Link::new("rod", 0.5, [1e-4, 5e-3, 5e-3]).at([ROD / 2.0, 0.0, 0.0]),
        Link::new("pin", 0.05, [1e-5; 3]),
        Link::new("slider", 0.4, [1e-3; 3]),
    ];
    let z = [0.0, 0.0, 1.0];
    let joints = [
        Joint::hinge("shaft", ["base", "crank"], z),
        Joint::hinge("big_end", ["crank", "rod"], z).at([CRANK, 0.0, 0.0]),
        Joint::hinge("small_end", ["rod", "pin"], z).at([ROD, 0.0, 0.0]),
        Joint::slide("guide", ["base", "slider"], [1.0, 0.0, 0.0]),
    ];
    let place = |q: f64| CRANK * q.cos() + (ROD * ROD - (CRANK * q.sin()).powi(2)).sqrt();
    let speed = |q: f64, v: f64| {
        -CRANK * v * q.sin() * (1.0 + CRANK * q.cos() / (ROD * ROD - (CRANK * q.sin()).powi(2)).sqrt())
    };
    let mut lab = Lab::new(weightless());
    let robot = lab.mechanism(&urdf(&links, &joints));
    let weld = WeldCfg { uid: "weld".into(), first: "robot/pin".into(), second: "robot/slider".into() };
    let weld = lab.sim.add_weld(weld).unwrap();
    let (q, v) = (0.5_f64, 8.0);
    // The rod's angle from the line of the slider, and the velocity that keeps the pin level.
    let psi = -(CRANK * q.sin() / ROD).asin();
    let psi_v = -CRANK * v * q.cos() / (ROD * psi.cos());
    lab.write_joints(robot, &[q, psi - q, -psi, place(q)], &[v, psi_v - v, -psi_v, speed(q, v)]);
    if closed {
        lab.sim.weld_mut(weld).attach(None).unwrap();
    }
    let mut worst = [0.0_f64; 2];
    lab.run_with(2_000, |_, sim| {
        let robot = sim.robot(robot);
        let (q, v) = (robot.qpos(), robot.qvel());
        worst[0] = max_or_nan(worst[0], (q[(0, 3)] - place(q[(0, 0)])).abs());
        worst[1] = max_or_nan(worst[1], (v[(0, 3)] - speed(q[(0, 0)], v[(0, 0)])).abs());
    });
    worst
}

#[test]
fn holds() {
    law(module_path!(), "x = r cos θ + √(l² - r² sin² θ)", |m| {
        let ([place, speed], [loose, loose_speed]) = (errors(true), errors(false));
        let within = (4.7e-5, "(2 h)² x'', by which the weld is stretched");
        m.row("largest error of the place in 2 s", "m", 0.0, place, within);
        let within = (1.16e-2, "h x'': Euler's velocity is that of the place before");
        m.row("largest error of the velocity in 2 s", "m/s", 0.0, speed, within);
        m.control("largest error of the place in 2 s", "with the loop open", loose);
        m.control("largest error of the velocity in 2 s", "with the loop open", loose_speed);
    });
}

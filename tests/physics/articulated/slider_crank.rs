//! A slider-crank: crank r, rod l. The slider is at x = r cos θ + √(l² - r² sin² θ), with x' = -r θ' sin θ (1 + r cos θ/√(l² -
//! r² sin² θ)). The loop is closed by a weld of the slider to a pin, which turns at the end of the rod.
//!
//! Tolerance: a weld yields by 1e-4 of the acceleration that its load would cause, within its time constant of two steps:
//! 1e-4 · 100 m/s² · (2 ms)² = 4e-8 m; the Euler steps turn velocities after places, v h of 1 ms at 1 m/s: 1e-3 of the
//! velocity, which the weld takes back within two steps, 2e-5 m/s... as 1e-5 m and 1e-2 m/s.

use crate::lab::*;
use crate::law::law;
use crate::urdf::{Joint, Link, base, urdf};
use kinetoscope::prelude::*;

const CRANK: f64 = 0.1;
const ROD: f64 = 0.35;

/// Largest errors of the slider's place and velocity in 2 s.
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
    // The rod's angle from the line of the slider, and what keeps the pin level.
    let psi = -(CRANK * q.sin() / ROD).asin();
    let psi_v = -CRANK * v * q.cos() / (ROD * psi.cos());
    lab.write_joints(robot, &[q, psi - q, -psi, place(q)], &[v, psi_v - v, -psi_v, speed(q, v)]);
    if closed {
        lab.sim.weld_mut(weld).attach(None).unwrap();
    }
    let mut worst = [0.0_f64; 2];
    lab.watch(2_000, |_, sim| {
        let robot = sim.robot(robot);
        let (q, v) = (robot.get_qpos(), robot.get_qvel());
        worst[0] = worst[0].max((q[(0, 3)] - place(q[(0, 0)])).abs());
        worst[1] = worst[1].max((v[(0, 3)] - speed(q[(0, 0)], v[(0, 0)])).abs());
    });
    worst
}

#[test]
fn holds() {
    law(module_path!(), "x = r cos θ + √(l² - r² sin² θ)", |m| {
        let ([place, speed], [loose, loose_speed]) = (errors(true), errors(false));
        m.row("largest error of the place in 2 s", "m", 0.0, place, (1e-4, "what the weld yields"));
        m.row("largest error of the velocity in 2 s", "m/s", 0.0, speed, (1e-2, "what the weld yields in a step"));
        m.control("largest error of the place in 2 s", "with the loop open", loose);
        m.control("largest error of the velocity in 2 s", "with the loop open", loose_speed);
    });
}

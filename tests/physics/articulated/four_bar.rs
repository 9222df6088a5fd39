//! A four-bar linkage: frame d, crank a, coupler b, rocker c. Freudenstein's equation relates the angles of crank and
//! rocker: `d/a cos θ₄ - d/c cos θ₂ + (a² - b² + c² + d²)/(2 a c) = cos(θ₂ - θ₄)`. Its derivative relates their
//! velocities: `θ₄' = a θ₂' sin(θ₂ - θ₃)/(c sin(θ₄ - θ₃))`. The loop is closed by a weld of the rocker to a pin at the
//! coupler's end.
//!
//! Tolerance: a velocity v(n+1) satisfies the loop at the position q(n) and is compared at q(n+1). Its error is at most
//! h θ₄'' = h |dk/dθ₂| ω², with k = θ₄'/θ₂'. Over a turn, with ω² of the crank from the energy, that is 0.057 rad/s.
//! The weld is a critically damped spring of the time constant 2 h. If it ignores θ₄'', it is stretched by at most (2
//! h)² θ₄''. Times the sensitivity of Freudenstein's equation, |d/a sin θ₄ + sin(θ₂ - θ₄)|, that is 4.8e-4 over a turn.
//!
//! The supported MuJoCo versions differ within that tolerance, by two terms in the rows of a weld. First, 4.x adds J'
//! q' to the reference acceleration, so that the weld accounts for θ₄''; 2.2.2 does not. Second, 4.x regularizes the
//! three rows of rotation by the inverse inertia of rotations, 2.2.2 all six rows by that of translations. With both
//! terms written into the rows of 2.2.2 between the halves of its steps (`efc_aref`, `efc_R` and `efc_D`), this
//! mechanism gives the numbers of 4.0.0 to nine digits. With the first term alone the velocity is off by 0.02823 rad/s,
//! with the second alone by 0.04124. Solver, tolerance and warm start have no effect.

use crate::lab::*;
use kinetoscope::sim::WeldCfg;

const FRAME: f64 = 0.3;
const CRANK: f64 = 0.1;
const COUPLER: f64 = 0.28;
const ROCKER: f64 = 0.22;

/// Residual of Freudenstein's equation.
fn residual(crank: f64, rocker: f64) -> f64 {
    let [a, b, c, d] = [CRANK, COUPLER, ROCKER, FRAME];
    d / a * rocker.cos() - d / c * crank.cos() + (a * a - b * b + c * c + d * d) / (2.0 * a * c)
        - (crank - rocker).cos()
}

/// Angles of coupler and rocker, from the triangle over the diagonal between the crank's end and the rocker's pivot.
fn loop_angles(crank: f64) -> [f64; 2] {
    let (x, y) = (FRAME - CRANK * crank.cos(), -CRANK * crank.sin());
    let (diagonal, direction) = (x.hypot(y), y.atan2(x));
    let cosine = (COUPLER * COUPLER + diagonal * diagonal - ROCKER * ROCKER) / (2.0 * COUPLER * diagonal);
    let coupler = direction + cosine.acos();
    let end = [CRANK * crank.cos() + COUPLER * coupler.cos() - FRAME, CRANK * crank.sin() + COUPLER * coupler.sin()];
    [coupler, end[1].atan2(end[0])]
}

/// Velocities of coupler and rocker.
fn velocities(crank: f64, v: f64) -> [f64; 2] {
    let [coupler, rocker] = loop_angles(crank);
    let of_coupler = CRANK * v * (rocker - crank).sin() / (COUPLER * (coupler - rocker).sin());
    [of_coupler, CRANK * v * (crank - coupler).sin() / (ROCKER * (rocker - coupler).sin())]
}

/// Largest residual, largest velocity error of the rocker, and turns of the crank in 2 s.
fn loop_errors(attached: bool) -> [f64; 3] {
    let bar = |name, length: f64| {
        let moment = 0.3 * length * length / 12.0;
        Link::new(name, 0.3, [1e-4, moment, moment]).at([length / 2.0, 0.0, 0.0])
    };
    let links = [
        base(),
        Link::new("crank", 1.0, [1e-2, 1e-2, 2e-2]),
        bar("coupler", COUPLER),
        Link::new("pin", 0.02, [1e-5; 3]),
        bar("rocker", ROCKER),
    ];
    let z = [0.0, 0.0, 1.0];
    let joints = [
        Joint::hinge("shaft", ["base", "crank"], z),
        Joint::hinge("first", ["crank", "coupler"], z).at([CRANK, 0.0, 0.0]),
        Joint::hinge("second", ["coupler", "pin"], z).at([COUPLER, 0.0, 0.0]),
        Joint::hinge("pivot", ["base", "rocker"], z).at([FRAME, 0.0, 0.0]),
    ];
    let mut lab = Lab::new(weightless());
    let robot = lab.mechanism(&urdf(&links, &joints));
    let weld = WeldCfg { uid: "weld".into(), first: "robot/pin".into(), second: "robot/rocker".into() };
    let weld = lab.sim.add_weld(weld).unwrap();
    let (q, v) = (0.8, 8.0);
    let ([coupler, rocker], [coupler_v, rocker_v]) = (loop_angles(q), velocities(q, v));
    // The pin has the orientation of the rocker.
    let positions = [q, coupler - q, rocker - coupler, rocker];
    lab.write_joints(robot, &positions, &[v, coupler_v - v, rocker_v - coupler_v, rocker_v]);
    if attached {
        lab.sim.weld_mut(weld).attach(None).unwrap();
    }
    let mut worst = [0.0_f64; 2];
    lab.run_with(2_000, |_, sim| {
        let robot = sim.robot(robot);
        let (q, v) = (robot.qpos(), robot.qvel());
        worst[0] = max_or_nan(worst[0], residual(q[(0, 0)], q[(0, 3)]).abs());
        worst[1] = max_or_nan(worst[1], (v[(0, 3)] - velocities(q[(0, 0)], v[(0, 0)])[1]).abs());
    });
    [worst[0], worst[1], lab.q(robot)[0]]
}

#[test]
fn holds() {
    law(module_path!(), "d/a cos θ₄ - d/c cos θ₂ + (a² - b² + c² + d²)/2ac = cos(θ₂ - θ₄)", |m| {
        let ([left, velocity, _], [open, open_velocity, _]) = (loop_errors(true), loop_errors(false));
        m.row("largest residual in 2 s", "", 0.0, left, (4.8e-4, "(2 h)² θ₄'', by which the weld is stretched"));
        m.row(
            "largest error of the rocker's velocity in 2 s",
            "rad/s",
            0.0,
            velocity,
            (0.057, "h θ₄'': Euler's velocity is that of the place before"),
        );
        m.control("largest residual in 2 s", "with the loop open", open);
        m.control("largest error of the rocker's velocity in 2 s", "with the loop open", open_velocity);
        m.versions_differ_in(
            "largest error of the rocker's velocity in 2 s",
            "4.x has J' q' in the reference of a weld and its rotations weighted by inverse inertia of rotation, 2.2.2 neither: \
             with both added to its rows 2.2.2 gives the number of 4.0.0",
        );
    });
}

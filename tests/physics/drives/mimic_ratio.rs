//! A joint that follows another, q₂ = n q₁ + b: a torque τ on the second is felt by the drive of the first as n τ, so
//! that it gives way by n τ/k, and the second by n² τ/k.
//!
//! Tolerance: the coupling is a constraint of MuJoCo's with d = 0.9999 and a time constant of 2 h. At rest it yields by
//! (1 - d) A τ (2 h)² as in `soft_contact`, A = 1/I₂ + n²/I₁ being its inverse inertia: 1e-7 rad; in motion by as much
//! of what the load would accelerate.

use crate::lab::*;
use crate::law::law;
use crate::urdf::{Joint, Link, base, urdf};
use kinetoscope::prelude::*;
use nalgebra::Vector3;

const MOMENTS: [f64; 2] = [0.05, 0.01];
const RATIO: f64 = -1.5;
const OFFSET: f64 = 0.2;
const STIFFNESS: f64 = 40.0;
const AIM: f64 = 0.3;
const LOAD: f64 = 0.5;

/// Both positions under the load at rest, and the worst of q₂ - n q₁ - b on the way.
fn followed(coupled: bool) -> [f64; 3] {
    let wheel = |name, moment| Link::new(name, 1.0, [moment; 3]);
    let z = [0.0, 0.0, 1.0];
    let follower = Joint::hinge("second_joint", ["base", "second"], z).at([0.5, 0.0, 0.0]);
    let mimic = format!("<mimic joint=\"first_joint\" multiplier=\"{RATIO}\" offset=\"{OFFSET}\"/>");
    let follower = if coupled { Joint { more: mimic, ..follower } } else { follower };
    let links = [base(), wheel("first", MOMENTS[0]), wheel("second", MOMENTS[1])];
    let text = urdf(&links, &[Joint::hinge("first_joint", ["base", "first"], z), follower]);
    let mut lab = Lab::new(weightless());
    let robot = lab.robot(&text, RobotCfg { drive: implicit(STIFFNESS, 4.0), ..RobotCfg::default() });
    // Where nothing couples it the second joint has a drive, which holds it where it is.
    lab.sim.robot_mut(robot).set_qpos(&row(&[AIM, 0.0]), None, None).unwrap();
    let mut worst = 0.0_f64;
    lab.watch(1_000, |_, sim| {
        let q = sim.robot(robot).get_qpos();
        worst = worst.max((q[(0, 1)] - RATIO * q[(0, 0)] - OFFSET).abs());
    });
    lab.push_link(robot, "second", Vector3::zeros(), Vector3::new(0.0, 0.0, LOAD));
    lab.run(2.0);
    let q = lab.q(robot);
    [q[0], q[1], worst]
}

#[test]
fn holds() {
    law(module_path!(), "q₂ = n q₁ + b; q₁ = q* + n τ/k", |m| {
        let ([first, second, worst], [alone, idle, apart]) = (followed(true), followed(false));
        let rest = AIM + RATIO * LOAD / STIFFNESS;
        let inverse = 1.0 / MOMENTS[1] + RATIO * RATIO / MOMENTS[0];
        let yields = 2.0 * 1e-4 * inverse * LOAD * 4e-6;
        m.row("position of the driver under a load", "rad", rest, first, (yields, "what the coupling yields, twice"));
        let expected = RATIO * rest + OFFSET;
        m.row(
            "position of the follower under a load",
            "rad",
            expected,
            second,
            (yields, "what the coupling yields, twice"),
        );
        // The greatest acceleration is the first: k q* on both inertias.
        let felt = STIFFNESS * AIM * RATIO.abs() * MOMENTS[1] / (MOMENTS[0] + RATIO * RATIO * MOMENTS[1]);
        let lag = 10.0 * 1e-4 * inverse * felt * 4e-6;
        m.row(
            "worst of q₂ - n q₁ - b on the way",
            "rad",
            0.0,
            worst,
            (lag, "the same of the load in motion, ten times"),
        );
        m.control("position of the driver under a load", "without the coupling", alone);
        m.control("position of the follower under a load", "without the coupling", idle);
        m.control("worst of q₂ - n q₁ - b on the way", "without the coupling", apart);
    });
}

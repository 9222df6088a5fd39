//! A mimic joint, q₂ = n q₁ + b: a torque τ on the follower acts on the drive of the leader as n τ, so that the leader
//! yields by n τ/k, and the follower by n² τ/k.
//!
//! The coupling is a constraint row of MuJoCo with d = dmax = 0.9999 and a time constant of 2 h. At rest it yields as a
//! contact in `soft_contact`, by (1 - d)/d² A τ dmax² (2 h)² = (1 - d) A τ (2 h)². A = 1/I₁ + 1/I₂ is MuJoCo's estimate
//! of its inverse inertia. The follower is thus 2.4e-8 rad off n q₁ + b, which is part of the expected number.
//!
//! Tolerance at rest: rounding. A step rounds about six numbers, each of which moves the position by at most half a
//! digit, and the slow rate of the drive, 13/s, lets this error decay: 3 ε q/(13 h). Of the motion exp(-13 · 4) is
//! left. Tolerance during the motion: the row is critically damped, so that it never yields by more than at rest under
//! its largest load, the first, when the drive pulls with k q* on both inertias.

use crate::lab::*;

const MOMENTS: [f64; 2] = [0.05, 0.01];
const RATIO: f64 = -1.5;
const OFFSET: f64 = 0.2;
const STIFFNESS: f64 = 40.0;
const AIM: f64 = 0.3;
const LOAD: f64 = 0.5;

/// Both positions under the load at rest, and the largest |q₂ - n q₁ - b| during the motion.
fn coupled_positions(coupled: bool) -> [f64; 3] {
    let wheel = |name, moment| Link::new(name, 1.0, [moment; 3]);
    let z = [0.0, 0.0, 1.0];
    let follower = Joint::hinge("second_joint", ["base", "second"], z).at([0.5, 0.0, 0.0]);
    let mimic = format!("<mimic joint=\"first_joint\" multiplier=\"{RATIO}\" offset=\"{OFFSET}\"/>");
    let follower = if coupled { Joint { extra_elements: mimic, ..follower } } else { follower };
    let links = [base(), wheel("first", MOMENTS[0]), wheel("second", MOMENTS[1])];
    let text = urdf(&links, &[Joint::hinge("first_joint", ["base", "first"], z), follower]);
    let mut lab = Lab::new(weightless());
    let robot = lab.robot(&text, RobotCfg { drive: implicit(STIFFNESS, 4.0), ..RobotCfg::default() });
    // Without the coupling, the second joint has its own drive, which holds it in place.
    lab.sim.robot_mut(robot).set_qpos_target(&row(&[AIM, 0.0]), None, None).unwrap();
    let mut worst = 0.0_f64;
    lab.run_with(1_000, |_, sim| {
        let q = sim.robot(robot).qpos();
        worst = worst.max((q[(0, 1)] - RATIO * q[(0, 0)] - OFFSET).abs());
    });
    lab.set_link_wrench(robot, "second", Vector3::zeros(), Vector3::new(0.0, 0.0, LOAD));
    lab.run(4.0);
    let q = lab.q(robot);
    [q[0], q[1], worst]
}

#[test]
fn holds() {
    law(module_path!(), "q₂ = n q₁ + b; q₁ = q* + n τ/k", |m| {
        let ([first, second, worst], [alone, idle, apart]) = (coupled_positions(true), coupled_positions(false));
        let rest = AIM + RATIO * LOAD / STIFFNESS;
        let inverse = 1.0 / MOMENTS[0] + 1.0 / MOMENTS[1];
        let yields = |load: f64| 1e-4 * inverse * load * 4e-6;
        let rounding = (3.0 * f64::EPSILON * rest / (13.0 * 1e-3), "rounding, which the drive forgets with 13/s");
        m.row("position of the driver under a load", "rad", rest, first, rounding);
        let expected = RATIO * rest + OFFSET + yields(LOAD);
        m.row("position of the follower under a load", "rad", expected, second, rounding);
        let felt = STIFFNESS * AIM * RATIO.abs() * MOMENTS[1] / (MOMENTS[0] + RATIO * RATIO * MOMENTS[1]);
        let lag = (yields(felt), "what the coupling yields under its largest load");
        m.row("worst of q₂ - n q₁ - b on the way", "rad", 0.0, worst, lag);
        m.control("position of the driver under a load", "without the coupling", alone);
        m.control("position of the follower under a load", "without the coupling", idle);
        m.control("worst of q₂ - n q₁ - b on the way", "without the coupling", apart);
    });
}

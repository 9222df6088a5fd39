//! Links with gravity compensation weigh nothing and keep their inertia. An undriven arm stays in place, a drive has no
//! error, and an effort τ in a joint at rest gives the same acceleration as without gravity. Other bodies still fall.
//!
//! Tolerance: the compensation is -m g at the center of mass, and MuJoCo sums gravity separately: they differ by
//! rounding. A gravity torque is the sum of three products over two links, 12 roundings of half a digit of at most 18 N
//! m (3 kg at 0.25 m and 1.5 kg at 0.7 m). The accelerated inertia is at least 0.015 kg m²: the lower link has 0.02
//! about its middle, of which the upper link, with 0.25 or more about the shoulder, takes a tenth by moving. The arm
//! drifts by half of the acceleration times t² in a second, and the velocity change of a step of h is itself rounded to
//! ε v/h.

use crate::lab::*;

const START: [f64; 2] = [0.4, -0.9];

fn arm(cfg: SimulationManagerCfg, drive: DriveCfg, compensated: bool) -> (Lab, RobotId) {
    let links = [
        base(),
        Link::brick("upper", 3.0, [0.5, 0.1, 0.1]).at([0.25, 0.0, 0.02]).without_collision(),
        Link::brick("lower", 1.5, [0.4, 0.06, 0.06]).at([0.2, 0.01, 0.0]).without_collision(),
    ];
    let y = [0.0, 1.0, 0.0];
    let elbow = Joint::hinge("elbow", ["upper", "lower"], y).at([0.5, 0.0, 0.0]);
    let mut lab = Lab::new(cfg);
    let init_qpos = vec![("shoulder".into(), START[0]), ("elbow".into(), START[1])];
    let text = urdf(&links, &[Joint::hinge("shoulder", ["base", "upper"], y), elbow]);
    let robot = lab.robot(&text, RobotCfg { drive, init_qpos, ..RobotCfg::default() });
    lab.sim.robot_mut(robot).set_gravity_compensation(compensated, None, None).unwrap();
    (lab, robot)
}

/// Acceleration of the arm due to rounding of the torques \[rad/s²\].
const ROUNDING: f64 = 12.0 * f64::EPSILON / 2.0 * 18.0 / 0.015;

/// Drift of the undriven arm in a second, and error of a soft drive.
fn drift_and_error(compensated: bool) -> [f64; 2] {
    [passive(), implicit(200.0, 20.0)].map(|drive| {
        let (mut lab, robot) = arm(earth(), drive, compensated);
        lab.run(1.0);
        lab.q(robot).iter().zip(START).map(|(q, start)| (q - start).abs()).fold(0.0, f64::max)
    })
}

/// Acceleration of the elbow in the first step under an effort of 2 N m.
fn elbow_acceleration(cfg: SimulationManagerCfg, compensated: bool) -> f64 {
    let (mut lab, robot) = arm(cfg, passive(), compensated);
    lab.set_joint_efforts(robot, &[0.0, 2.0]);
    lab.run(1e-3);
    lab.v(robot)[1] / 1e-3
}

#[test]
fn holds() {
    law(module_path!(), "Σ τ = τ_gravity(q) + Jᵀ (-m g) = 0", |m| {
        let ([free, held], [fallen, sagged]) = (drift_and_error(true), drift_and_error(false));
        let rounding = (0.5 * ROUNDING, "rounding of the torques, for a second");
        m.row("motion of an arm without drives", "rad", 0.0, free, rounding);
        m.row("error of its drives", "rad", 0.0, held, rounding);
        m.control("motion of an arm without drives", "without compensation", fallen);
        m.control("error of its drives", "without compensation", sagged);
        let expected = elbow_acceleration(weightless(), false);
        let sums = (ROUNDING + f64::EPSILON * expected.abs(), "rounding of the torques and of the velocity");
        m.row("acceleration under an effort", "rad/s²", expected, elbow_acceleration(earth(), true), sums);
        m.control("acceleration under an effort", "without compensation", elbow_acceleration(earth(), false));
    });
}

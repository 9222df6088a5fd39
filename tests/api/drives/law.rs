//! The law of one drive, and of several on one chain.
//!
//! tau = clamp(kp (q* - q') + kd (v* - v') + tau_ff, ±limit) at the end of the step, with q' = q + h v'. For a joint of
//! constant inertia M without other loads, M (v' - v) = h tau gives, unsaturated,
//!
//! ```text
//! v' = (M v + h (kp (q* - q) + kd v* + tau_ff)) / (M + h kd + h² kp)
//! ```
//!
//! and saturated v' = v ± h limit / M. For a chain with mass matrix M(q) and bias c(q, v) (both taken at the start of the
//! step by MuJoCo's Euler integrator), with the set S of saturated joints known,
//! (M + h Kd + h² Kp) v' = M v + h (Kp (q* - q) + Kd v* + tau_ff - c), rows in S with their gains zero and ±limit.
//!
//! Tolerance 1e-9, relative above 1: the solver's problem is quadratic between its corners, so Newton's method is exact
//! there up to rounding, which is 1e-16 times the ratio of the largest to the smallest of M and h kd + h² kp (up to 1e6
//! here). Control: the explicit law misses by more than 1e-3.

use crate::drives::worlds::*;
use kinetoscope::prelude::*;
use nalgebra::{DMatrix, DVector, Vector3};

const EXACT: f64 = 1e-9;

#[derive(Clone, Copy, Debug)]
struct Case {
    h: f64,
    m: f64,
    kp: f64,
    kd: f64,
    q: f64,
    v: f64,
    aim: [f64; 3],
}

const CASES: &[Case] = &[
    // The tutorial's finger: 10 g, 1e3 / 1e2.
    Case { h: 0.01, m: 1e-5, kp: 1e3, kd: 1e2, q: 0.1, v: 0.3, aim: [0.6, 0.0, 0.0] },
    Case { h: 0.01, m: 0.5, kp: 1e4, kd: 1e3, q: -0.2, v: -1.0, aim: [0.3, 0.0, 0.0] },
    Case { h: 0.01, m: 0.2, kp: 40.0, kd: 5.0, q: 0.5, v: 2.0, aim: [-0.1, 0.0, 0.0] },
    // Velocity target and feed-forward, alone and together.
    Case { h: 0.01, m: 0.2, kp: 0.0, kd: 30.0, q: 0.5, v: -2.0, aim: [9.0, 1.5, 0.0] },
    Case { h: 0.01, m: 0.2, kp: 0.0, kd: 0.0, q: 0.5, v: 1.0, aim: [9.0, 9.0, 0.7] },
    Case { h: 0.002, m: 0.2, kp: 300.0, kd: 3.0, q: 0.5, v: 1.0, aim: [0.4, -0.6, 2.5] },
    Case { h: 0.05, m: 2.0, kp: 1e5, kd: 0.0, q: 0.0, v: 0.0, aim: [1.0, 0.0, 0.0] },
];

/// `Case` after one step: (v', effort), for an explicit or implicit law.
fn closed_form(c: &Case, implicit: bool) -> (f64, f64) {
    let [aim, v_aim, ff] = c.aim;
    let now = c.kp * (aim - c.q) + c.kd * v_aim + ff;
    if implicit {
        let v = (c.m * c.v + c.h * now) / (c.m + c.h * c.kd + c.h * c.h * c.kp);
        (v, now - (c.kd + c.h * c.kp) * v)
    } else {
        let tau = now - c.kd * c.v;
        (c.v + c.h * tau / c.m, tau)
    }
}

#[test]
fn one_step_of_one_joint_is_the_closed_form() {
    let mut worst: f64 = 0.0;
    for c in CASES {
        for joint in [Joint::wheel("j", c.m), Joint::slide("j", c.m)] {
            let world = world(std::slice::from_ref(&joint), gains(c.kp, c.kd), at_dt(c.h, weightless()));
            let mut env = world.env();
            push(&mut env, &[c.q], &[c.v]);
            env.drives.position[0] = c.aim[0];
            env.drives.velocity[0] = c.aim[1];
            env.drives.feedforward[0] = c.aim[2];
            step(&mut env);
            let (v, tau) = closed_form(c, true);
            let what = format!("{c:?} {}", joint.kind);
            assert_close(env.data().qvel()[0], v, EXACT, &what);
            assert_close(env.data().qpos()[0], c.q + c.h * v, EXACT, &what);
            assert_close(env.drives.effort[0], tau, EXACT, &what);
            worst = worst.max((env.data().qvel()[0] - v).abs() / v.abs().max(1.0));
            let (explicit, _) = closed_form(c, false);
            let distinct = c.kp > 0.0 || c.kd > 0.0;
            assert!(!distinct || (explicit - v).abs() > 1e-3 * v.abs(), "{what}: the control would pass");
        }
    }
    println!("one step: largest error of the velocity {worst:.1e}");
}

/// h is the step that MuJoCo takes, not `physics_dt`.
#[test]
fn substeps_are_steps_of_the_law() {
    let c = Case { h: 0.002, ..CASES[0] };
    let cfg = SimulationManagerCfg { substeps: 5, ..weightless() };
    let mut world = world(&[Joint::wheel("j", c.m)], gains(c.kp, c.kd), cfg);
    world.aim(&[0.6]);
    let (mut q, mut v) = (0.0, 0.0);
    for _ in 0..5 {
        v = closed_form(&Case { q, v, ..c }, true).0;
        q += c.h * v;
    }
    world.step(1);
    assert_close(world.q()[0], q, EXACT, "position after five substeps");
    assert_close(world.v()[0], v, EXACT, "velocity after five substeps");
}

/// Saturated, the effort is the limit to the last bit and the motion is that of the limit; a demand of 99.9 % of the
/// limit is not clamped, one of 100.1 % is.
#[test]
fn the_limit_is_held_exactly() {
    let (m, h, kp, kd, limit) = (0.02, 0.01, 1e3, 1e2, 2.0);
    let world = world(&[Joint::wheel("j", m).effort(limit)], gains(kp, kd), weightless());
    for sign in [1.0, -1.0] {
        for v0 in [0.0, 0.7, -3.0] {
            // The aim at which the unclamped law asks for `share` of the limit.
            for share in [0.5, 0.999, 1.001, 50.0] {
                let v = v0 + h / m * sign * limit * share;
                let aim = (sign * share * limit + (kd + h * kp) * v) / kp;
                let mut env = world.env();
                push(&mut env, &[0.0], &[v0]);
                env.drives.position[0] = aim;
                step(&mut env);
                let tau = env.drives.effort[0];
                if share > 1.0 {
                    assert_eq!(tau, sign * limit, "share {share}");
                } else {
                    assert_close(tau, sign * limit * share, EXACT, "effort below the limit");
                }
                assert_close(env.data().qvel()[0], v0 + h / m * tau, EXACT, "M (v' - v) = h tau");
            }
        }
    }
}

/// The clamp is on the whole sum: a feed-forward cannot lift the drive over its limit, and works against the rest.
#[test]
fn the_sum_is_clamped_not_its_parts() {
    let (m, h, limit) = (0.02, 0.01, 2.0);
    for (kp, kd) in [(100.0, 1.0), (0.0, 0.0)] {
        let world = world(&[Joint::wheel("j", m).effort(limit)], gains(kp, kd), weightless());
        let mut env = world.env();
        env.drives.feedforward[0] = 5.0;
        step(&mut env);
        assert_eq!(env.drives.effort[0], limit);
        assert_close(env.data().qvel()[0], h * limit / m, EXACT, "motion of the limit");
    }
    let world = world(&[Joint::wheel("j", m).effort(limit)], gains(100.0, 1.0), weightless());
    let mut env = world.env();
    // kp e = 30 and tau_ff = -29: neither part fits into the limit, their sum does.
    env.drives.position[0] = 0.3;
    env.drives.feedforward[0] = -29.0;
    step(&mut env);
    let (_, tau) = closed_form(&Case { h, m, kp: 100.0, kd: 1.0, q: 0.0, v: 0.0, aim: [0.3, 0.0, -29.0] }, true);
    assert!(tau > 0.0 && tau < limit);
    assert_close(env.drives.effort[0], tau, EXACT, "sum below the limit");
}

/// Three joints that move each other, in motion under gravity, with one, two and three of them saturated.
#[test]
fn one_step_of_a_chain_is_the_linear_system() {
    let a = Joint::lever("a", 3.0, 0.2, 0.02);
    let b = Joint::lever("b", 1.0, 0.1, 5e-3).after(&a, [0.4, 0.0, 0.0]);
    let c = Joint { axis: [0.0, 0.6, 0.8], ..Joint::lever("c", 0.01, 0.02, 2e-6) }.after(&b, [0.2, 0.0, 0.0]);
    let h = 0.01;
    let (kp, kd) = ([1e4, 1e3, 1e3], [1e3, 1e2, 1e2]);
    let drive = DriveCfg {
        stiffness: [("a", kp[0]), ("[bc]", kp[1])].into(),
        damping: [("a", kd[0]), ("[bc]", kd[1])].into(),
        ..Default::default()
    };
    let (q, v) = ([0.3, -0.7, 0.4], [1.1, -0.6, 2.0]);
    let aim = [0.35, -0.66, 0.41];
    let mut seen = Vec::new();
    for limits in [[f64::MAX; 3], [20.0, 500.0, 500.0], [20.0, 500.0, 1e-3], [20.0, 0.5, 1e-3]] {
        let joints: Vec<Joint> = [&a, &b, &c].iter().zip(limits).map(|(j, l)| (*j).clone().effort(l)).collect();
        let world = world(&joints, drive.clone(), earth());
        let mut env = world.env();
        push(&mut env, &q, &v);
        env.drives.position.copy_from_slice(&aim);
        step(&mut env);
        let tau = env.drives.effort.clone();
        let (mass, bias) = world.dynamics(&q, &v, &EARTH);
        // Gains of the joints that are not at their limit; the others contribute ±limit.
        let saturated: Vec<bool> = (0..3).map(|i| tau[i].abs() == limits[i]).collect();
        let gain = |k: [f64; 3]| DVector::from_fn(3, |i, _| if saturated[i] { 0.0 } else { k[i] });
        let (kp, kd) = (gain(kp), gain(kd));
        let constant = DVector::from_fn(3, |i, _| if saturated[i] { tau[i] } else { kp[i] * (aim[i] - q[i]) });
        let left: DMatrix<f64> = &mass + DMatrix::from_diagonal(&(h * &kd + h * h * &kp));
        let right = &mass * Vector3::from(v) + h * (constant - bias);
        let expected = left.lu().solve(&right).unwrap();
        for i in 0..3 {
            assert_close(env.data().qvel()[i], expected[i], EXACT, &format!("joint {i}, limits {limits:?}"));
            assert!(tau[i].abs() <= limits[i]);
            // A joint at its limit is one whose law asks for more.
            let asked =
                [1e4, 1e3, 1e3][i] * (aim[i] - env.data().qpos()[i]) - [1e3, 1e2, 1e2][i] * env.data().qvel()[i];
            assert!(!saturated[i] || asked * tau[i].signum() >= limits[i], "joint {i}: {asked} {limits:?}");
        }
        seen.push(saturated.iter().filter(|s| **s).count());
    }
    assert_eq!(seen, [0, 1, 2, 3]);
}

/// A velocity drive (kp = 0) holds v* where nothing pushes, and v* - load / kd under a load: M a = 0 = kd (v* - v) - f.
/// The way there is (M / (M + h kd))^n, below 1e-15 after 400 steps.
#[test]
fn a_velocity_target_is_reached_and_yields_by_load_over_damping() {
    let (m, kd, aim, load) = (0.2, 3.0, 1.5, 0.9);
    let mut world = world(&[Joint::wheel("j", m)], gains(0.0, kd), weightless());
    world.sim.robot_mut(world.robot).set_qvel(&row(&[aim]), None, None).unwrap();
    world.step(400);
    assert_close(world.v()[0], aim, EXACT, "speed without load");
    let mut env = world.env();
    env.drives.applied[0] = -load;
    env.step(400);
    assert_close(env.data().qvel()[0], aim - load / kd, EXACT, "speed under load");
}

/// The setters write what the law reads; efforts and velocities stay until changed, a reset clears them.
#[test]
fn setters_of_velocity_and_effort_reach_the_law() {
    let c = CASES[5];
    let mut world = world(&[Joint::wheel("j", c.m)], gains(c.kp, c.kd), at_dt(c.h, weightless()));
    let by_hand = |world: &World, steps| {
        let mut env = world.env();
        env.drives.position[0] = c.aim[0];
        env.drives.velocity[0] = c.aim[1];
        env.drives.feedforward[0] = c.aim[2];
        env.step(steps);
        (env.data().qpos()[0], env.data().qvel()[0])
    };
    let expected = by_hand(&world, 50);
    world.aim(&[c.aim[0]]);
    let mut robot = world.sim.robot_mut(world.robot);
    robot.set_qvel(&row(&[c.aim[1]]), None, None).unwrap();
    robot.set_qf(&row(&[c.aim[2]]), Some(&[JointIndex(0)]), Some(&[EnvId(0)])).unwrap();
    world.step(50);
    assert_eq!((world.q()[0], world.v()[0]), expected);

    let mut robot = world.sim.robot_mut(world.robot);
    assert!(matches!(robot.set_qf(&row(&[f64::NAN]), None, None), Err(Error::NotFinite { argument: "set_qf", .. })));
    assert!(matches!(robot.set_qvel(&row(&[0.0, 1.0]), None, None), Err(Error::Shape { argument: "set_qvel", .. })));
    world.sim.reset(None).unwrap();
    world.step(10);
    assert_eq!((world.q()[0], world.v()[0]), (0.0, 0.0), "a reset leaves nothing to push");
}

/// A passive joint takes efforts too: M a = tau, clamped to the file's limit, also where the model has no drive at all.
#[test]
fn an_effort_moves_a_joint_without_a_drive() {
    let (m, h) = (0.2, 0.01);
    let drive = DriveCfg { drive_type: DriveType::None, ..Default::default() };
    let mut world = world(&[Joint::wheel("j", m).effort(3.0)], drive, weightless());
    let mut push = |tau: f64| {
        world.sim.robot_mut(world.robot).set_qf(&row(&[tau]), None, None).unwrap();
        world.step(10);
        world.v()[0]
    };
    assert_close(push(1.0), 10.0 * h * 1.0 / m, EXACT, "speed after 10 steps of 1 N m");
    assert_close(push(-50.0), 10.0 * h * (1.0 - 3.0) / m, EXACT, "speed after 10 more at the limit");
}

//! Explicit actuator models: the law of each, step by step; their response to a step of the target; and changes of
//! gains, types and limits at run time.
//!
//! For a joint of constant inertia M without other loads MuJoCo's Euler step is v' = v + h tau / M, q' = q + h v',
//! where tau is the model's effort at the start of the step. Tolerance 1e-9 over some 200 steps, as in `law.rs`:
//! rounding of 1e-16 per step, which stable gains do not amplify.

use crate::drives::law::{EXACT, LAW, Law};
use crate::drives::worlds::*;
use kinetoscope::mujoco::Buffers;
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::drive::actuator::{Scheme, stable_timestep_of, warn_if_unstable};
use kinetoscope::sim::drive::plan::{PlanError, effective_inertias, plan};
use kinetoscope::sim::env::SimEnv;
use kinetoscope::sim::{
    ActuatorModel, DcMotor, DelayedPd, DriveModel, DriveType, Error, IdealPd, Integrator, RandomizationError,
};
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::worlds::add_ball;
use std::collections::BTreeMap;
use std::sync::Arc;

const M: f64 = 0.2;

fn with(model: impl Into<ActuatorModel>, kp: f64, kd: f64) -> DriveCfg {
    modeled(".*", model, kp, kd)
}

fn motor(saturation_effort: f64) -> DriveCfg {
    with(DcMotor { saturation_effort }, 0.0, 0.0)
}

fn wheel() -> Joint {
    Joint::wheel("j", M)
}

/// The explicit law of such a wheel.
fn law(kp: f64, kd: f64) -> Law {
    Law { m: M, kp, kd, explicit: true, ..LAW }
}

/// All models, with the delay of each \[steps\].
fn models(delay: u32) -> impl Iterator<Item = (ActuatorModel, u32)> {
    let late = DelayedPd { delay, max_delay: delay }.into();
    ActuatorModel::examples()
        .into_iter()
        .chain([late])
        .map(|model| (model, if let ActuatorModel::DelayedPd(model) = model { model.delay } else { 0 }))
}

/// The clamped sum at the start of the step.
#[test]
fn ideal_pd() {
    for integrator in [Integrator::Euler, Integrator::Implicit, Integrator::Rk4] {
        for model in [DriveModel::Implicit, DriveModel::Actuator] {
            let mut law = Law { limit: 4.0, ..law(30.0, 1.5) };
            let cfg = SimulationManagerCfg { integrator, ..weightless() };
            let mut world = world(&[wheel().effort(4.0)], DriveCfg { model, ..with(IdealPd {}, 30.0, 1.5) }, cfg);
            let mut saturated = 0;
            for k in 0..200 {
                let aim = [0.7 * (0.05 * f64::from(k)).sin(), 0.3, 0.1 * f64::from(k % 7)];
                world.set_targets([aim]);
                let before = law.v;
                let (tau, bound) = law.step_to(aim);
                saturated += u32::from(bound);
                if integrator == Integrator::Rk4 {
                    // RK4 also holds the effort constant, and is exact for a constant force.
                    law.q += H * 0.5 * (before - law.v);
                }
                world.step(1);
                assert_number("effort", world.effort()[0], tau, EXACT);
                assert_number("velocity", world.v()[0], law.v, EXACT);
                assert_number("position", world.q()[0], law.q, EXACT);
            }
            assert!((10..190).contains(&saturated), "both sides of the limit: {saturated}");
        }
    }
}

/// Stall 120 N m, continuous 80 N m, 7.5 rad/s without load: corners and lines of the four quadrants.
#[test]
fn dc_motor_quadrants() {
    let world = world(&[wheel().effort(80.0)], motor(120.0), weightless());
    for (speed, asked, given) in [
        (0.0, 500.0, 80.0),
        (0.0, 30.0, 30.0),
        (2.5, 500.0, 80.0),
        (3.75, 500.0, 60.0),
        (3.75, 10.0, 10.0),
        (3.75, -500.0, -80.0),
        (7.5, 500.0, 0.0),
        // Above the no-load speed it brakes for any command.
        (9.0, 500.0, -24.0),
        (9.0, 0.0, -24.0),
        (12.5, 500.0, -80.0),
        (40.0, 500.0, -80.0),
        (40.0, -500.0, -80.0),
    ] {
        for sign in [1.0, -1.0] {
            let mut env = world.env();
            set_state(&mut env, &[0.0], &[sign * speed]);
            env.drives.feedforward[0] = sign * asked;
            step(&mut env);
            let what = format!("{asked} N m at {speed} rad/s, sign {sign}");
            // Products of numbers up to 300: rounding of 1e-13.
            let limit = Tolerance::mixed(1e-12, "products of numbers up to 300: rounding of 1e-13");
            assert_number(&what, env.drives.effort[0], sign * given, limit);
            assert_number(&what, env.data().qvel()[0], sign * (speed + H * given / M), EXACT);
        }
    }
    // Inside the torque-speed lines it is the ideal controller with its gains.
    let drive = with(DcMotor { saturation_effort: 120.0 }, 40.0, 5.0);
    let mut env = self::world(&[wheel().effort(80.0)], drive, weightless()).env();
    set_state(&mut env, &[0.1], &[1.0]);
    set_drive_targets(&mut env, [0.5, 2.0, 0.0]);
    step(&mut env);
    assert_number("inside of the lines", env.drives.effort[0], 40.0 * 0.4 + 5.0 * 1.0, EXACT);
}

/// The no-load speed is set per environment: at v a motor gives at most s (1 - v / v_max).
#[test]
fn dc_motor_limits() {
    let mut world = world(&[wheel().effort(100.0)], motor(6.0), weightless_envs(2));
    let mut robot = world.robot();
    robot.set_qvel_limits(&array![[3.0]], None, Some(&[EnvId(1)])).unwrap();
    robot.write_qvel(&array![[1.5]], None, None).unwrap();
    robot.set_qf_target(&array![[100.0]], None, None).unwrap();
    world.step(1);
    for (env, top) in [(0, 7.5), (1, 3.0)] {
        let expected = 6.0 * (1.0 - 1.5 / top);
        assert_number(&format!("{top} rad/s"), world.view().qf()[(env, 0)], expected, EXACT);
    }
    let before = (world.view().qvel_limits(), world.view().qf_limits());
    for bad in [0.0, f64::INFINITY] {
        let result = world.robot().set_qvel_limits(&array![[bad]], None, None);
        assert_error(result, "OutOfRange { argument: \"set_qvel_limits\"", &["dc_motor"]);
    }
    // A motor without a continuous limit would brake without bound.
    let error = world.robot().set_qf_limits(&array![[f64::INFINITY]], None, None).unwrap_err();
    assert!(matches!(error, Error::OutOfRange { argument: "set_qf_limits", row: 0, column: 0, .. }), "{error}");
    assert!(error.to_string().contains("dc_motor") && error.to_string().contains("joint \"j\""), "{error}");
    assert_eq!((world.view().qvel_limits(), world.view().qf_limits()), before);
    world.robot().set_qf_limits(&array![[2.0]], None, None).unwrap();
    world.robot().write_qvel(&array![[1.5]], None, None).unwrap();
    world.step(1);
    assert_eq!(world.view().qf(), array![[2.0], [2.0]], "below the lines, 4.8 and 3 N m");
}

/// At full throttle from rest, tau = s (1 - v / v_max) in every step: with r = 1 - h s / (M v_max), v_n = v_max (1 -
/// r^n) and q_n = h (v_1 + ... + v_n) = h v_max (n - r (1 - r^n) / (1 - r)). This settles for |r| < 1; beyond, the
/// motor overshoots until its limit holds it, and `add_robot` warns.
#[test]
fn dc_motor_from_rest() {
    let stall = 6.0;
    for (slope, stable) in [(0.8, true), (10.0, true), (39.0, true), (41.0, false)] {
        let (top, r) = (stall / slope, 1.0 - H * slope / M);
        let drive = DriveCfg { max_velocity: Some(top.into()), ..motor(stall) };
        let mut world = world(&[wheel().effort(1.5 * stall)], drive, weightless());
        assert_eq!(world.has_stability_warning(), !stable, "slope {slope}");
        world.robot().set_qf_target(&array![[1e4]], None, None).unwrap();
        for n in 1..=200 {
            world.step(1);
            if stable {
                let power = r.powi(n);
                let q = H * top * (f64::from(n) - r * (1.0 - power) / (1.0 - r));
                assert_number(&format!("velocity, slope {slope}, step {n}"), world.v()[0], top * (1.0 - power), EXACT);
                assert_number(&format!("position, slope {slope}, step {n}"), world.q()[0], q, EXACT);
            }
        }
        let off = (world.v()[0] / top - 1.0).abs();
        // 0.96^200 is 3e-4, 0.95^200 3e-5; the oscillation ends at the limit, 1.5 of v_max away.
        assert_eq!(off < 1e-3, stable, "slope {slope}: {off}");
        assert!(stable || off > 1.0, "slope {slope}: {off}");
    }
}

/// Oscillating targets of position, velocity and effort in step n.
fn wobble(n: i32) -> [f64; 3] {
    let n = f64::from(n);
    [0.5 * (0.31 * n).sin(), 0.2 * (0.7 * n).cos(), 0.3 * (1.1 * n).sin()]
}

/// The targets that act in step n; before the delay has passed, those of the start.
fn delayed(n: i32, delay: i32) -> [f64; 3] {
    if n < delay { [0.0; 3] } else { wobble(n - delay) }
}

fn assert_at(found: [f64; 2], law: &Law, what: &str) {
    assert_number(&format!("position, {what}"), found[0], law.q, EXACT);
    assert_number(&format!("velocity, {what}"), found[1], law.v, EXACT);
}

/// Targets act in each environment after its own number of steps.
#[test]
fn delay_per_environment() {
    let delays = [0, 1, 3, 6];
    let mut world = world(&[wheel()], with(DelayedPd { delay: 1, max_delay: 6 }, 25.0, 1.0), weightless_envs(4));
    assert_eq!(world.view().delay(), Array2::from_elem((4, 1), 1));
    world.robot().set_delay(&array![[0_u32], [1], [3], [6]], None, None).unwrap();
    for round in 0..2 {
        let (mut laws, mut apart) = ([law(25.0, 1.0); 4], 0.0_f64);
        for n in 0..200 {
            world.set_targets([wobble(n)]);
            if n == 100 {
                // Delayed targets are carried over to a new model.
                add_ball(&mut world.sim, &format!("ball{round}"), [5.0, f64::from(round), 5.0]);
            }
            world.step(1);
            let (q, v) = (world.view().qpos(), world.view().qvel());
            for (env, (&delay, law)) in delays.iter().zip(&mut laws).enumerate() {
                law.step_to(delayed(n, delay));
                assert_at([q[(env, 0)], v[(env, 0)]], law, &format!("delay {delay}, step {n}, round {round}"));
            }
            apart = apart.max((laws[0].q - laws[3].q).abs());
        }
        assert!(apart > 0.05, "the control: a delay shows: {apart}");
        // A reset clears the delayed targets, and keeps the delays.
        world.sim.reset(None).unwrap();
        assert_eq!(world.view().delay().column(0).to_vec(), [0, 1, 3, 6]);
    }
}

/// In step n the targets of step n - d(n) act: an increasing delay repeats targets, a decreasing one skips some.
#[test]
fn delay_that_changes() {
    let mut world = world(&[wheel()], with(DelayedPd { delay: 2, max_delay: 7 }, 25.0, 1.0), weightless());
    // First step of each delay, and the delay; the first delay is longer than any before.
    let changes = [(1, 7), (20, 2), (50, 5), (100, 1), (110, 0), (120, 7), (150, 0)];
    let (mut delay, mut law, mut acted) = (2, law(25.0, 1.0), Vec::new());
    for n in 0..180 {
        if let Some((_, changed)) = changes.iter().find(|(at, _)| *at == n) {
            delay = *changed;
            world.robot().set_delay(&array![[delay as u32]], None, None).unwrap();
        }
        world.set_targets([wobble(n)]);
        world.step(1);
        acted.push(n - delay);
        law.step_to(delayed(n, delay));
        assert_at([world.q()[0], world.v()[0]], &law, &format!("step {n}"));
    }
    // As documented: from 2 to 5 steps three targets act again, from 5 to 1 four are skipped.
    assert_eq!(acted[48..55], [46, 47, 45, 46, 47, 48, 49]);
    assert_eq!(acted[98..102], [93, 94, 99, 100]);
}

/// A delayed target is clamped to the range at the time it acts. A target that acts while the range is tight is
/// clamped; a target that was set earlier and acts after the range is wide again is unchanged.
#[test]
fn delay_across_limits() {
    let delay = 5;
    let mut world = world(&[wheel()], with(DelayedPd { delay, max_delay: 0 }, 25.0, 1.0), weightless());
    let (wide, tight) = ([f64::NEG_INFINITY, f64::INFINITY], [-0.1, 0.15]);
    let clamp = |[low, high]: [f64; 2], x: f64| x.max(low).min(high);
    let (mut set, mut law, mut clamped, mut unclamped) = (Vec::new(), law(25.0, 1.0), 0, 0);
    for n in 0..200 {
        let range = if n % 40 >= 20 && n % 40 < 23 { tight } else { wide };
        if [0, 20, 23].contains(&(n % 40)) {
            world.robot().set_qpos_limits(&array![[[range[0], range[1]]]], None, None).unwrap();
        }
        let [q, v, tau] = wobble(n);
        world.set_targets([[q, v, tau]]);
        world.step(1);
        set.push([clamp(range, q), v, tau]);
        let acts = set.len().checked_sub(1 + delay as usize).map_or([0.0; 3], |k| set[k]);
        let aim = clamp(range, acts[0]);
        clamped += u32::from(aim != acts[0]);
        // Set before the range became tight, and acting after.
        unclamped += u32::from(n % 40 >= 23 && n % 40 < 25 && clamp(tight, aim) != aim);
        law.step_to([aim, acts[1], acts[2]]);
        assert_at([world.q()[0], world.v()[0]], &law, &format!("step {n}"));
    }
    assert!(clamped > 3 && unclamped > 3, "the control: {clamped} were clamped when they acted, {unclamped} were not");
}

/// A step that is repeated with larger buffers counts as one step of the delay line.
#[test]
fn delay_in_a_repeated_step() {
    let joints = ["a", "b", "c"].map(|name| Joint::wheel(name, M).range(-0.02, 0.02));
    let world = world(&joints, with(DelayedPd { delay: 3, max_delay: 0 }, 25.0, 1.0), weightless());
    let sized = |buffers: Buffers| {
        let (model, drives) = world.sim.batch().read(0, |env| (env.data().model().clone(), env.drives.clone()));
        let mut env = SimEnv::new(&model.with_buffers(buffers), &Arc::clone(drives.table())).unwrap();
        env.drives = drives;
        env
    };
    // One size for each MuJoCo version: constraint rows on 2.2.2, one arena on 4.x.
    let huge = Buffers { contacts: 100, constraints: 100, arena_bytes: 1 << 20 };
    let mut in_motion = 0;
    for i in 0..40 {
        let arena_bytes = (512.0 * 1.15_f64.powi(i)) as usize;
        let (mut small, mut large) = (sized(Buffers { constraints: 1, arena_bytes, ..huge }), sized(huge));
        let before = small.buffer_growths();
        for n in 0..60 {
            for env in [&mut small, &mut large] {
                for drive in 0..3 {
                    // The stops are hit one after the other, and each adds a row.
                    env.drives.feedforward[drive] = 20.0 * (0.3 * f64::from(n) - drive as f64).sin();
                }
                step(env);
            }
            assert_eq!(small.data().qpos(), large.data().qpos(), "step {n}, arena {arena_bytes}");
            assert_eq!(small.drives, large.drives, "step {n}, arena {arena_bytes}");
        }
        in_motion += small.buffer_growths() - before;
        assert_eq!(large.buffer_growths(), 0);
    }
    assert!(in_motion > 0, "some step was done again");
}

/// Underdamped second order: M q'' = kp (q* - q) - kd q' from rest, q = q* (1 - exp(-z w t) (cos(d t) + z w / d sin(d
/// t))), w² = kp / M, z = kd / (2 M w), d = w sqrt(1 - z²), shifted by the delay. Euler's method is of first order: the
/// error is about h times the scale of the acceleration, and half of it with half the step. The bound 5 h w q* holds
/// for z = 0.5; the control is the ratio of the errors.
#[test]
fn second_order() {
    let (m, w, z, aim) = (0.1_f64, 10.0_f64, 0.5_f64, 0.05);
    let (kp, kd, d) = (m * w * w, 2.0 * m * z * w, w * (1.0 - z * z).sqrt());
    for (model, delay) in models(7) {
        let [one, half] = [1e-3, 5e-4].map(|h: f64| {
            let drive = DriveCfg { max_velocity: Some(1e6.into()), ..with(model, kp, kd) };
            let mut world = world(&[Joint::wheel("j", m).effort(100.0)], drive, at_dt(h, weightless()));
            world.set_position_targets(&[aim]);
            let mut worst = 0.0_f64;
            for n in 1..=(1.0 / h).round() as u32 {
                world.step(1);
                let t = f64::from(n.saturating_sub(delay)) * h;
                let (sin, cos) = (d * t).sin_cos();
                let exact = aim * (1.0 - (-z * w * t).exp() * (cos + z * w / d * sin));
                worst = worst.max((world.q()[0] - exact).abs());
            }
            let limit = Tolerance::mixed(0.01 * aim, "of the way e^-5 = 0.7 % is left");
            assert_number("after five time constants", world.q()[0], aim, limit);
            worst
        });
        assert!(one < 5.0 * 1e-3 * w * aim, "{model:?}: {one}");
        assert!((1.8..2.2).contains(&(one / half)), "{model:?}: {one} {half}");
    }
}

/// Models are selected by joint; the other joints use the robot's drive. Gains change at run time as for other drives.
#[test]
fn models_beside_rows() {
    let (kp, kd) = (60.0, 4.0);
    let joints = [Joint::wheel("a", M), Joint::wheel("b", M), Joint::wheel("c", M).rough(0.5)];
    let mut world = world(&joints, modeled("[bc]", IdealPd {}, kp, kd), weightless());
    let first = |world: &mut World| {
        world.sim.reset(None).unwrap();
        world.set_position_targets(&[0.4; 3]);
        world.step(1);
        world.v()
    };
    let v = first(&mut world);
    assert_number("at the end of the step", v[0], H * kp * 0.4 / (M + H * kd + H * H * kp), EXACT);
    assert_number("at its start", v[1], H * kp * 0.4 / M, EXACT);
    assert_number("with friction", v[2], H * (kp * 0.4 - 0.5) / M, EXACT);
    let second = Some(&[JointIndex(1)][..]);
    world.robot().set_stiffness(&array![[20.0]], second, None).unwrap();
    world.robot().set_qf_limits(&array![[3.0]], second, None).unwrap();
    assert_number("8 N m, clamped to 3", first(&mut world)[1], H * 3.0 / M, EXACT);
    world.robot().set_qf_limits(&array![[500.0]], second, None).unwrap();
    assert_number("no limit of the model is in the way", first(&mut world)[1], H * 20.0 * 0.4 / M, EXACT);
    world.assert_healthy();
}

/// h² kp + 2 h kd = 4 I, where I is the inertia of a wheel plus the squared ratio times that of its follower. Gains
/// that are unstable at this time step give a warning, as for MuJoCo's actuators.
#[test]
fn largest_stable_step() {
    // kp = (0.8 - 0.02) / 1e-4 = 7800.
    for (kp, warns) in [(7700.0, false), (7900.0, true)] {
        assert_eq!(world(&[wheel()], with(IdealPd {}, kp, 1.0), weightless()).has_stability_warning(), warns, "{kp}");
    }
    let (kp, kd, ratio, [leader, follower]) = (200.0, 4.0, -2.0, [0.3, 0.05]);
    let joints = [Joint::wheel("a", leader), Joint::wheel("b", follower).following("a", ratio)];
    let world = world(&joints, gains(kp, kd), weightless());
    let description = world.view().description();
    let (plans, _) = plan(description, &gains(kp, kd), &BTreeMap::new(), &[], false).unwrap();
    // The two joints interact only through the coupling, which is not in the mass matrix.
    let felt = effective_inertias(description, &plans, false).unwrap();
    let limit = Tolerance::mixed(1e-12, "rounding of a mass matrix of two joints and its inverse");
    assert_number("inertia of a", felt[0], leader, limit);
    assert_number("inertia of b", felt[1], follower, Tolerance::mixed(1e-12, "as for a"));
    let of = |inertia: f64| ((kd * kd + 4.0 * inertia * kp).sqrt() - kd) / kp;
    let (expected, alone) = (of(leader + ratio * ratio * follower), of(leader));
    let found = stable_timestep_of(Scheme::Explicit, description, &plans, false).unwrap();
    // Bisected to a relative accuracy of 1e-9.
    assert_number("largest step", found / expected, 1.0, Tolerance::mixed(2e-9, "bisected to 1e-9 of it"));
    assert!((found / alone - 1.0).abs() > 0.1, "the control: the follower matters");
    assert!(warn_if_unstable(description, &plans, false, 0.99 * expected).is_none());
    let warning = warn_if_unstable(description, &plans, false, 1.01 * expected).unwrap().to_string();
    assert!(warning.contains(&format!("{found:.3e} s")) && warning.contains("substeps"), "{warning}");
}

#[test]
fn refused_models() {
    let plain = || DriveCfg { max_velocity: None, ..with(DcMotor { saturation_effort: 5.0 }, 1.0, 0.1) };
    let mut twice = modeled("j", IdealPd {}, 1.0, 0.1);
    twice.actuators.push((".*".into(), DelayedPd::default().into()));
    let rows: [(DriveCfg, &[&str]); 8] = [
        (plain(), &["dc_motor of joint \"j\"", "max_velocity is inf", "velocity limit"]),
        (motor(5.0), &["dc_motor of joint \"j\"", "max_effort is inf", "effort limit"]),
        (motor(0.0), &["saturation_effort is 0", "above 0"]),
        (motor(f64::NAN), &["saturation_effort is NaN"]),
        (with(DelayedPd { delay: 10_001, max_delay: 0 }, 1.0, 0.1), &["delayed_pd", "10001", "10000"]),
        (with(DelayedPd { delay: 0, max_delay: u32::MAX }, 1.0, 0.1), &["delayed_pd", "10000"]),
        (modeled("J", IdealPd {}, 1.0, 0.1), &["actuators", "\"J\"", "\"j\""]),
        (twice, &["actuators", "matched by both"]),
    ];
    for (drive, parts) in rows {
        let what = format!("{drive:?}");
        let error = *try_world(&[wheel()], drive, weightless()).unwrap_err();
        let Error::DrivePlan { error: plan, .. } = &error else { panic!("{error}") };
        assert!(matches!(**plan, PlanError::ActuatorModel { .. } | PlanError::Drive(_)), "{error}");
        assert!(parts.iter().all(|part| error.to_string().contains(part)), "{error} lacks {parts:?}, of {what}");
    }
    // A velocity limit in the file is sufficient; a passive joint needs none.
    try_world(&[wheel().effort(5.0)], plain(), weightless()).unwrap();
    try_world(&[wheel()], DriveCfg { drive_type: DriveType::None, ..plain() }, weightless()).unwrap();
}

/// Refused delays, which change nothing.
#[test]
fn refused_delays() {
    let drive = modeled("a", DelayedPd { delay: 2, max_delay: 5 }, 1.0, 0.1);
    let mut world = world(&[Joint::wheel("a", M), Joint::wheel("b", M)], drive, weightless_envs(2));
    let first = Some(&[JointIndex(0)][..]);
    type Row<'a> = (Array2<u32>, Option<&'a [JointIndex]>, Option<&'a [EnvId]>, &'a [&'a str]);
    let rows: [Row<'_>; 8] = [
        (array![[5], [6]], first, None, &["set_delay[1, 0] (joint \"a\") is 6; it must be at most 5"]),
        (array![[u32::MAX]], first, None, &["set_delay", "at most 5"]),
        (array![[1, 1]], None, None, &["set_delay", "joint \"b\""]),
        (array![[1]], None, None, &["set_delay", "[1, 1]"]),
        (array![[1]], Some(&[JointIndex(7)]), None, &["joint 7 does not exist"]),
        (array![[1, 3]], Some(&[JointIndex(0); 2]), None, &["set_delay names joint \"a\" twice"]),
        (array![[1], [3]], first, Some(&[EnvId(1); 2]), &["set_delay names environment 1 twice"]),
        (array![[1]], first, Some(&[EnvId(2)]), &["environment 2 does not exist"]),
    ];
    for (steps, joints, envs, parts) in rows {
        assert_error(world.robot().set_delay(&steps, joints, envs), "", parts);
        assert_eq!(world.view().delay(), array![[2, 0], [2, 0]]);
    }
}

const ENVS: usize = 3;
/// Inertias of two wheels with the model, and of one without.
const MOMENTS: [f64; 3] = [0.2, 0.5, 0.3];
const LIMIT: f64 = 0.9;

/// Stiffness, damping, effort limit and type of each drive, by environment and joint.
type Settings = ([Array2<f64>; 3], Array2<DriveType>);

fn settings_of(world: &World) -> Settings {
    let view = world.view();
    ([view.stiffness(), view.damping(), view.qf_limits()], view.drive_types())
}

fn first_settings() -> Settings {
    ([3.0, 0.4, LIMIT].map(|value| Array2::from_elem((ENVS, 3), value)), Array2::default((ENVS, 3)))
}

/// Changes of step n, for single joints in single environments.
fn change(world: &mut World, settings: &mut Settings, n: i32) {
    const A: Option<&[JointIndex]> = Some(&[JointIndex(0)]);
    const B: Option<&[JointIndex]> = Some(&[JointIndex(1)]);
    const ONE: Option<&[EnvId]> = Some(&[EnvId(1)]);
    const TWO: Option<&[EnvId]> = Some(&[EnvId(2)]);
    let ([stiffness, damping, limit], kind) = &mut *settings;
    let mut robot = world.robot();
    match n {
        40 => {
            robot.set_stiffness(&array![[6.0], [1.5]], A, Some(&[EnvId(2), EnvId(1)])).unwrap();
            (stiffness[(2, 0)], stiffness[(1, 0)]) = (6.0, 1.5);
        }
        80 => {
            robot.set_damping(&array![[0.9]], B, ONE).unwrap();
            robot.set_qf_limits(&array![[0.3]], B, TWO).unwrap();
            (damping[(1, 1)], limit[(2, 1)]) = (0.9, 0.3);
        }
        120 => {
            robot.set_drive_type(DriveType::Acceleration, A, ONE).unwrap();
            robot.set_drive_type(DriveType::None, B, TWO).unwrap();
            (kind[(1, 0)], kind[(2, 1)]) = (DriveType::Acceleration, DriveType::None);
        }
        160 => {
            // A gain that is set while the type is `None` acts when the type changes.
            robot.set_stiffness(&array![[5.0]], B, TWO).unwrap();
            robot.set_drive_type(DriveType::Force, None, None).unwrap();
            stiffness[(2, 1)] = 5.0;
            kind.fill(DriveType::Force);
        }
        200 => {
            let randomization =
                Randomization::new().with(Property::MaxEffort, "robot/a", RandomizationOp::Set([0.5, 0.5]));
            world.sim.properties_mut().randomize(&randomization, ONE).unwrap();
            limit[(1, 0)] = 0.5;
        }
        _ => return,
    }
    assert_eq!(settings_of(world), *settings, "step {n}");
}

fn three_wheels(model: ActuatorModel) -> World {
    let joints: Vec<Joint> =
        ["a", "b", "c"].into_iter().zip(MOMENTS).map(|(name, m)| Joint::wheel(name, m).effort(LIMIT)).collect();
    let drive = DriveCfg { max_velocity: Some(1e6.into()), ..modeled("[ab]", model, 3.0, 0.4) };
    world(&joints, drive, weightless_envs(ENVS))
}

/// Below its stall effort and far below its no-load speed, a DC motor gives the clamped sum, like the other models.
/// Gains of the type `Acceleration` are multiplied by M; the type `None` has no gains.
#[test]
fn changes_at_run_time() {
    // Targets of step n, with an amplitude that reaches the limit.
    let wobble = |n: i32, joint: usize| {
        let (n, phase) = (f64::from(n), joint as f64);
        [0.6 * (0.13 * n + phase).sin(), 0.2 * (0.7 * n + phase).cos(), 0.1 * (1.1 * n - phase).sin()]
    };
    for (model, delay) in models(3) {
        let (name, delay) = (model.law().name(), delay as i32);
        let [mut world, mut unchanged] = [(); 2].map(|()| three_wheels(model));
        let mut settings = first_settings();
        assert_eq!(settings_of(&world), settings, "{name}");
        // In the second round every change before the reset applies from the start.
        for round in 0..2 {
            let mut laws = Array2::from_elem((ENVS, 2), law(0.0, 0.0));
            let (mut saturated, mut free, mut apart) = (0, 0, 0.0_f64);
            for n in 0..240 {
                if round == 0 {
                    change(&mut world, &mut settings, n);
                }
                for world in [&mut world, &mut unchanged] {
                    world.set_targets([0, 1, 2].map(|joint| wobble(n, joint)));
                    world.step(1);
                }
                let (q, v, effort) = (world.view().qpos(), world.view().qvel(), world.view().qf());
                let others = unchanged.view().qpos();
                for (at, law) in laws.indexed_iter_mut() {
                    let m = MOMENTS[at.1];
                    let ([stiffness, damping, limit], kind) = &settings;
                    let unit = match kind[at] {
                        DriveType::Force => 1.0,
                        DriveType::Acceleration => m,
                        // For the types set here, only `None` remains.
                        _ => 0.0,
                    };
                    let (kp, kd) = (unit * stiffness[at], unit * damping[at]);
                    *law = Law { m, kp, kd, limit: limit[at], ..*law };
                    let (tau, bound) = law.step_to(if n < delay { [0.0; 3] } else { wobble(n - delay, at.1) });
                    if bound {
                        saturated += 1
                    } else {
                        free += 1
                    }
                    let what = format!("{name}, round {round}, step {n}, environment and joint {at:?}");
                    assert_number(&format!("effort, {what}"), effort[at], tau, EXACT);
                    assert_at([q[at], v[at]], law, &what);
                    apart = apart.max((q[at] - others[at]).abs());
                }
                for env in 0..ENVS {
                    assert_number("the wheel with a row", q[(env, 2)], others[(env, 2)], EXACT);
                }
                assert_eq!(q.row(0), others.row(0), "environment 0 was not named: {name}, step {n}");
            }
            assert!(saturated > 50 && free > 50, "{name}: both sides of the limit: {saturated} {free}");
            assert!(apart > 0.05, "{name}: the control: changes matter: {apart}");
            for world in [&mut world, &mut unchanged] {
                world.sim.reset(None).unwrap();
            }
            assert_eq!(settings_of(&world), settings, "{name}: they stay through a reset");
        }
        world.assert_healthy();
    }
}

/// A motor requires a finite effort limit, for randomized values as for values that are set.
#[test]
fn randomized_limits() {
    for model in ActuatorModel::examples() {
        let mut world = three_wheels(model);
        let unlimited = |sim: &mut SimulationManager, joint: &str, envs: Option<&[EnvId]>| {
            sim.properties_mut().randomize_with(envs, |_, _, all| all.set(Property::MaxEffort, joint, &[f64::INFINITY]))
        };
        let result = unlimited(&mut world.sim, "robot/b", Some(&[EnvId(2)]));
        if let ActuatorModel::DcMotor(_) = model {
            let error = result.unwrap_err();
            let right = matches!(&error, Error::Randomization(RandomizationError::Model { env: 2, name, .. }) if name == "robot/b");
            assert!(right, "{error:?}");
            assert_error(
                Err::<(), _>(error),
                "",
                &["environment 2", "max_effort", "\"robot/b\"", "dc_motor", "finite"],
            );
            assert_eq!(settings_of(&world), first_settings(), "nothing is set");
            // The wheel without a model may be unlimited.
            unlimited(&mut world.sim, "robot/c", None).unwrap();
        } else {
            result.unwrap();
            assert_eq!(world.view().qf_limits()[(2, 1)], f64::INFINITY);
        }
    }
}

//! Explicit actuator models: the law of each, step by step, and what all of them do with a step of the target.
//!
//! For a joint of constant inertia M without other loads MuJoCo's Euler step is v' = v + h tau / M, q' = q + h v', with tau
//! the model's effort at the start of the step. Tolerance 1e-9 over 200 steps, as in `native.rs`: rounding of 1e-16 a step,
//! which stable gains do not let grow.

use crate::drives::worlds::*;
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::sim::drive::actuator::{Scheme, stable_timestep_of, warn_if_unstable};
use kinetoscope::sim::drive::plan::{PlanError, effective_inertias, plan};
use kinetoscope::sim::env::Env;
use kinetoscope::sim::mj::Buffers;
use std::collections::BTreeMap;
use std::sync::Arc;

const EXACT: f64 = 1e-9;
const H: f64 = 0.01;
const M: f64 = 0.2;

fn with(model: impl Into<ActuatorModel>, kp: f64, kd: f64) -> DriveCfg {
    DriveCfg { actuators: vec![(".*".into(), model.into())], max_velocity: Some(7.5.into()), ..gains(kp, kd) }
}

fn clamped(tau: f64, limit: f64) -> f64 {
    tau.min(limit).max(-limit)
}

#[test]
fn ideal_pd_is_the_clamped_sum_at_the_start_of_the_step() {
    let (kp, kd, limit) = (30.0, 1.5, 4.0);
    for integrator in [Integrator::Euler, Integrator::Implicit, Integrator::Rk4] {
        for model in [DriveModel::Implicit, DriveModel::Actuator] {
            let drive = DriveCfg { model, ..with(IdealPd {}, kp, kd) };
            let cfg = SimulationManagerCfg { integrator, ..weightless() };
            let mut world = world(&[Joint::wheel("j", M).effort(limit)], drive, cfg);
            let (mut q, mut v, mut saturated) = (0.0, 0.0, 0);
            for k in 0..200 {
                let [aim, v_aim, ff] = [0.7 * (0.05 * f64::from(k)).sin(), 0.3, 0.1 * f64::from(k % 7)];
                world.aim(&[aim]);
                let mut robot = world.sim.robot_mut(world.robot);
                robot.set_qvel(&row(&[v_aim]), None, None).unwrap();
                robot.set_qf(&row(&[ff]), None, None).unwrap();
                let asked = kp * (aim - q) + kd * (v_aim - v) + ff;
                let tau = clamped(asked, limit);
                saturated += u32::from(tau != asked);
                // RK4 holds the effort, too: exact for a constant force.
                let before = v;
                v += H * tau / M;
                q += H * if integrator == Integrator::Rk4 { 0.5 * (before + v) } else { v };
                world.step(1);
                assert_close(world.effort()[0], tau, EXACT, "effort");
                assert_close(world.v()[0], v, EXACT, "velocity");
                assert_close(world.q()[0], q, EXACT, "position");
            }
            assert!((10..190).contains(&saturated), "both sides of the limit: {saturated}");
        }
    }
}

/// Stall 120 N m, continuous 80 N m, 7.5 rad/s without load: the corners and lines of the four quadrants.
#[test]
fn a_dc_motor_gives_less_the_faster_it_turns() {
    // Speed, effort asked for, effort given.
    let table = [
        (0.0, 500.0, 80.0),
        (0.0, 30.0, 30.0),
        (2.5, 500.0, 80.0),
        (3.75, 500.0, 60.0),
        (3.75, 10.0, 10.0),
        (3.75, -500.0, -80.0),
        (7.5, 500.0, 0.0),
        // Faster than without load it brakes, whatever is asked for.
        (9.0, 500.0, -24.0),
        (9.0, 0.0, -24.0),
        (12.5, 500.0, -80.0),
        (40.0, 500.0, -80.0),
        (40.0, -500.0, -80.0),
    ];
    let drive = with(DcMotor { saturation_effort: 120.0 }, 0.0, 0.0);
    let world =
        world(&[Joint::wheel("j", M).effort(80.0)], DriveCfg { max_velocity: Some(7.5.into()), ..drive }, weightless());
    for (speed, asked, given) in table {
        for sign in [1.0, -1.0] {
            let mut env = world.env();
            push(&mut env, &[0.0], &[sign * speed]);
            env.drives.feedforward[0] = sign * asked;
            step(&mut env);
            let what = format!("{asked} N m at {speed} rad/s, sign {sign}");
            // Products of numbers up to 300: rounding of 1e-13.
            assert_close(env.drives.effort[0], sign * given, 1e-12, &what);
            assert_close(env.data().qvel()[0], sign * (speed + H * given / M), EXACT, &what);
        }
    }
    // Below the lines it is the ideal controller, with its gains.
    let (kp, kd) = (40.0, 5.0);
    let world = self::world(
        &[Joint::wheel("j", M).effort(80.0)],
        with(DcMotor { saturation_effort: 120.0 }, kp, kd),
        weightless(),
    );
    let mut env = world.env();
    push(&mut env, &[0.1], &[1.0]);
    env.drives.position[0] = 0.5;
    env.drives.velocity[0] = 2.0;
    step(&mut env);
    assert_close(env.drives.effort[0], kp * 0.4 + kd * 1.0, EXACT, "inside of the lines");
}

/// The speed without load is per environment: at v a motor gives at most s (1 - v / v_max).
#[test]
fn speeds_without_load_differ_between_environments() {
    let cfg = SimulationManagerCfg { num_envs: 2, ..weightless() };
    let wheel = Joint::wheel("j", M).effort(100.0);
    let mut world = world(&[wheel], with(DcMotor { saturation_effort: 6.0 }, 0.0, 0.0), cfg);
    let mut robot = world.sim.robot_mut(world.robot);
    robot.set_qvel_limits(&array![[3.0]], None, Some(&[EnvId(1)])).unwrap();
    robot.write_qvel(&array![[1.5]], None, None).unwrap();
    robot.set_qf(&array![[100.0]], None, None).unwrap();
    world.step(1);
    let effort = world.view().get_qf();
    assert_close(effort[(0, 0)], 6.0 * (1.0 - 1.5 / 7.5), EXACT, "7.5 rad/s");
    assert_close(effort[(1, 0)], 6.0 * (1.0 - 1.5 / 3.0), EXACT, "3 rad/s");
    for bad in [0.0, f64::INFINITY] {
        let before = world.view().qvel_limits();
        let error = world.sim.robot_mut(world.robot).set_qvel_limits(&array![[bad]], None, None).unwrap_err();
        assert!(matches!(error, Error::OutOfRange { argument: "set_qvel_limits", .. }), "{error}");
        assert!(error.to_string().contains("dc_motor"), "{error}");
        assert_eq!(world.view().qvel_limits(), before);
    }
    // A motor without a continuous limit would brake without end.
    let before = world.view().qf_limits();
    let error = world.sim.robot_mut(world.robot).set_qf_limits(&array![[f64::INFINITY]], None, None).unwrap_err();
    assert!(matches!(error, Error::OutOfRange { argument: "set_qf_limits", row: 0, column: 0, .. }), "{error}");
    assert!(error.to_string().contains("dc_motor") && error.to_string().contains("joint \"j\""), "{error}");
    assert_eq!(world.view().qf_limits(), before);
    world.sim.robot_mut(world.robot).set_qf_limits(&array![[2.0]], None, None).unwrap();
    world.sim.robot_mut(world.robot).write_qvel(&array![[1.5]], None, None).unwrap();
    world.step(1);
    assert_eq!(world.view().get_qf(), array![[2.0], [2.0]], "below the lines, 4.8 and 3 N m");
}

/// With full throttle from rest tau = s (1 - v / v_max) in every step: with r = 1 - h s / (M v_max),
/// v_n = v_max (1 - r^n) and q_n = h (v_1 + ... + v_n) = h v_max (n - r (1 - r^n) / (1 - r)). That settles while |r| < 1;
/// beyond, the motor overshoots until its limit holds it, and `add_robot` has warned.
#[test]
fn a_dc_motor_runs_up_its_line_and_warns_where_that_is_not_stable() {
    let stall = 6.0;
    for (slope, stable) in [(0.8, true), (10.0, true), (39.0, true), (41.0, false)] {
        let top = stall / slope;
        let drive = with(DcMotor { saturation_effort: stall }, 0.0, 0.0);
        let drive = DriveCfg { max_velocity: Some(top.into()), ..drive };
        let mut world = world(&[Joint::wheel("j", M).effort(1.5 * stall)], drive, weightless());
        let warned = world.sim.warning_counts().keys().any(|name| name.contains("unstable"));
        assert_eq!(warned, !stable, "slope {slope}");
        world.sim.robot_mut(world.robot).set_qf(&array![[1e4]], None, None).unwrap();
        let r = 1.0 - H * slope / M;
        for n in 1..=200 {
            world.step(1);
            let power = r.powi(n);
            if stable {
                let q = H * top * (f64::from(n) - r * (1.0 - power) / (1.0 - r));
                assert_close(world.v()[0], top * (1.0 - power), EXACT, &format!("velocity, slope {slope}, step {n}"));
                assert_close(world.q()[0], q, EXACT, &format!("position, slope {slope}, step {n}"));
            }
        }
        let off = (world.v()[0] / top - 1.0).abs();
        // 0.96^200 is 3e-4, 0.95^200 3e-5; the oscillation ends at the limit, 1.5 of v_max away.
        assert_eq!(off < 1e-3, stable, "slope {slope}: {off}");
        assert!(stable || off > 1.0, "slope {slope}: {off}");
    }
}

/// All three targets of step n, wobbling.
fn wobble(n: i32) -> [f64; 3] {
    let n = f64::from(n);
    [0.5 * (0.31 * n).sin(), 0.2 * (0.7 * n).cos(), 0.3 * (1.1 * n).sin()]
}

fn set_targets(world: &mut World, [q, v, tau]: [f64; 3]) {
    let mut robot = world.sim.robot_mut(world.robot);
    robot.set_qpos(&row(&[q]), None, None).unwrap();
    robot.set_qvel(&row(&[v]), None, None).unwrap();
    robot.set_qf(&row(&[tau]), None, None).unwrap();
}

/// Each environment hears of the targets its own number of steps later; before, of the start.
#[test]
fn delayed_targets_arrive_in_their_order_in_each_environment() {
    let (kp, kd) = (25.0, 1.0);
    let delays = [0, 1, 3, 6];
    let cfg = SimulationManagerCfg { num_envs: delays.len(), ..weightless() };
    let drive = with(DelayedPd { delay: 1, max_delay: 6 }, kp, kd);
    let mut world = world(&[Joint::wheel("j", M)], drive, cfg);
    assert_eq!(world.view().get_delay(), Array2::from_elem((4, 1), 1));
    world.sim.robot_mut(world.robot).set_delay(&array![[0_u32], [1], [3], [6]], None, None).unwrap();
    for round in 0..2 {
        let (mut state, mut apart) = ([[0.0_f64; 2]; 4], 0.0_f64);
        for n in 0..200 {
            set_targets(&mut world, wobble(n));
            if n == 100 {
                // What is under way is carried over to a new model.
                let ball = ObjectShape::Sphere { radius: 0.1 };
                let uid = format!("ball{round}");
                let at = Pose::translation(5.0, round as f64, 5.0);
                let ball = RigidObjectCfg { uid, shape: ball, init_pose: at, ..Default::default() };
                world.sim.add_rigid_object(ball).unwrap();
            }
            world.step(1);
            let (q, v) = (world.view().get_qpos(), world.view().get_qvel());
            for (env, (&delay, [x, u])) in delays.iter().zip(&mut state).enumerate() {
                let [aim, v_aim, ff] = if n < delay { [0.0; 3] } else { wobble(n - delay) };
                *u += H / M * (kp * (aim - *x) + kd * (v_aim - *u) + ff);
                *x += H * *u;
                assert_close(v[(env, 0)], *u, EXACT, &format!("velocity, delay {delay}, step {n}, round {round}"));
                assert_close(q[(env, 0)], *x, EXACT, &format!("position, delay {delay}, step {n}, round {round}"));
            }
            apart = apart.max((state[0][0] - state[3][0]).abs());
        }
        assert!(apart > 0.05, "the control: a delay shows: {apart}");
        // A reset forgets what is under way, and keeps the delays.
        world.sim.reset(None).unwrap();
        assert_eq!(world.view().get_delay().column(0).to_vec(), [0, 1, 3, 6]);
    }
}

/// Step n hears the targets of step n - d(n): the last ones again where the delay grows, some never where it falls.
#[test]
fn delays_that_change_in_motion_repeat_or_skip_targets() {
    let (kp, kd) = (25.0, 1.0);
    let mut world = world(&[Joint::wheel("j", M)], with(DelayedPd { delay: 2, max_delay: 7 }, kp, kd), weightless());
    // First step and delay from there on; the first one is longer than anything has been set for.
    let changes = [(1, 7), (20, 2), (50, 5), (100, 1), (110, 0), (120, 7), (150, 0)];
    let (mut delay, mut x, mut u) = (2, 0.0_f64, 0.0_f64);
    let mut heard = Vec::new();
    for n in 0..180 {
        if let Some((_, changed)) = changes.iter().find(|(at, _)| *at == n) {
            delay = *changed;
            world.sim.robot_mut(world.robot).set_delay(&array![[delay as u32]], None, None).unwrap();
        }
        set_targets(&mut world, wobble(n));
        world.step(1);
        heard.push(n - delay);
        let [aim, v_aim, ff] = if n < delay { [0.0; 3] } else { wobble(n - delay) };
        u += H / M * (kp * (aim - x) + kd * (v_aim - u) + ff);
        x += H * u;
        assert_close(world.v()[0], u, EXACT, &format!("velocity, step {n}"));
        assert_close(world.q()[0], x, EXACT, &format!("position, step {n}"));
    }
    // What the documents say of it: from 2 to 5 steps three targets act again, from 5 to 1 four never do.
    assert_eq!(heard[48..55], [46, 47, 45, 46, 47, 48, 49]);
    assert_eq!(heard[98..102], [93, 94, 99, 100]);
}

/// A target that was set in a wide range and acts in a tight one acts at the end of the tight one, and one that waits until
/// the range is wide again as it was set.
#[test]
fn targets_that_are_under_way_stay_inside_of_limits_that_are_set_later() {
    let (kp, kd, delay) = (25.0, 1.0, 5);
    let mut world = world(&[Joint::wheel("j", M)], with(DelayedPd { delay, max_delay: 0 }, kp, kd), weightless());
    let (wide, tight) = ([f64::NEG_INFINITY, f64::INFINITY], [-0.1, 0.15]);
    let clamp = |[low, high]: [f64; 2], x: f64| x.max(low).min(high);
    let (mut set, mut x, mut u) = (Vec::new(), 0.0_f64, 0.0_f64);
    let (mut cut, mut spared) = (0, 0);
    for n in 0..200 {
        let range = if n % 40 >= 20 && n % 40 < 23 { tight } else { wide };
        if [0, 20, 23].contains(&(n % 40)) {
            world.sim.robot_mut(world.robot).set_qpos_limits(&array![[[range[0], range[1]]]], None, None).unwrap();
        }
        set_targets(&mut world, wobble(n));
        world.step(1);
        let [q, v, tau] = wobble(n);
        set.push([clamp(range, q), v, tau]);
        let heard = set.len().checked_sub(1 + delay as usize).map_or([0.0; 3], |k| set[k]);
        let aim = clamp(range, heard[0]);
        cut += u32::from(aim != heard[0]);
        // Set before the range was tight, it acts after.
        spared += u32::from(n % 40 >= 23 && n % 40 < 25 && clamp(tight, aim) != aim);
        u += H / M * (kp * (aim - x) + kd * (heard[1] - u) + heard[2]);
        x += H * u;
        assert_close(world.v()[0], u, EXACT, &format!("velocity, step {n}"));
        assert_close(world.q()[0], x, EXACT, &format!("position, step {n}"));
    }
    assert!(cut > 3 && spared > 3, "the control: {cut} were clamped when they acted, {spared} were not");
}

/// A step that is done again, because its buffers were too small, is one step of the delay line.
#[test]
fn a_step_that_is_done_again_delays_nothing_twice() {
    let joints = ["a", "b", "c"].map(|name| Joint::wheel(name, M).range(-0.02, 0.02));
    let world = world(&joints, with(DelayedPd { delay: 3, max_delay: 0 }, 25.0, 1.0), weightless());
    let sized = |buffers: Buffers| {
        let (model, drives) = world.sim.batch().read(0, |env| (env.data().model().clone(), env.drives.clone()));
        let mut env = Env::new(&model.with_buffers(buffers), &Arc::clone(drives.table())).unwrap();
        env.drives = drives;
        env
    };
    // One size for each line of MuJoCo: rows of constraints on 2.2.2, one arena on 4.x.
    let huge = Buffers { contacts: 100, constraints: 100, arena_bytes: 1 << 20 };
    let sizes = (0..40).map(|i| Buffers { constraints: 1, arena_bytes: (512.0 * 1.15_f64.powi(i)) as usize, ..huge });
    let mut in_motion = 0;
    for size in sizes {
        let (mut small, mut large) = (sized(size), sized(huge));
        let before = small.growths();
        for n in 0..60 {
            for env in [&mut small, &mut large] {
                for drive in 0..3 {
                    // The stops are hit one after the other: each needs a row more.
                    env.drives.feedforward[drive] = 20.0 * (0.3 * f64::from(n) - drive as f64).sin();
                }
                step(env);
            }
            assert_eq!(small.data().qpos(), large.data().qpos(), "step {n}, {size:?}");
            assert_eq!(small.drives, large.drives, "step {n}, {size:?}");
        }
        in_motion += small.growths() - before;
        assert_eq!(large.growths(), 0);
    }
    assert!(in_motion > 0, "some step was done again");
}

/// Underdamped second order: M q'' = kp (q* - q) - kd q' from rest,
/// q = q* (1 - exp(-z w t) (cos(d t) + z w / d sin(d t))), w² = kp / M, z = kd / (2 M w), d = w sqrt(1 - z²); later by the
/// delay. Euler's method is of first order: the error is about h times the acceleration's scale, and half of it with half
/// the step. The bound 5 h w q* holds for z = 0.5; the control is the ratio of the errors.
#[test]
fn every_model_answers_a_step_with_the_solution_of_second_order() {
    let (m, w, z, aim) = (0.1_f64, 10.0_f64, 0.5_f64, 0.05);
    let (kp, kd, d) = (m * w * w, 2.0 * m * z * w, w * (1.0 - z * z).sqrt());
    let mut models = ActuatorModel::examples();
    models.push(DelayedPd { delay: 7, max_delay: 0 }.into());
    for model in models {
        let delay = if let ActuatorModel::DelayedPd(model) = model { model.delay } else { 0 };
        let error = |h: f64| {
            let drive = DriveCfg { max_velocity: Some(1e6.into()), ..with(model, kp, kd) };
            let mut world = world(&[Joint::wheel("j", m).effort(100.0)], drive, at_dt(h, weightless()));
            world.aim(&[aim]);
            let mut worst = 0.0_f64;
            for n in 1..=(1.0 / h).round() as u32 {
                world.step(1);
                let t = f64::from(n.saturating_sub(delay)) * h;
                let (sin, cos) = (d * t).sin_cos();
                let exact = aim * (1.0 - (-z * w * t).exp() * (cos + z * w / d * sin));
                worst = worst.max((world.q()[0] - exact).abs());
            }
            assert_close(world.q()[0], aim, 0.01 * aim, "after five time constants");
            worst
        };
        let (one, half) = (error(1e-3), error(5e-4));
        println!("{}: largest error {one:.1e} rad with 1 ms, {half:.1e} rad with 0.5 ms", model.law().name());
        assert!(one < 5.0 * 1e-3 * w * aim, "{model:?}: {one}");
        assert!((1.8..2.2).contains(&(one / half)), "{model:?}: {one} {half}");
    }
}

/// Models are chosen by joint; others are driven as the robot is. Gains change at run time as those of other drives do.
#[test]
fn models_and_rows_go_together() {
    let (kp, kd) = (60.0, 4.0);
    let joints = [Joint::wheel("a", M), Joint::wheel("b", M), Joint { friction: 0.5, ..Joint::wheel("c", M) }];
    let drive = DriveCfg { actuators: vec![("[bc]".into(), IdealPd {}.into())], ..gains(kp, kd) };
    let mut world = world(&joints, drive, weightless());
    world.aim(&[0.4; 3]);
    world.step(1);
    assert_close(world.v()[0], H * kp * 0.4 / (M + H * kd + H * H * kp), EXACT, "at the end of the step");
    assert_close(world.v()[1], H * kp * 0.4 / M, EXACT, "at its start");
    // With dry friction: h (tau - f) / M.
    assert_close(world.v()[2], H * (kp * 0.4 - 0.5) / M, EXACT, "with friction");
    world.sim.reset(None).unwrap();
    world.aim(&[0.4; 3]);
    let mut robot = world.sim.robot_mut(world.robot);
    robot.set_stiffness(&array![[20.0]], Some(&[JointIndex(1)]), None).unwrap();
    robot.set_qf_limits(&array![[3.0]], Some(&[JointIndex(1)]), None).unwrap();
    world.step(1);
    assert_close(world.v()[1], H * 3.0 / M, EXACT, "8 N m, clamped to 3");
    world.sim.robot_mut(world.robot).set_qf_limits(&array![[500.0]], Some(&[JointIndex(1)]), None).unwrap();
    world.sim.reset(None).unwrap();
    world.aim(&[0.4; 3]);
    world.step(1);
    assert_close(world.v()[1], H * 20.0 * 0.4 / M, EXACT, "no limit of the model is in the way");
    world.assert_well();
}

/// Gains that are not stable at this time step are a warning with the largest one, as for MuJoCo's actuators.
#[test]
fn explicit_models_warn_where_they_are_not_stable() {
    let warned = |kp: f64| {
        let world = world(&[Joint::wheel("j", M)], with(IdealPd {}, kp, 1.0), weightless());
        world.sim.warning_counts().keys().any(|name| name.contains("unstable"))
    };
    // h² kp + 2 h kd = 4 M: kp = (0.8 - 0.02) / 1e-4 = 7800.
    assert!(!warned(7700.0) && warned(7900.0));
}

/// h² kp + 2 h kd = 4 I with the inertia I of a wheel and, times the square of its ratio, of the one that follows it.
#[test]
fn the_largest_stable_step_is_the_root_of_its_law() {
    let (kp, kd, ratio) = (200.0, 4.0, -2.0);
    let [leader, follower] = [0.3, 0.05];
    let joints = [Joint::wheel("a", leader), Joint { mimic: Some(("a".into(), ratio)), ..Joint::wheel("b", follower) }];
    let world = world(&joints, gains(kp, kd), weightless());
    let description = world.view().description();
    let (plans, _) = plan(description, &gains(kp, kd), &BTreeMap::new(), &[], false).unwrap();
    // The two do not feel each other but through the coupling, which is not in the mass matrix.
    let felt = effective_inertias(description, &plans, false).unwrap();
    assert_close(felt[0], leader, 1e-12, "inertia of a");
    assert_close(felt[1], follower, 1e-12, "inertia of b");
    let of = |inertia: f64| ((kd * kd + 4.0 * inertia * kp).sqrt() - kd) / kp;
    let (expected, alone) = (of(leader + ratio * ratio * follower), of(leader));
    let found = stable_timestep_of(Scheme::Explicit, description, &plans, false).unwrap();
    // Bisected to 1e-9 of it.
    assert_close(found / expected, 1.0, 2e-9, "largest step");
    assert!((found / alone - 1.0).abs() > 0.1, "the control: the follower matters");
    assert!(warn_if_unstable(description, &plans, false, 0.99 * expected).is_none());
    let warning = warn_if_unstable(description, &plans, false, 1.01 * expected).unwrap().to_string();
    assert!(warning.contains(&format!("{found:.3e} s")) && warning.contains("substeps"), "{warning}");
}

#[test]
fn models_that_do_not_go_with_their_joints_are_refused() {
    let plain = || DriveCfg { max_velocity: None, ..with(DcMotor { saturation_effort: 5.0 }, 1.0, 0.1) };
    let named = |key: &str| DriveCfg { actuators: vec![(key.into(), IdealPd {}.into())], ..gains(1.0, 0.1) };
    let twice = DriveCfg {
        actuators: vec![("j".into(), IdealPd {}.into()), (".*".into(), DelayedPd::default().into())],
        ..gains(1.0, 0.1)
    };
    let cases: Vec<(DriveCfg, &[&str])> = vec![
        (plain(), &["dc_motor of joint \"j\"", "max_velocity is inf", "velocity limit"]),
        (
            with(DcMotor { saturation_effort: 5.0 }, 1.0, 0.1),
            &["dc_motor of joint \"j\"", "max_effort is inf", "effort limit"],
        ),
        (with(DcMotor { saturation_effort: 0.0 }, 1.0, 0.1), &["saturation_effort is 0", "above 0"]),
        (with(DcMotor { saturation_effort: f64::NAN }, 1.0, 0.1), &["saturation_effort is NaN"]),
        (with(DelayedPd { delay: 10_001, max_delay: 0 }, 1.0, 0.1), &["delayed_pd", "10001", "10000"]),
        (with(DelayedPd { delay: 0, max_delay: u32::MAX }, 1.0, 0.1), &["delayed_pd", "10000"]),
        (named("J"), &["actuators", "\"J\"", "\"j\""]),
        (twice, &["actuators", "matched by both"]),
    ];
    for (drive, expected) in cases {
        let what = format!("{drive:?}");
        let error = try_world(&[Joint::wheel("j", M)], drive, weightless()).unwrap_err();
        assert!(matches!(&*error, Error::Plan { .. }), "{error}");
        if let Error::Plan { error: plan, .. } = &*error {
            assert!(matches!(**plan, PlanError::ActuatorModel { .. } | PlanError::Drive(_)), "{error}");
        }
        for part in expected {
            assert!(error.to_string().contains(part), "{part:?} is not in {error}, of {what}");
        }
    }
    // A velocity limit in the file is enough; a passive joint needs none.
    try_world(&[Joint::wheel("j", M).effort(5.0)], plain(), weightless()).unwrap();
    try_world(&[Joint::wheel("j", M)], DriveCfg { drive_type: DriveType::None, ..plain() }, weightless()).unwrap();
}

#[test]
fn delays_that_cannot_be_are_refused_and_nothing_is_set() {
    let joints = [Joint::wheel("a", M), Joint::wheel("b", M)];
    let drive =
        DriveCfg { actuators: vec![("a".into(), DelayedPd { delay: 2, max_delay: 5 }.into())], ..gains(1.0, 0.1) };
    let cfg = SimulationManagerCfg { num_envs: 2, ..weightless() };
    let mut world = world(&joints, drive, cfg);
    let first = [JointIndex(0)];
    let mut refused = |steps: Array2<u32>, joints: Option<&[JointIndex]>, envs: Option<&[EnvId]>, part: &str| {
        let message = world.sim.robot_mut(world.robot).set_delay(&steps, joints, envs).unwrap_err().to_string();
        assert!(message.contains("set_delay") || message.contains("does not exist"), "{message}");
        assert!(message.contains(part), "{part:?} is not in {message}");
        assert_eq!(world.view().get_delay(), array![[2, 0], [2, 0]]);
    };
    refused(array![[5], [6]], Some(&first), None, "set_delay[1, 0] (joint \"a\") is 6; it must be at most 5");
    refused(array![[u32::MAX]], Some(&first), None, "at most 5");
    refused(array![[1, 1]], None, None, "joint \"b\"");
    refused(array![[1]], None, None, "[1, 1]");
    refused(array![[1]], Some(&[JointIndex(7)]), None, "joint 7");
    refused(array![[1, 3]], Some(&[JointIndex(0); 2]), None, "set_delay names joint \"a\" twice");
    refused(array![[1], [3]], Some(&first), Some(&[EnvId(1); 2]), "set_delay names environment 1 twice");
    refused(array![[1]], Some(&first), Some(&[EnvId(2)]), "environment 2");
}

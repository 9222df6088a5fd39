//! `DriveModel::Actuator`: MuJoCo's own actuator, the law at the start of the step.
//!
//! ```text
//! v' = v + h clamp(kp (q* - q) + kd (v* - v) + tau_ff) / M,   with joint damping B: (M + h B)(v' - v) = h (tau - B v)
//! ```
//!
//! Tolerance 1e-9 over 200 steps. Stable while 4 M + 2 h B - 2 h Kd - h² Kp is positive definite; beyond, `add_robot`
//! warns and names the largest step. Judge of that number: MuJoCo alone on the same document, 2 % below and above.
//! Integrators: row drives with RK4 are an error; RK4 with actuators integrates with order 4: a pendulum keeps its
//! energy to 1e-6 where Euler's error is 1e-3.

use crate::drives::worlds::*;
use kinetoscope::prelude::*;
use kinetoscope::sim::{DiagnosticKind, mj};

const EXACT: f64 = 1e-9;
const H: f64 = 0.01;

fn native(kp: f64, kd: f64) -> DriveCfg {
    DriveCfg { model: DriveModel::Actuator, ..gains(kp, kd) }
}

fn unstable(world: &World) -> Vec<String> {
    let found = world.sim.diagnostics().iter().filter(|d| d.kind == DiagnosticKind::ActuatorUnstable);
    found.map(|d| d.message.clone()).collect()
}

#[test]
fn inside_its_domain_the_actuator_is_the_explicit_law() {
    let m = 0.3;
    for (kp, kd, b, limit, aim) in [
        (200.0, 4.0, 0.0, 2.0, [0.5, 0.0, 0.0]),
        (200.0, 4.0, 1.5, 9e9, [0.5, -0.3, 4.0]),
        (0.0, 4.0, 0.0, 9e9, [0.5, 0.7, -1.0]),
        (0.0, 0.0, 0.2, 9e9, [0.5, 0.7, 1.3]),
    ] {
        let joint = Joint { damping: b, ..Joint::wheel("j", m) }.effort(limit);
        let world = world(&[joint], native(kp, kd), weightless());
        assert_eq!(unstable(&world), [""; 0]);
        let mut env = world.env();
        let [q_aim, v_aim, ff] = aim;
        env.drives.position[0] = q_aim;
        env.drives.velocity[0] = v_aim;
        env.drives.feedforward[0] = ff;
        let (mut q, mut v, mut clamped) = (0.0, 0.0, 0);
        for _ in 0..200 {
            step(&mut env);
            let asked: f64 = kp * (q_aim - q) + kd * (v_aim - v) + ff;
            let tau = asked.clamp(-limit, limit);
            clamped += usize::from(tau != asked);
            v += H * (tau - b * v) / (m + H * b);
            q += H * v;
            assert_close(env.drives.effort[0], tau, EXACT, "effort");
            assert_close(env.data().qpos()[0], q, EXACT, "position");
            assert_close(env.data().qvel()[0], v, EXACT, "velocity");
        }
        assert_eq!(clamped > 0, limit < 3.0);
    }
}

/// Both models are discretizations of one law: at dt 1e-4 they agree within O(dt) of 0.5 rad.
#[test]
fn both_models_agree_at_a_small_step() {
    let run = |model| {
        let drive = DriveCfg { model, ..gains(200.0, 4.0) };
        let mut world = world(&[Joint::lever("j", 0.5, 0.2, 0.01).effort(6.0)], drive, at_dt(1e-4, earth()));
        world.aim(&[0.5]);
        world.step(2000);
        world.q()[0]
    };
    let (a, b) = (run(DriveModel::Implicit), run(DriveModel::Actuator));
    println!("after 0.2 s at dt 1e-4: implicit {a:.6}, actuator {b:.6}");
    assert!((a - b).abs() < 2e-3, "{a} {b}");
}

/// Largest speed after `steps` of plain MuJoCo from a slight motion, relative to it.
fn growth(xml: &str, h: f64, steps: usize) -> f64 {
    let from = xml.find("timestep=\"").unwrap() + "timestep=\"".len();
    let to = from + xml[from..].find('"').unwrap();
    let mut data = plain(&format!("{}{h:e}{}", &xml[..from], &xml[to..]));
    let start = 1e-9;
    for (i, v) in data.qvel_mut().iter_mut().enumerate() {
        *v = if i % 2 == 0 { start } else { -start };
    }
    for _ in 0..steps {
        data.step().unwrap();
        if data.qvel().iter().any(|v| v.abs() > 1e3 * start) {
            return f64::INFINITY;
        }
    }
    data.qvel().iter().fold(0.0_f64, |m, v| m.max(v.abs())) / start
}

fn printed_bound(world: &World) -> f64 {
    let messages = unstable(world);
    assert_eq!(messages.len(), 1, "{messages:?}");
    assert!(messages[0].contains("time step is 0.01 s"), "{}", messages[0]);
    let after = messages[0].split("time step of ").nth(1).unwrap();
    after.split(' ').next().unwrap().parse().unwrap()
}

#[test]
fn the_printed_largest_step_is_where_mujoco_turns_unstable() {
    let a = Joint::lever("a", 1.0, 0.2, 0.01);
    let b = Joint::lever("b", 0.2, 0.1, 1e-3).after(&a, [0.4, 0.0, 0.0]);
    let damped = vec![Joint { damping: 2.0, ..a.clone() }, Joint { damping: 12.0, ..b.clone() }];
    let wheel = Joint::wheel("w", 0.01);
    let follower = Joint { mimic: Some(("w".into(), 1.5)), ..Joint::wheel("f", 0.03) };
    let cases = [
        ("one joint", vec![Joint::wheel("j", 1e-3)], (200.0, 4.0)),
        ("stiff", vec![Joint::wheel("j", 1e-3)], (1e4, 0.0)),
        ("two joints", vec![a, b], (2000.0, 30.0)),
        ("damped joints", damped, (2000.0, 30.0)),
        ("a follower", vec![wheel, follower], (1e4, 40.0)),
        ("arm and hand", arm_and_hand(), (1e3, 1e2)),
    ];
    for (name, joints, (kp, kd)) in cases {
        let world = world(&joints, native(kp, kd), weightless());
        let bound = printed_bound(&world);
        let (below, above) =
            (growth(world.sim.mjcf(), 0.98 * bound, 3000), growth(world.sim.mjcf(), 1.02 * bound, 3000));
        println!("{name}: bound {bound:.3e} s; growth 2 % below {below:.1e}, above {above:.1e}");
        assert!(below < 10.0 && above == f64::INFINITY, "{name}: {below} {above}");
    }
}

#[test]
fn row_drives_refuse_integrators_that_change_the_solution() {
    let with = |integrator, drive| {
        try_world(&[Joint::wheel("j", 0.1)], drive, SimulationManagerCfg { integrator, ..weightless() })
    };
    for integrator in [Integrator::Rk4, Integrator::Implicit] {
        let error = with(integrator, gains(10.0, 1.0)).unwrap_err();
        let Error::Integrator { integrator: named, .. } = &*error else { panic!("{error}") };
        assert_eq!(*named, integrator.name());
        assert!(error.to_string().contains("DriveModel::Actuator"), "{error}");
        with(integrator, native(10.0, 1.0)).unwrap();
        with(integrator, DriveCfg { drive_type: DriveType::None, ..Default::default() }).unwrap();
    }
    // A robot has rows only for joints without a model of their own (`actuators.rs` has the laws).
    for integrator in [Integrator::Rk4, Integrator::Implicit] {
        let of = |pattern: &str| {
            let drive = DriveCfg { actuators: vec![(pattern.into(), IdealPd {}.into())], ..gains(10.0, 1.0) };
            let joints = [Joint::wheel("a", 0.1), Joint::wheel("b", 0.1)];
            try_world(&joints, drive, SimulationManagerCfg { integrator, ..weightless() })
        };
        of("[ab]").unwrap();
        assert!(matches!(*of("a").unwrap_err(), Error::Integrator { .. }), "joint b is a row");
    }
    let fast = with(Integrator::ImplicitFast, gains(10.0, 1.0));
    match mj::TARGET {
        mj::Target::V2 => assert!(matches!(*fast.unwrap_err(), Error::IntegratorUnknown { .. })),
        mj::Target::V4 => {
            // The law holds with implicitfast too.
            let mut world = fast.unwrap();
            world.aim(&[0.5]);
            world.step(1);
            assert_close(world.v()[0], H * 10.0 * 0.5 / (0.1 + H * 1.0 + H * H * 10.0), EXACT, "velocity");
        }
    }
}

/// The solver's acceleration, which `get_qacc` tells, is that of the force, a = -B v / M. MuJoCo's Euler takes the damping at
/// the end of the step, v' = v + h M a / (M + h B). Row drives do that inside the solver: there they are the same.
#[test]
fn accelerations_are_the_solvers() {
    let (m, b, speed) = (0.2, 0.5, 2.0);
    let after_a_step = |drive, integrator| {
        let joint = Joint { damping: b, ..Joint::wheel("j", m) };
        let mut world = world(&[joint], drive, SimulationManagerCfg { integrator, ..weightless() });
        world.sim.robot_mut(world.robot).write_qvel(&row(&[speed]), None, None).unwrap();
        world.step(1);
        (world.view().get_qacc()[(0, 0)], (world.v()[0] - speed) / H)
    };
    let felt = -b * speed / (m + H * b);
    let (a, change) = after_a_step(native(0.0, 0.0), Integrator::Euler);
    assert_close(a, -b * speed / m, EXACT, "the solver's");
    assert_close(change, felt, EXACT, "the change of the velocity");
    let (a, change) = after_a_step(gains(0.0, 0.0), Integrator::Euler);
    assert_close(a, felt, EXACT, "of a row drive");
    assert_close(change, felt, EXACT, "of a row drive");
    let (a, change) = after_a_step(native(0.0, 0.0), Integrator::Rk4);
    assert!((a - change).abs() > 0.01, "RK4: {a} {change}");
}

/// Energy of a pendulum after 2 s at dt 0.01, free and with a spring drive; decay of a damped wheel.
#[test]
fn rk4_is_really_integrated_with_rk4() {
    let (mass, length, moment) = (0.5, 0.2, 0.01);
    let about_axis = moment + mass * length * length;
    let drift = |integrator, drive: DriveCfg, kp: f64| {
        let cfg = SimulationManagerCfg { integrator, ..earth() };
        let mut world = world(&[Joint::lever("j", mass, length, moment)], drive, cfg);
        let energy = |q: f64, v: f64| 0.5 * about_axis * v * v - mass * 9.81 * length * q.sin() + 0.5 * kp * q * q;
        let start = energy(0.0, 0.0);
        let mut worst = 0.0_f64;
        for _ in 0..200 {
            world.step(1);
            worst = worst.max((energy(world.q()[0], world.v()[0]) - start).abs());
        }
        worst
    };
    let passive = || DriveCfg { drive_type: DriveType::None, ..Default::default() };
    for (drive, kp) in [(passive(), 0.0), (native(5.0, 0.0), 5.0)] {
        let (rk4, euler) = (drift(Integrator::Rk4, drive.clone(), kp), drift(Integrator::Euler, drive, kp));
        println!("kp {kp}: energy drifts by {rk4:.1e} J with RK4, {euler:.1e} J with Euler");
        assert!(rk4 < 1e-5 && euler > 1e-3, "{rk4} {euler}");
    }

    let cfg = SimulationManagerCfg { integrator: Integrator::Rk4, ..weightless() };
    for drive in [passive(), native(0.0, 0.0)] {
        let world = world(&[Joint { damping: 0.5, ..Joint::wheel("j", 0.2) }], drive, cfg.clone());
        let mut env = world.env();
        push(&mut env, &[0.0], &[3.0]);
        env.step(100);
        assert_close(env.data().qvel()[0], 3.0 * f64::exp(-0.5 / 0.2), 5e-9, "decay over 1 s");
    }
}

//! `DriveModel::Actuator`: MuJoCo's own actuator, with the law at the start of the step (`law.rs` compares it with the
//! recurrence), and the integrators.
//!
//! It is stable while 4 M + 2 h B - 2 h Kd - h² Kp is positive definite; beyond, `add_robot` warns and names the
//! largest step. Reference of that number: MuJoCo alone on the same document, 2 % below and above. Integrators: row
//! drives with RK4 are an error. RK4 with actuators integrates with order 4: a pendulum keeps its energy to 1e-6, where
//! Euler's error is 1e-3.

use crate::drives::law::EXACT;
use crate::drives::worlds::*;
use kinetoscope::mujoco as mj;
use kinetoscope::prelude::*;
use kinetoscope::robot::diagnostic::DiagnosticKind;
use kinetoscope::sim::{Error, IdealPd, Integrator};

/// Largest speed after 3000 steps of plain MuJoCo from a slight motion, relative to the initial speed.
fn growth(xml: &str, h: f64) -> f64 {
    let from = xml.find("timestep=\"").unwrap() + "timestep=\"".len();
    let to = from + xml[from..].find('"').unwrap();
    let mut data = plain(&format!("{}{h:e}{}", &xml[..from], &xml[to..]));
    let start = 1e-9;
    for (i, v) in data.qvel_mut().iter_mut().enumerate() {
        *v = if i % 2 == 0 { start } else { -start };
    }
    for _ in 0..3000 {
        data.step().unwrap();
        if data.qvel().iter().any(|v| v.abs() > 1e3 * start) {
            return f64::INFINITY;
        }
    }
    data.qvel().iter().fold(0.0_f64, |m, v| m.max(v.abs())) / start
}

#[test]
fn printed_largest_step() {
    let a = Joint::lever("a", 1.0, 0.2, 0.01);
    let b = Joint::lever("b", 0.2, 0.1, 1e-3).after(&a, [0.4, 0.0, 0.0]);
    let damped = vec![a.clone().damped(2.0), b.clone().damped(12.0)];
    for (name, joints, (kp, kd)) in [
        ("one joint", vec![Joint::wheel("j", 1e-3)], (200.0, 4.0)),
        ("stiff", vec![Joint::wheel("j", 1e-3)], (1e4, 0.0)),
        ("two joints", vec![a, b], (2000.0, 30.0)),
        ("damped joints", damped, (2000.0, 30.0)),
        ("a follower", vec![Joint::wheel("w", 0.01), Joint::wheel("f", 0.03).following("w", 1.5)], (1e4, 40.0)),
        ("arm and hand", arm_and_hand(), (1e3, 1e2)),
    ] {
        let world = world(&joints, native(kp, kd), weightless());
        let found = world.sim.diagnostics().iter().filter(|d| d.kind == DiagnosticKind::ActuatorUnstable);
        let messages: Vec<&str> = found.map(|d| d.message.as_str()).collect();
        assert_eq!(messages.len(), 1, "{name}: {messages:?}");
        assert!(messages[0].contains("time step is 0.01 s"), "{}", messages[0]);
        let after = messages[0].split("time step of ").nth(1).unwrap();
        let bound: f64 = after.split(' ').next().unwrap().parse().unwrap();
        let [below, above] = [0.98, 1.02].map(|share| growth(world.sim.scene().mjcf(), share * bound));
        assert!(below < 10.0 && above == f64::INFINITY, "{name}, bound {bound} s: {below} {above}");
    }
}

#[test]
fn integrators_that_change_the_solution() {
    let of = |names: &[&str], drive: DriveCfg, integrator| {
        let joints: Vec<Joint> = names.iter().map(|name| Joint::wheel(name, 0.1)).collect();
        try_world(&joints, drive, SimulationManagerCfg { integrator, ..weightless() })
    };
    for integrator in [Integrator::Rk4, Integrator::Implicit] {
        let error = of(&["j"], gains(10.0, 1.0), integrator).unwrap_err();
        let Error::Integrator { integrator: named, .. } = &*error else { panic!("{error}") };
        assert_eq!(*named, integrator.name());
        assert!(error.to_string().contains("DriveModel::Actuator"), "{error}");
        of(&["j"], native(10.0, 1.0), integrator).unwrap();
        of(&["j"], no_drive(), integrator).unwrap();
        // A robot has rows only for joints without an actuator model (`actuators.rs` has the laws).
        of(&["a", "b"], modeled("[ab]", IdealPd {}, 10.0, 1.0), integrator).unwrap();
        let error = of(&["a", "b"], modeled("a", IdealPd {}, 10.0, 1.0), integrator).unwrap_err();
        assert!(matches!(*error, Error::Integrator { .. }), "joint b is a row");
    }
    let fast = of(&["j"], gains(10.0, 1.0), Integrator::ImplicitFast);
    match mj::BUILD_VERSION {
        mj::SupportedVersion::V2 => assert!(matches!(*fast.unwrap_err(), Error::UnsupportedIntegrator { .. })),
        mj::SupportedVersion::V4 => {
            // The law holds with implicitfast too.
            let mut world = fast.unwrap();
            world.set_position_targets(&[0.5]);
            world.step(1);
            assert_number("velocity", world.v()[0], H * 10.0 * 0.5 / (0.1 + H * 1.0 + H * H * 10.0), EXACT);
        }
    }
}

/// The solver's acceleration, returned by `qacc`, is that of the force, a = -B v / M. MuJoCo's Euler evaluates the
/// damping at the end of the step, v' = v + h M a / (M + h B). Row drives do so inside the solver, where both are the
/// same.
#[test]
fn accelerations_of_the_solver() {
    let (m, b, speed) = (0.2, 0.5, 2.0);
    let after_a_step = |drive, integrator| {
        let joint = Joint::wheel("j", m).damped(b);
        let mut world = world(&[joint], drive, SimulationManagerCfg { integrator, ..weightless() });
        world.robot().write_qvel(&row(&[speed]), None, None).unwrap();
        world.step(1);
        [world.view().qacc()[(0, 0)], (world.v()[0] - speed) / H]
    };
    let felt = -b * speed / (m + H * b);
    for (what, drive, solver) in
        [("an actuator", native(0.0, 0.0), -b * speed / m), ("a row drive", gains(0.0, 0.0), felt)]
    {
        let [a, change] = after_a_step(drive, Integrator::Euler);
        assert_number(what, a, solver, EXACT);
        assert_number(what, change, felt, EXACT);
    }
    let [a, change] = after_a_step(native(0.0, 0.0), Integrator::Rk4);
    assert!((a - change).abs() > 0.01, "RK4: {a} {change}");
}

/// Energy of a pendulum after 2 s at dt 0.01, free and with a spring drive; decay of a damped wheel.
#[test]
fn order_of_rk4() {
    let (mass, length, moment) = (0.5, 0.2, 0.01);
    let about_axis = moment + mass * length * length;
    for (drive, kp) in [(no_drive(), 0.0), (native(5.0, 0.0), 5.0)] {
        let [rk4, euler] = [Integrator::Rk4, Integrator::Euler].map(|integrator| {
            let cfg = SimulationManagerCfg { integrator, ..earth() };
            let mut world = world(&[Joint::lever("j", mass, length, moment)], drive.clone(), cfg);
            let energy = |q: f64, v: f64| 0.5 * about_axis * v * v - mass * 9.81 * length * q.sin() + 0.5 * kp * q * q;
            (0..200).fold(0.0_f64, |worst, _| {
                world.step(1);
                worst.max((energy(world.q()[0], world.v()[0]) - energy(0.0, 0.0)).abs())
            })
        });
        assert!(rk4 < 1e-5 && euler > 1e-3, "kp {kp}: {rk4} {euler}");
    }
    for drive in [no_drive(), native(0.0, 0.0)] {
        let cfg = SimulationManagerCfg { integrator: Integrator::Rk4, ..weightless() };
        let mut env = world(&[Joint::wheel("j", 0.2).damped(0.5)], drive, cfg).env();
        set_state(&mut env, &[0.0], &[3.0]);
        env.step(100);
        let limit = Tolerance::mixed(5e-9, "RK4: (λ h)⁴ λ t / 120 = 8e-9 of 0.25 rad/s, λ = b / M = 2.5 / s");
        assert_number("decay over 1 s", env.data().qvel()[0], 3.0 * f64::exp(-0.5 / 0.2), limit);
    }
}

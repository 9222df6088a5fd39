//! The law of one drive, and of several drives on one chain.
//!
//! A drive as constraint row gives tau = clamp(kp (q* - q') + kd (v* - v') + tau_ff, ±limit) at the end of the step,
//! with q' = q + h v'. For a joint of constant inertia M and viscous damping B without other loads, M (v' - v) = h
//! (tau - B v') gives, unsaturated,
//!
//! ```text
//! v' = (M v + h (kp (q* - q) + kd v* + tau_ff)) / (M + h B + h kd + h² kp)
//! ```
//!
//! and saturated v' = (M v ± h limit) / (M + h B). `DriveModel::Actuator` and explicit models evaluate the law at the
//! start of the step: (M + h B) (v' - v) = h (tau - B v). Gains of type `Acceleration` are multiplied by I = 1 /
//! (M⁻¹)_ii at the start; type `None` has no gains. For a chain with mass matrix M(q) and bias c(q, v) (both evaluated
//! at the start of the step by MuJoCo's Euler integrator), with the known set S of saturated joints, (M + h B + h Kd +
//! h² Kp) v' = M v + h (Kp (q* - q) + Kd v* + tau_ff - c); rows in S have zero gains and ±limit.
//!
//! Tolerance 1e-9, relative above 1: the solver's problem is quadratic between its corners, so Newton's method is exact
//! there up to rounding. Rounding is 1e-16 times the ratio of the largest to the smallest of M and h kd + h² kp (up to
//! 1e6 here); over 200 steps stable gains do not amplify it. Controls: the explicit law misses by more than 1e-3;
//! MuJoCo's own damping beside a row scales the solver's acceleration by M / (M + h B) after the solve: a light link
//! moves more than ten times more slowly.

use crate::drives::worlds::*;
use kinetoscope::mujoco as mj;
use kinetoscope::prelude::*;
use kinetoscope::robot::diagnostic::DiagnosticKind;
use kinetoscope::sim::{DriveModel, DriveType};
use nalgebra::{DMatrix, DVector, Vector3};

pub(crate) const EXACT: Tolerance =
    Tolerance::mixed(1e-9, "Newton's method: rounding of 1e-16 times a ratio of up to 1e6 of inertias and gains");

/// A joint of inertia `m` with viscous damping `b`, and its drive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Law {
    pub(crate) h: f64,
    pub(crate) m: f64,
    pub(crate) b: f64,
    pub(crate) kp: f64,
    pub(crate) kd: f64,
    pub(crate) limit: f64,
    pub(crate) explicit: bool,
    pub(crate) q: f64,
    pub(crate) v: f64,
    /// Targets of position, velocity and effort.
    pub(crate) aim: [f64; 3],
}

pub(crate) const LAW: Law = Law {
    h: H,
    m: 0.2,
    b: 0.0,
    kp: 0.0,
    kd: 0.0,
    limit: f64::INFINITY,
    explicit: false,
    q: 0.0,
    v: 0.0,
    aim: [0.0; 3],
};

impl Law {
    /// Takes a step and returns the effort.
    pub(crate) fn step(&mut self) -> f64 {
        let Law { h, m, b, kp, kd, limit, q, v, aim: [aim, v_aim, ff], .. } = *self;
        let now = kp * (aim - q) + kd * v_aim + ff;
        let end = (m * v + h * now) / (m + h * b + h * kd + h * h * kp);
        let demand = if self.explicit { now - kd * v } else { now - (kd + h * kp) * end };
        let tau = demand.max(-limit).min(limit);
        self.v = if self.explicit || tau != demand { (m * v + h * tau) / (m + h * b) } else { end };
        self.q += h * self.v;
        tau
    }

    /// Takes a step with new targets; returns the effort, and true if the limit binds.
    pub(crate) fn step_to(&mut self, aim: [f64; 3]) -> (f64, bool) {
        self.aim = aim;
        let unlimited = Law { limit: f64::INFINITY, ..*self }.step();
        let tau = self.step();
        (tau, tau != unlimited)
    }

    fn joint(&self) -> Joint {
        let joint = Joint::wheel("j", self.m).damped(self.b);
        if self.limit.is_finite() { joint.effort(self.limit) } else { joint }
    }

    /// Steps a joint with this drive; returns the number of steps at its limit.
    fn check(mut self, what: &str, joint: &Joint, drive: DriveCfg, steps: usize) -> usize {
        let world = world(std::slice::from_ref(joint), drive, at_dt(self.h, weightless()));
        assert!(!world.has_stability_warning(), "{what}");
        let mut env = world.env();
        set_state(&mut env, &[self.q], &[self.v]);
        if !env.drives.position.is_empty() {
            set_drive_targets(&mut env, self.aim);
        }
        let mut saturated = 0;
        for k in 0..steps {
            step(&mut env);
            let (tau, bound) = self.step_to(self.aim);
            let what = format!("{what}, {}, step {k}, {self:?}", joint.kind);
            assert_number(&format!("velocity of {what}"), env.data().qvel()[0], self.v, EXACT);
            assert_number(&format!("position of {what}"), env.data().qpos()[0], self.q, EXACT);
            let found = env.drives.effort.first().copied().unwrap_or(0.0);
            assert_number(&format!("effort of {what}"), found, tau, EXACT);
            // A saturated effort equals the limit bit for bit, and an unsaturated effort does not.
            assert_eq!(found.abs() == self.limit, bound, "{what}");
            saturated += usize::from(bound);
        }
        saturated
    }
}

const CASES: &[Law] = &[
    // The tutorial's finger: 10 g, 1e3 / 1e2.
    Law { m: 1e-5, kp: 1e3, kd: 1e2, q: 0.1, v: 0.3, aim: [0.6, 0.0, 0.0], ..LAW },
    Law { m: 0.5, kp: 1e4, kd: 1e3, q: -0.2, v: -1.0, aim: [0.3, 0.0, 0.0], ..LAW },
    Law { kp: 40.0, kd: 5.0, q: 0.5, v: 2.0, aim: [-0.1, 0.0, 0.0], ..LAW },
    // Velocity target and feedforward effort, alone and together.
    Law { kd: 30.0, q: 0.5, v: -2.0, aim: [9.0, 1.5, 0.0], ..LAW },
    Law { q: 0.5, v: 1.0, aim: [9.0, 9.0, 0.7], ..LAW },
    Law { h: 0.002, kp: 300.0, kd: 3.0, q: 0.5, v: 1.0, aim: [0.4, -0.6, 2.5], ..LAW },
    Law { h: 0.05, m: 2.0, kp: 1e5, aim: [1.0, 0.0, 0.0], ..LAW },
];

#[test]
fn one_step() {
    for case in CASES {
        for joint in [case.joint(), Joint::slide("j", case.m)] {
            case.check("a drive", &joint, gains(case.kp, case.kd), 1);
        }
        let [mut implicit, mut explicit] = [false, true].map(|explicit| Law { explicit, ..*case });
        implicit.step();
        explicit.step();
        let distinct = case.kp > 0.0 || case.kd > 0.0;
        assert!(!distinct || (explicit.v - implicit.v).abs() > 1e-3 * implicit.v.abs(), "the control: {case:?}");
    }
    // Rotor inertia adds to the joint's own inertia.
    let rotor = Law { m: 0.4, kp: 200.0, kd: 10.0, aim: [0.5, 0.0, 0.0], ..LAW };
    let drive = DriveCfg { armature: [("j", 0.3)].into(), ..gains(200.0, 10.0) };
    rotor.check("a rotor", &Joint::wheel("j", 0.1), drive, 1);
}

/// Recurrences over many steps: h B / M = 100 is a finger link of 10 g with 0.1 N m s / rad.
#[test]
fn recurrences() {
    let aim = [0.5, 0.0, 0.0];
    let light = Law { m: 1e-5, b: 0.1, ..LAW };
    let native = Law { m: 0.3, kp: 200.0, kd: 4.0, explicit: true, ..LAW };
    for (what, law, steps, binds) in [
        ("a light damped drive", Law { kp: 10.0, kd: 0.5, aim, ..light }, 50, false),
        ("an actuator at its limit", Law { limit: 2.0, aim, ..native }, 200, true),
        ("a damped actuator", Law { b: 1.5, aim: [0.5, -0.3, 4.0], ..native }, 200, false),
        ("an actuator's velocity", Law { kp: 0.0, aim: [0.5, 0.7, -1.0], ..native }, 200, false),
        ("an actuator's effort", Law { b: 0.2, kp: 0.0, kd: 0.0, aim: [0.5, 0.7, 1.3], ..native }, 200, false),
    ] {
        let model = if law.explicit { DriveModel::Actuator } else { DriveModel::Implicit };
        let saturated = law.check(what, &law.joint(), DriveCfg { model, ..gains(law.kp, law.kd) }, steps);
        assert_eq!(saturated > 0, binds, "{what}");
    }
    for model in [DriveModel::Implicit, DriveModel::Actuator] {
        for law in [Law { v: 3.0, ..light }, Law { b: 0.5, v: 3.0, ..LAW }] {
            law.check("an undriven joint", &law.joint(), DriveCfg { model, ..no_drive() }, 50);
        }
        // Gains of acceleration drives move light and heavy joints alike.
        let (drive_type, explicit) = (DriveType::Acceleration, model == DriveModel::Actuator);
        for m in [0.05, 5.0] {
            let law = Law { m, kp: 90.0 * m, kd: 15.0 * m, aim: [0.4, 0.0, 0.0], explicit, ..LAW };
            law.check("an acceleration drive", &law.joint(), DriveCfg { drive_type, model, ..gains(90.0, 15.0) }, 100);
        }
    }
}

/// Control: an unmodified row, with the damping left to MuJoCo.
#[test]
fn mujocos_damping_beside_a_row() {
    let (m, b, kp, kd, aim) = (1e-5, 0.1, 10.0, 0.5, 0.5);
    let joint = format!("damping=\"{b}\" frictionloss=\"1\"");
    let mut data = plain(&hinge_mjcf("gravity=\"0 0 0\"", &joint, [1.0, 0.0, m]));
    let stiffness = H * (kd + H * kp);
    data.step1().unwrap();
    assert_eq!(data.efc_type()[0] as u32, mj::mjCNSTR_FRICTION_DOF);
    data.efc_d_mut()[0] = stiffness;
    data.efc_r_mut()[0] = 1.0 / stiffness;
    data.efc_aref_mut()[0] = kp * aim / stiffness;
    data.efc_frictionloss_mut()[0] = 1e15;
    data.step2().unwrap();
    let first = H * kp * aim / (m + H * b + H * kd + H * H * kp);
    assert!(data.qvel()[0] < 0.1 * first, "{} {first}", data.qvel()[0]);
}

/// h is the step that MuJoCo takes, not `physics_dt`.
#[test]
fn substeps() {
    let mut law = Law { h: 0.002, q: 0.0, v: 0.0, ..CASES[0] };
    let cfg = SimulationManagerCfg { substeps: 5, ..weightless() };
    let mut world = world(&[law.joint()], gains(law.kp, law.kd), cfg);
    world.set_position_targets(&[0.6]);
    world.step(1);
    for _ in 0..5 {
        law.step();
    }
    assert_number("position after five substeps", world.q()[0], law.q, EXACT);
    assert_number("velocity after five substeps", world.v()[0], law.v, EXACT);
}

/// Saturated, the effort is the limit to the last bit and the motion is that of the limit. A demand of 99.9 % of the
/// limit is not clamped, one of 100.1 % is. The clamp applies to the whole sum: a feedforward effort cannot exceed the
/// limit, and can cancel the other terms.
#[test]
fn effort_limit() {
    let law = Law { m: 0.02, kp: 1e3, kd: 1e2, limit: 2.0, ..LAW };
    let (drive, joint) = (gains(law.kp, law.kd), law.joint());
    for sign in [1.0, -1.0] {
        for v in [0.0, 0.7, -3.0] {
            // The target for which the unclamped law gives `share` of the limit.
            for share in [0.5, 0.999, 1.001, 50.0] {
                let end = v + H / law.m * sign * law.limit * share;
                let aim = [(sign * share * law.limit + (law.kd + H * law.kp) * end) / law.kp, 0.0, 0.0];
                let mut asked = Law { v, aim, ..law };
                assert_eq!(asked.check("a share", &joint, drive.clone(), 1) == 1, share > 1.0, "share {share}");
                assert_number("the law", asked.step(), sign * law.limit * share.min(1.0), EXACT);
            }
        }
    }
    // kp e = 30 and tau_ff = -29: each exceeds the limit, but their sum does not.
    for (kp, kd, aim, binds) in
        [(100.0, 1.0, [0.0, 0.0, 5.0], 1), (0.0, 0.0, [0.0, 0.0, 5.0], 1), (100.0, 1.0, [0.3, 0.0, -29.0], 0)]
    {
        let sum = Law { kp, kd, aim, ..law };
        assert_eq!(sum.check("a sum", &joint, gains(kp, kd), 1), binds, "{sum:?}");
    }
}

/// An effort limit of 0, or a missing one, in the file means no limit, with a warning; the configuration overrides the
/// file.
#[test]
fn effort_limit_of_the_file() {
    for joint in [Joint::wheel("j", 0.1), Joint::wheel("j", 0.1).effort(0.0)] {
        let mut world = world(&[joint], gains(1e8, 0.0), weightless());
        assert_eq!(world.limits(), [f64::INFINITY]);
        let warned = world.sim.diagnostics().iter().any(|d| d.kind == DiagnosticKind::EffortUnlimited);
        assert!(warned, "{:?}", world.sim.diagnostics());
        world.set_position_targets(&[1.0]);
        world.step(1);
        let v = H * 1e8 / (0.1 + H * H * 1e8);
        assert_number("velocity", world.v()[0], v, EXACT);
        let limit =
            Tolerance::mixed(1e-6, "rounding of positions through kp = 1e8 is 1e-8; the rest is measured, not derived");
        assert_number("effort", world.effort()[0], 0.1 * v / H, limit);
    }
    for limit in [0.5, f64::INFINITY] {
        let drive = DriveCfg { max_effort: Some([("j", limit)].into()), ..gains(1e3, 1e2) };
        let mut world = world(&[Joint::wheel("j", 0.1).effort(3.0)], drive, weightless());
        assert_eq!(world.limits(), [limit]);
        world.set_position_targets(&[2.0]);
        world.step(1);
        assert_eq!(world.effort()[0] == 0.5, limit == 0.5, "{:?}", world.effort());
    }
}

/// Three coupled joints in motion under gravity, with none to three of them saturated; then with damping, and the
/// second joint without gains.
#[test]
fn chain() {
    let a = Joint::lever("a", 3.0, 0.2, 0.02);
    let b = Joint::lever("b", 1.0, 0.1, 5e-3).after(&a, [0.4, 0.0, 0.0]);
    let c = Joint { axis: [0.0, 0.6, 0.8], ..Joint::lever("c", 0.01, 0.02, 2e-6) }.after(&b, [0.2, 0.0, 0.0]);
    let (q, v, free) = ([0.3, -0.7, 0.4], [1.1, -0.6, 2.0], f64::MAX);
    let plain = ([1e4, 1e3, 1e3], [0.0; 3], [0.35, -0.66, 0.41]);
    for ((kp, damping, aim), limits, count) in [
        (plain, [free; 3], 0),
        (plain, [20.0, 500.0, 500.0], 1),
        (plain, [20.0, 500.0, 1e-3], 2),
        (plain, [20.0, 0.5, 1e-3], 3),
        (([1e4, 0.0, 1e3], [2.0, 0.7, 0.1], [0.5, 0.0, 0.41]), [5.0, free, free], 1),
    ] {
        let kd = kp.map(|k| 0.1 * k);
        let named = |k: [f64; 3]| [("a", k[0]), ("b", k[1]), ("c", k[2])].into();
        let drive = DriveCfg { stiffness: named(kp), damping: named(kd), ..Default::default() };
        let joints = [&a, &b, &c].into_iter().cloned().zip(limits).zip(damping);
        let joints: Vec<Joint> = joints.map(|((joint, limit), b)| joint.effort(limit).damped(b)).collect();
        let world = world(&joints, drive, earth());
        let mut env = world.env();
        set_state(&mut env, &q, &v);
        env.drives.position.copy_from_slice(&aim);
        step(&mut env);
        let (tau, (mass, bias)) = (env.drives.effort.clone(), world.dynamics(&q, &v, &EARTH));
        // Gains of the joints below their limit; the saturated joints contribute ±limit.
        let saturated: Vec<bool> = (0..3).map(|i| tau[i].abs() == limits[i]).collect();
        let gain = |k: [f64; 3]| DVector::from_fn(3, |i, _| if saturated[i] { 0.0 } else { k[i] });
        let (kps, kds) = (gain(kp), gain(kd));
        let constant = DVector::from_fn(3, |i, _| if saturated[i] { tau[i] } else { kps[i] * (aim[i] - q[i]) });
        let damping = DVector::from_column_slice(&damping);
        let left: DMatrix<f64> = &mass + DMatrix::from_diagonal(&(H * damping + H * &kds + H * H * &kps));
        let expected = left.lu().solve(&(&mass * Vector3::from(v) + H * (constant - bias))).unwrap();
        for i in 0..3 {
            assert_number(&format!("joint {i}, limits {limits:?}"), env.data().qvel()[i], expected[i], EXACT);
            assert!(tau[i].abs() <= limits[i]);
            // The law of a saturated joint demands at least its limit.
            let asked = kp[i] * (aim[i] - env.data().qpos()[i]) - kd[i] * env.data().qvel()[i];
            assert!(!saturated[i] || asked * tau[i].signum() >= limits[i], "joint {i}: {asked} {limits:?}");
        }
        assert_eq!(saturated.iter().filter(|s| **s).count(), count, "{limits:?}");
    }
}

/// On a chain, the inertia of an acceleration drive is the joint's effective inertia with the other joints free,
/// including the rotor.
#[test]
fn effective_inertia() {
    let a = Joint::lever("a", 3.0, 0.2, 0.02);
    let b = Joint::lever("b", 1.0, 0.1, 5e-3).after(&a, [0.4, 0.0, 0.0]);
    let drive = DriveCfg { drive_type: DriveType::Acceleration, armature: 0.01.into(), ..gains(90.0, 15.0) };
    let world = world(&[a, b], drive, weightless());
    let (mass, _) = world.dynamics(&[0.0; 2], &[0.0; 2], &EARTH);
    let inverse = (mass + DMatrix::identity(2, 2) * 0.01).try_inverse().unwrap();
    for (i, gains) in world.env().drives.gains.iter().enumerate() {
        assert_number("stiffness", gains.kp, 90.0 / inverse[(i, i)], EXACT);
        assert_number("damping", gains.kd, 15.0 / inverse[(i, i)], EXACT);
    }
}

/// A damped planar joint between base and arm is not a drive; the effort of the arm's drive remains the law at the new
/// state.
#[test]
fn damped_planar_joint() {
    let cart = Joint { axis: [0.0, 0.0, 1.0], mass: 2.0, ..Joint::new("cart", "planar").damped(50.0) };
    let arm = Joint::lever("arm", 0.5, 0.2, 0.01).after(&cart, [0.1, 0.0, 0.0]);
    let (kp, kd, aim) = (200.0, 20.0, 0.5);
    let mut env = world(&[cart, arm], gains(kp, kd), weightless()).env();
    env.drives.position[0] = aim;
    let drive = env.drives.table().drives[0].clone();
    for _ in 0..20 {
        step(&mut env);
        let (q, v) = (env.data().qpos()[drive.qpos], env.data().qvel()[drive.dof]);
        assert_number("effort at the new state", env.drives.effort[0], kp * (aim - q) - kd * v, EXACT);
    }
    assert!(env.data().qpos()[0].abs() > 1e-4, "the cart moves");
}

/// A velocity drive (kp = 0) holds v* without a load, and v* - load / kd under a load: M a = 0 = kd (v* - v) - f. It
/// converges with (M / (M + h kd))^n, below 1e-15 after 400 steps. With friction f and damping B its effort is f + B v.
#[test]
fn velocity_target() {
    let (m, kd, aim, load) = (0.2, 3.0, 1.5, 0.9);
    let reached = |joint: Joint, kd: f64, aim: f64| {
        let mut world = world(&[joint], gains(0.0, kd), weightless());
        world.robot().set_qvel_target(&row(&[aim]), None, None).unwrap();
        world.step(400);
        world
    };
    let world = reached(Joint::wheel("j", m), kd, aim);
    assert_number("speed without load", world.v()[0], aim, EXACT);
    let mut env = world.env();
    env.drives.applied[0] = -load;
    env.step(400);
    assert_number("speed under load", env.data().qvel()[0], aim - load / kd, EXACT);
    let (kd, b, f, aim) = (40.0, 3.0, 2.0, 0.8);
    let world = reached(Joint::wheel("j", 0.1).damped(b).rough(f), kd, aim);
    let v = (kd * aim - f) / (kd + b);
    assert_number("speed with friction", world.v()[0], v, EXACT);
    assert_number("effort", world.effort()[0], f + b * v, EXACT);
}

/// The setters write the inputs of the law; efforts and velocities stay until changed, and a reset clears them.
#[test]
fn setters() {
    let case = CASES[5];
    let mut world = world(&[case.joint()], gains(case.kp, case.kd), at_dt(case.h, weightless()));
    let mut env = world.env();
    set_drive_targets(&mut env, case.aim);
    env.step(50);
    world.set_position_targets(&[case.aim[0]]);
    let mut robot = world.robot();
    robot.set_qvel_target(&row(&[case.aim[1]]), None, None).unwrap();
    robot.set_qf_target(&row(&[case.aim[2]]), Some(&[JointIndex(0)]), Some(&[EnvId(0)])).unwrap();
    world.step(50);
    assert_eq!((world.q()[0], world.v()[0]), (env.data().qpos()[0], env.data().qvel()[0]));
    world.sim.reset(None).unwrap();
    world.step(10);
    assert_eq!((world.q()[0], world.v()[0]), (0.0, 0.0), "a reset leaves nothing to push");
}

/// A passive joint accepts efforts too: M a = tau, clamped to the file's limit, even if the model has no drive at all.
/// Otherwise the joint is free: a pendulum whose target reads back as its position.
#[test]
fn joint_without_a_drive() {
    let mut world = world(&[Joint::wheel("j", 0.2).effort(3.0)], no_drive(), weightless());
    for (tau, speed) in [(1.0, 1.0), (-50.0, 1.0 - 3.0)] {
        world.robot().set_qf_target(&row(&[tau]), None, None).unwrap();
        world.step(10);
        assert_number("speed after 10 steps more", world.v()[0], 10.0 * H * speed / 0.2, EXACT);
    }
    let moment = 0.01 + 0.5 * 0.2 * 0.2;
    let mut world = self::world(&[Joint::lever("j", 0.5, 0.2, 0.01).effort(3.0)], no_drive(), earth());
    world.set_position_targets(&[1.0]);
    let (mut q, mut v) = (0.0_f64, 0.0);
    for _ in 0..100 {
        world.step(1);
        v += H * 0.5 * 9.81 * 0.2 * q.cos() / moment;
        q += H * v;
        assert_number("position of a pendulum", world.q()[0], q, EXACT);
        assert_number("velocity of a pendulum", world.v()[0], v, EXACT);
    }
    assert_eq!((world.target(), world.effort()), (world.q(), vec![0.0]));
    world.assert_healthy();
}

/// Targets are clamped to the usable range: the joint's own, narrowed by those of its followers; the clamped target is
/// read back.
#[test]
fn target_range() {
    let mut world = world(&[Joint::wheel("j", 0.1).range(-0.4, 0.7).effort(50.0)], gains(1e3, 1e2), weightless());
    for (aim, expected) in [(2.0, 0.7), (-9.0, -0.4), (0.3, 0.3)] {
        world.set_position_targets(&[aim]);
        assert_eq!(world.target(), [expected]);
        world.step(200);
        let limit = Tolerance::mixed(1e-6, "of the way 1.1^-200 is left after 2 s: kd / kp is ten steps");
        assert_number("position", world.q()[0], expected, limit);
    }
    // The follower moves 1.5 times as far and may reach 0.6: the driver may reach 0.4, though its own range ends at 2.
    let driver = Joint::wheel("d", 0.1).range(-0.2, 2.0).effort(50.0);
    let follower = Joint::wheel("f", 0.01).range(-1.0, 0.6).effort(0.0).following("d", 1.5);
    for model in [DriveModel::Implicit, DriveModel::Actuator] {
        let drive = DriveCfg { model, ..gains(100.0, 10.0) };
        let mut world = self::world(&[driver.clone(), follower.clone()], drive, weightless());
        let clipped = world.sim.diagnostics().iter().filter(|d| d.kind == DiagnosticKind::MimicRangeClipped);
        assert_eq!(clipped.count(), 1);
        world.set_position_targets(&[2.0, 123.0]);
        let (limits, target) = (world.view().qpos_limits(), world.target());
        for (what, found, expected) in [
            ("lower end of the driver", limits[(0, 0, 0)], -0.2),
            ("upper end of the driver", limits[(0, 0, 1)], 0.4),
            ("target of the driver", target[0], 0.4),
            ("target of the follower", target[1], 0.6),
        ] {
            assert_number(what, found, expected, Tolerance::mixed(1e-15, "one rounding"));
        }
        world.step(300);
        world.assert_healthy();
        let limit =
            Tolerance::mixed(1e-5, "of the way 1.1^-300 is left; the yield of the coupling is measured, not derived");
        assert_number("driver", world.q()[0], 0.4, limit);
        assert_number("follower", world.q()[1], 0.6, Tolerance::mixed(1e-5, "as for the driver"));
    }
    // PR2's gripper: the follower turns against its driver, and its own range is on the wrong side of 0. Regression: no
    // range was left for the driver, which was frozen. Now the driver has its own range, and the follower moves with
    // it.
    let driver = Joint::wheel("d", 0.1).range(0.0, 0.548).effort(50.0);
    for (what, range) in
        [("one point is left", [0.0, 0.548]), ("nothing is left", [0.2, 0.5]), ("a hair", [-1e-4, 0.5])]
    {
        let follower = Joint::wheel("f", 0.01).range(range[0], range[1]).effort(0.0).following("d", -1.0);
        let mut world = self::world(&[driver.clone(), follower], gains(100.0, 10.0), weightless());
        let clipped = world.sim.diagnostics().iter().filter(|d| d.kind == DiagnosticKind::MimicRangeClipped);
        let message = clipped.map(|d| d.message.clone()).collect::<String>();
        assert!(message.contains("leave no range for \"d\" and were ignored"), "{what}: {message}");
        let limits = world.view().qpos_limits();
        let ends = [0, 1].map(|joint| [0, 1].map(|end| limits[(0, joint, end)]));
        assert_eq!(ends, [[0.0, 0.548], [-0.548, 0.0]], "{what}");
        world.set_position_targets(&[0.5, 0.0]);
        world.step(300);
        world.assert_healthy();
        let limit = Tolerance::mixed(1e-5, "of the way 1.1^-300 is left, and the yield of the coupling");
        assert_number("driver", world.q()[0], 0.5, limit);
        assert_number("follower", world.q()[1], -0.5, Tolerance::mixed(1e-5, "as for the driver"));
    }
}

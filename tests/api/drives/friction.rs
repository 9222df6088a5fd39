//! Dry friction f of a joint (Coulomb: -f sign(v) in motion, up to ±f at rest), alone and with a drive; and the
//! compliance of a drive under a load.
//!
//! In motion friction is exact: M (v' - v) = h (tau(q', v') - f sign v'), tolerance 1e-9 as in `law.rs`. Friction is a
//! constraint row of MuJoCo, which is a stiff damper below its limit. At rest under a load tau < f it creeps with v =
//! tau R / b, R = (1 - d) / d / M, b = 1 / h, d = 0.9999 (MuJoCo's largest): 1e-4 h tau / M. Tests of joints at rest
//! allow twice that. Control: MuJoCo's default d = 0.9 and b = 105 / s creep out of the band within a second.
//!
//! A soft drive (kp 40, kd 5) under gravity sags by exactly tau_g / kp. At rest the law is kp (q* - q) = tau_g(q), with
//! tau_g from `kinetoscope_robot::dynamics`, which has no drives. The slowest mode decays with kd / kp = 0.125 s: after
//! 10 s, exp(-80) of it is left. Tolerance 1e-9 rad: rounding of positions through kp. A 1 % change of kp would move
//! the joints by 2 mrad. Control: the same row with MuJoCo's own stiffness (only its reference acceleration rewritten)
//! is a rigid drive that sags by less than a tenth.

use crate::drives::law::EXACT;
use crate::drives::worlds::*;
use kinetoscope::mujoco as mj;
use kinetoscope::prelude::*;

const M: f64 = 0.1;
const F: f64 = 2.0;

fn creep(load: f64, seconds: f64) -> f64 {
    2e-4 * H * load / M * seconds
}

fn rough(name: &str) -> Joint {
    Joint::wheel(name, M).rough(F)
}

/// A target within ±f / kp of q causes no motion; from farther away the joint stops f / kp before its target.
#[test]
fn band() {
    // Overdamped, so that it does not overshoot: kd² > 4 M kp. 3 s are 15 time constants.
    let (kp, kd) = (100.0, 20.0);
    let (band, creep) = (F / kp, creep(F, 3.0));
    for (aim, inside) in [(0.5 * band, true), (-0.9 * band, true), (0.99 * band, true), (0.4, false), (-0.4, false)] {
        let mut world = world(&[rough("j")], gains(kp, kd), weightless());
        world.set_position_targets(&[aim]);
        world.step(300);
        let q = world.q()[0];
        if inside {
            assert!(q.abs() <= creep, "target {aim}: {q}");
            let limit = Tolerance::mixed(kp * creep, "the creep through kp");
            assert_number("the drive pushes with kp e all the while", world.effort()[0], kp * aim, limit);
        } else {
            let short = (aim - q) * aim.signum();
            assert!((short - band).abs() <= creep, "target {aim}: {short}");
            assert!(world.v()[0].abs() < 1e-4);
        }
    }
}

#[test]
fn one_step() {
    let (kp, kd) = (1e3, 1e2);
    let world = world(&[rough("j")], gains(kp, kd), weightless());
    for (aim, v0) in [(0.5, 1.0), (0.5, 0.0), (-0.2, -2.0)] {
        let mut env = world.env();
        set_state(&mut env, &[0.0], &[v0]);
        env.drives.position[0] = aim;
        step(&mut env);
        let v = (M * v0 + H * (kp * aim - F * f64::signum(aim))) / (M + H * kd + H * H * kp);
        assert_eq!(v.signum(), f64::signum(aim), "a case in which the joint moves with the drive");
        assert_number("velocity", env.data().qvel()[0], v, EXACT);
        assert_number("the drive's share alone", env.drives.effort[0], kp * (aim - H * v) - kd * v, EXACT);
    }
}

/// A lever with a gravity load below f stays in place, driven or not; with a larger load it moves. At q = 0 the load is
/// 0.5 kg x 9.81 x 0.2 m = 0.981 N m. MuJoCo's default friction creeps.
#[test]
fn holds_a_load() {
    let (lever, load) = (Joint::lever("j", 0.5, 0.2, M - 0.5 * 0.2 * 0.2), 0.5 * 9.81 * 0.2);
    for (name, drive) in [("undriven", no_drive()), ("driven", gains(1.0, 0.1)), ("actuator", native(1.0, 0.1))] {
        let [held, moved] = [1.1, 0.8].map(|share| {
            let mut world = world(&[lever.clone().rough(share * load)], drive.clone(), earth());
            world.step(300);
            world.assert_healthy();
            world.q()[0].abs()
        });
        assert!(held <= creep(load, 3.0), "{name}: {held}");
        assert!(moved > 0.1, "{name}: a load above the friction moves it");
    }
    let mut data = plain(&hinge_mjcf("", "frictionloss=\"1.1\"", [0.5, 0.2, 0.08]));
    (0..300).for_each(|_| data.step().unwrap());
    assert!(data.qpos()[0].abs() > 100.0 * creep(0.981, 3.0), "{}", data.qpos()[0]);
}

/// Two joints under gravity with friction on both: at rest |kp (q* - q) - tau_g| is at most f, and the arm has moved.
#[test]
fn arm_in_its_band() {
    let a = Joint::lever("a", 2.0, 0.2, 0.02).rough(3.0);
    let b = Joint::lever("b", 0.5, 0.15, 0.002).rough(1.0).after(&a, [0.4, 0.0, 0.0]);
    let mut world = world(&[a.effort(60.0), b.effort(20.0)], gains(400.0, 40.0), earth());
    let aim = [0.6, -0.4];
    world.set_position_targets(&aim);
    world.step(300);
    world.assert_healthy();
    let load = world.load_by_gravity(&EARTH);
    for (i, f) in [3.0, 1.0].into_iter().enumerate() {
        let left = 400.0 * (aim[i] - world.q()[i]) - load[i];
        assert!(left.abs() <= f * (1.0 + 1e-3) && left.abs() > 0.5 * f, "joint {i}: {left}");
        // The formula of `creep` with the effective inertia of joint b, 1 / (M^-1)_bb = 8e-3 kg m².
        assert!(world.v()[i].abs() < 3e-4, "joint {i}: {}", world.v()[i]);
    }
}

/// Drives, their friction, the friction of undriven joints and a second robot share one list of rows. Each drive's
/// effort is its own law at the new state, and each undriven wheel decelerates by its own friction.
#[test]
fn rows_of_one_list() {
    let (kp, kd) = (100.0, 10.0);
    let joints = [
        Joint::wheel("b", M).following("c", 2.0).rough(0.1),
        Joint::wheel("a", M),
        rough("c"),
        Joint::wheel("d", M).rough(0.5).effort(1.5),
    ];
    let mut world = world(&joints, gains(kp, kd), weightless());
    let files = kinetoscope_testkit::urdf::TempFiles::default();
    let second =
        kinetoscope_testkit::worlds::text_robot(&files, "second", &urdf(&[Joint::wheel("free", M).rough(0.3)]));
    world.sim.add_robot(RobotCfg { drive: no_drive(), ..second }).unwrap_or_else(|e| panic!("{e}"));
    let mut env = world.env();
    let last = env.data().qvel().len() - 1;
    env.write(|data| data.qvel_mut()[last] = 1.0);
    let aim = [0.2, 0.1, -0.3];
    env.drives.position.copy_from_slice(&aim);
    let table = std::sync::Arc::clone(env.drives.table());
    for k in 1..=20 {
        step(&mut env);
        for (i, drive) in table.drives.iter().enumerate() {
            let (q, v, limit) = (env.data().qpos()[drive.qpos], env.data().qvel()[drive.dof], drive.initial.max_effort);
            let law = (kp * (aim[i] - q) - kd * v).clamp(-limit, limit);
            let limit =
                Tolerance::mixed(1e-7, "the solver's, which stops at an improvement of 1e-8: measured, not derived");
            assert_number(&format!("drive {i}"), env.drives.effort[i], law, limit);
        }
        assert_number("the wheel without a drive", env.data().qvel()[last], 1.0 - f64::from(k) * H * 0.3 / M, EXACT);
    }
}

#[test]
fn sag() {
    let (kp, kd) = (40.0, 5.0);
    let a = Joint::lever("a", 1.0, 0.2, 0.01);
    let b = Joint::lever("b", 0.3, 0.15, 0.002).after(&a, [0.4, 0.0, 0.0]);
    let mut world = world(&[a.effort(30.0), b.effort(10.0)], gains(kp, kd), earth());
    let aim = [0.3, -0.2];
    world.set_position_targets(&aim);
    world.step(1000);
    world.assert_healthy();
    let (q, load) = (world.q(), world.load_by_gravity(&EARTH));
    for i in 0..2 {
        assert!((load[i] / kp).abs() > 0.01, "a visible sag");
        let limit = Tolerance::mixed(1e-9, "rounding of positions through kp");
        assert_number("sag", aim[i] - q[i], load[i] / kp, limit);
        let limit = Tolerance::mixed(40e-9, "1e-9 rad times kp = 40 N m/rad");
        assert_number("the drive carries the load", world.effort()[i], load[i], limit);
    }
    // Control.
    let row = format!("frictionloss=\"30\" solreffriction=\"{} 1\" solimpfriction=\".999 .999 .001\"", 2.0 * H);
    let mut data = plain(&hinge_mjcf("", &row, [1.0, 0.2, 0.01]));
    for _ in 0..1000 {
        data.step1().unwrap();
        let (q, v) = (data.qpos()[0], data.qvel()[0]);
        assert_eq!(data.efc_type()[0] as u32, mj::mjCNSTR_FRICTION_DOF);
        data.efc_aref_mut()[0] = (kp / (kd + H * kp) * -q - v) / H;
        data.step2().unwrap();
    }
    let (hangs, expected) = (data.qpos()[0], 1.0 * 9.81 * 0.2 * data.qpos()[0].cos() / kp);
    assert!(hangs.abs() < 0.1 * expected.abs(), "{hangs} {expected}");
}

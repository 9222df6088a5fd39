//! Dry friction f of a joint (Coulomb: -f sign(v) in motion, up to ±f at rest), alone and with a drive.
//!
//! In motion both are exact: M (v' - v) = h (tau(q', v') - f sign v'), tolerance 1e-9 as in `law.rs`. Friction is a
//! constraint row of MuJoCo's, which is a stiff damper below its limit: at rest under a load tau < f it creeps with
//! v = tau R / b, R = (1 - d) / d / M, b = 1 / h, d = 0.9999 (MuJoCo's largest): 1e-4 h tau / M. Where a test holds still,
//! twice that is its tolerance.
//!
//! Control: MuJoCo's default d = 0.9 and b = 105 / s creep out of the band within a second.

use crate::drives::worlds::*;
use kinetoscope::prelude::*;

const H: f64 = 0.01;
const M: f64 = 0.1;
const F: f64 = 2.0;
const EXACT: f64 = 1e-9;

fn creep(load: f64, seconds: f64) -> f64 {
    2e-4 * H * load / M * seconds
}

fn rough(name: &str) -> Joint {
    Joint { friction: F, ..Joint::wheel(name, M) }
}

/// q* within ±f / kp of q moves nothing; from farther away the joint stops f / kp before its target.
#[test]
fn a_drive_against_friction_stops_in_a_band_of_friction_over_stiffness() {
    // Overdamped, so that it does not overshoot: kd² > 4 M kp. 3 s are 15 time constants.
    let (kp, kd) = (100.0, 20.0);
    let band = F / kp;
    for share in [0.5, -0.9, 0.99] {
        let mut world = world(&[rough("j")], gains(kp, kd), weightless());
        world.aim(&[share * band]);
        world.step(300);
        let moved = world.q()[0];
        println!("target at {share} of the band: moved {moved:.1e} rad in 3 s");
        assert!(moved.abs() <= creep(F, 3.0), "{moved}");
        assert_close(
            world.effort()[0],
            kp * share * band,
            kp * creep(F, 3.0),
            "the drive pushes with kp e all the while",
        );
    }
    for aim in [0.4, -0.4] {
        let mut world = world(&[rough("j")], gains(kp, kd), weightless());
        world.aim(&[aim]);
        world.step(300);
        let short = (aim - world.q()[0]) * aim.signum();
        println!("target {aim}: stops {short:.6} rad before it, f / kp = {band:.6}");
        assert!((short - band).abs() <= creep(F, 3.0), "{short}");
        assert!(world.v()[0].abs() < 1e-4);
    }
}

/// Drive and friction together, one step in closed form.
#[test]
fn one_step_of_a_drive_with_friction_is_the_closed_form() {
    let (kp, kd) = (1e3, 1e2);
    let world = world(&[rough("j")], gains(kp, kd), weightless());
    for (aim, v0) in [(0.5, 1.0), (0.5, 0.0), (-0.2, -2.0)] {
        let mut env = world.env();
        push(&mut env, &[0.0], &[v0]);
        env.drives.position[0] = aim;
        step(&mut env);
        let v = (M * v0 + H * (kp * aim - F * f64::signum(aim))) / (M + H * kd + H * H * kp);
        assert_eq!(v.signum(), f64::signum(aim), "a case in which the joint moves with the drive");
        assert_close(env.data().qvel()[0], v, EXACT, "velocity");
        assert_close(env.drives.effort[0], kp * (aim - H * v) - kd * v, EXACT, "the drive's share alone");
    }
}

/// At constant speed the drive gives f + B v: kd (v* - v) = f + B v.
#[test]
fn at_constant_speed_the_effort_is_friction_plus_viscous() {
    let (kd, b, aim) = (40.0, 3.0, 0.8);
    let mut world = world(&[Joint { damping: b, ..rough("j") }], gains(0.0, kd), weightless());
    world.sim.robot_mut(world.robot).set_qvel(&row(&[aim]), None, None).unwrap();
    world.step(400);
    let v = (kd * aim - F) / (kd + b);
    assert_close(world.v()[0], v, EXACT, "speed");
    assert_close(world.effort()[0], F + b * v, EXACT, "effort");
}

/// Undriven: v falls by h f / M in each step until the step in which it would change its sign; then it stays.
#[test]
fn an_undriven_joint_decelerates_at_friction_over_inertia() {
    let drive = DriveCfg { drive_type: DriveType::None, ..Default::default() };
    let world = world(&[rough("j")], drive, weightless());
    let mut env = world.env();
    push(&mut env, &[0.0], &[2.1]);
    let mut v = 2.1;
    while v > H * F / M {
        step(&mut env);
        v -= H * F / M;
        assert_close(env.data().qvel()[0], v, EXACT, "in motion");
    }
    env.step(20);
    assert!(env.data().qvel()[0].abs() < 1e-6, "{}", env.data().qvel()[0]);
}

/// A lever that gravity loads with less than f stays where it is, driven or not; with more it moves.
#[test]
fn a_load_below_the_friction_moves_nothing() {
    // At q = 0: 0.5 kg x 9.81 x 0.2 m = 0.981 N m.
    let lever = Joint::lever("j", 0.5, 0.2, M - 0.5 * 0.2 * 0.2);
    let load = 0.5 * 9.81 * 0.2;
    let after = |friction: f64, drive: DriveCfg| {
        let mut world = world(&[Joint { friction, ..lever.clone() }], drive, earth());
        world.step(300);
        world.assert_well();
        world.q()[0]
    };
    let passive = || DriveCfg { drive_type: DriveType::None, ..Default::default() };
    let native = || DriveCfg { model: DriveModel::Actuator, ..gains(1.0, 0.1) };
    for (name, drive) in [("undriven", passive()), ("driven", gains(1.0, 0.1)), ("actuator", native())] {
        let held = after(1.1 * load, drive.clone());
        println!("{name}: moved {held:.1e} rad in 3 s, bound {:.1e}", creep(load, 3.0));
        assert!(held.abs() <= creep(load, 3.0), "{name}: {held}");
        assert!(after(0.8 * load, drive).abs() > 0.1, "{name}: a load above the friction moves it");
    }
}

#[test]
fn mujocos_default_friction_creeps() {
    let mut data = plain(&format!(
        "<mujoco><option timestep=\"{H}\"/><worldbody><body><joint type=\"hinge\" axis=\"0 1 0\" frictionloss=\"1.1\"/>\
         <inertial pos=\".2 0 0\" mass=\".5\" diaginertia=\".08 .08 .08\"/></body></worldbody></mujoco>"
    ));
    for _ in 0..300 {
        data.step().unwrap();
    }
    assert!(data.qpos()[0].abs() > 100.0 * creep(0.981, 3.0), "{}", data.qpos()[0]);
}

/// Two joints under gravity with friction on both: at rest |kp (q* - q) - tau_g| is at most f, and the arm has moved.
#[test]
fn an_arm_with_friction_rests_inside_its_band() {
    let (kp, kd) = (400.0, 40.0);
    let a = Joint { friction: 3.0, ..Joint::lever("a", 2.0, 0.2, 0.02) };
    let b = Joint { friction: 1.0, ..Joint::lever("b", 0.5, 0.15, 0.002) }.after(&a, [0.4, 0.0, 0.0]);
    let mut world = world(&[a.effort(60.0), b.effort(20.0)], gains(kp, kd), earth());
    let aim = [0.6, -0.4];
    world.aim(&aim);
    world.step(300);
    world.assert_well();
    let load = world.load_by_gravity(&EARTH);
    for (i, f) in [3.0, 1.0].into_iter().enumerate() {
        let left = kp * (aim[i] - world.q()[i]) - load[i];
        println!("joint {i}: friction carries {left:.4} N m of {f}");
        assert!(left.abs() <= f * (1.0 + 1e-3) && left.abs() > 0.5 * f, "joint {i}: {left}");
        // creep() with what joint b feels, 1 / (M^-1)_bb = 8e-3 kg m².
        assert!(world.v()[i].abs() < 3e-4, "joint {i}: {}", world.v()[i]);
    }
}

/// Drives, their friction, friction of undriven joints and of a second robot are rows of one list: each drive's effort is
/// its own law at the new state, and each undriven wheel decelerates by its own friction.
#[test]
fn rows_of_drives_and_of_friction_do_not_get_mixed_up() {
    let (kp, kd) = (100.0, 10.0);
    let files = tempfile::tempdir().unwrap();
    let path = files.path().join("second.urdf");
    std::fs::write(&path, urdf(&[Joint { friction: 0.3, ..Joint::wheel("free", M) }])).unwrap();
    let joints = [
        Joint { mimic: Some(("c".into(), 2.0)), friction: 0.1, ..Joint::wheel("b", M) },
        Joint::wheel("a", M),
        rough("c"),
        Joint { friction: 0.5, ..Joint::wheel("d", M) }.effort(1.5),
    ];
    let mut world = world(&joints, gains(kp, kd), weightless());
    let passive = DriveCfg { drive_type: DriveType::None, ..Default::default() };
    let cfg = RobotCfg { uid: "second".into(), urdf: UrdfCfg::single(&path), drive: passive, ..Default::default() };
    world.sim.add_robot(cfg).unwrap_or_else(|e| panic!("{e}"));
    let mut env = world.env();
    let last = env.data().qvel().len() - 1;
    env.write(|data| data.qvel_mut()[last] = 1.0);
    let aim = [0.2, 0.1, -0.3];
    env.drives.position.copy_from_slice(&aim);
    let table = std::sync::Arc::clone(env.drives.table());
    for k in 1..=20 {
        step(&mut env);
        for (i, drive) in table.drives.iter().enumerate() {
            let (q, v) = (env.data().qpos()[drive.qpos], env.data().qvel()[drive.dof]);
            let limit = drive.initial.max_effort;
            let law = (kp * (aim[i] - q) - kd * v).clamp(-limit, limit);
            assert_close(env.drives.effort[i], law, 1e-7, &format!("drive {i}"));
        }
        assert_close(env.data().qvel()[last], 1.0 - f64::from(k) * H * 0.3 / M, EXACT, "the wheel without a drive");
    }
}

//! Drives from a file's actuators, on single joints, followers and tendons, and their changes by the configuration.

use super::*;
use kinetoscope::mujoco as mj;
use kinetoscope::ndarray::array;
use kinetoscope::sim::DriveType;
use kinetoscope_testkit::worlds::{count_diagnostics, empty_cfg, gains};

/// A position servo with a gear, a motor, a velocity servo, two joints on a tendon, and a joint without an actuator;
/// the last two actuators act on one joint.
const MACHINE: &str = include_str!("../../data/mjcf/actuators.xml");

fn assert_reported(sim: &SimulationManager, words: &[&str]) {
    assert!(count_diagnostics(sim, words) > 0, "{words:?}: {:#?}", sim.diagnostics());
}

/// Gains and limits are those of the file unless the configuration overrides them.
#[test]
fn gains_and_limits() {
    let (sim, id) = with(1, robot("m", MACHINE));
    let of = sim.robot(id);
    assert_eq!(of.joint_names(), ["servo", "motor", "wheel", "finger1", "finger2", "idle"]);
    let infinite = f64::INFINITY;
    // Gear and coefficients are squared in gains and linear in efforts; 1e4 and 1e3 are the defaults for motors without
    // gains.
    assert_eq!(of.stiffness(), array![[120.0, 1e4, 0.0, 25.0, 400.0, 0.0]]);
    assert_eq!(of.damping(), array![[0.0, 1e3, 0.7, 0.0, 0.0, 0.0]]);
    assert_eq!(of.qf_limits(), array![[8.0, 11.0, infinite, 5.0, 20.0, infinite]]);
    assert_eq!((of.armature()[(0, 0)], of.friction()[(0, 5)]), (0.1, 0.3));
    let types = of.drive_types();
    assert_eq!((types[(0, 4)], types[(0, 5)]), (DriveType::Force, DriveType::None));
    assert_reported(&sim, &["joint drives replace the actuators \"p\", \"m\", \"v\", \"m2\""]);
    assert_reported(&sim, &["actuator \"t\" acts on the tendon \"both\""]);

    // The configuration overrides the named joints; a named joint without an actuator is driven too.
    let drive = DriveCfg {
        stiffness: [("servo|idle", 50.0)].into(),
        max_effort: Some([("motor", 7.0)].into()),
        armature: [("wheel", 0.4)].into(),
        ..Default::default()
    };
    let (sim, id) = with(1, RobotCfg { drive, ..robot("m", MACHINE) });
    let of = sim.robot(id);
    assert_eq!(of.stiffness(), array![[50.0, 1e4, 0.0, 25.0, 400.0, 50.0]]);
    assert_eq!(of.damping(), array![[0.0, 1e3, 0.7, 0.0, 0.0, 1e3]]);
    assert_eq!(of.qf_limits()[(0, 1)], 7.0);
    assert_eq!((of.armature()[(0, 0)], of.armature()[(0, 2)]), (0.1, 0.4));

    // A single number applies to all joints. Without any actuator all joints are driven, as in a URDF.
    let bare = format!("{}</mujoco>", &MACHINE[..MACHINE.find("<tendon>").unwrap()]);
    for (cfg, stiffness) in
        [(RobotCfg { drive: gains(9.0, 2.0), ..robot("m", MACHINE) }, 9.0), (robot("m", &bare), 1e4)]
    {
        let (sim, id) = with(1, cfg);
        assert!(sim.robot(id).stiffness().iter().all(|k| *k == stiffness));
    }

    // The softness of dry friction is that of the drives that hold it: a file with its own softness gets a diagnostic.
    for (softness, times) in [("", 0), (r#"solreffriction="0.05 1""#, 1), (r#"solimpfriction="0.8 0.9 0.001""#, 1)] {
        let text = MACHINE.replace(r#"frictionloss="0.3""#, &format!(r#"frictionloss="0.3" {softness}"#));
        let (sim, _) = with(1, robot("m", &text));
        assert_eq!(count_diagnostics(&sim, &["solreffriction", "\"idle\""]), times, "{softness}");
    }
}

/// `a` follows `b` by -0.5 and `c` follows `a` by 3; the actuators are at the ends of the chain.
pub(super) const CHAIN: &str = include_str!("../../data/mjcf/chain.xml");

/// An actuator of a follower drives the follower's driver. By virtual work: `k = 100 (2 · 0.5)² + 10 · 1.5²`, `d = 4 ·
/// 1.5²`, `F = 30 · 2 · 0.5 + 20 · 1.5`. Against a spring of k / 2 the drive reaches two thirds of the way.
#[test]
fn followers() {
    let (mut sim, id) = with(1, robot("r", CHAIN));
    let of = sim.robot(id);
    let b = of.joint_id("b").unwrap();
    assert_eq!((of.stiffness(), of.damping()), (array![[0.0, 122.5, 0.0]], array![[0.0, 9.0, 0.0]]));
    assert_eq!((of.qf_limits()[(0, 1)], of.drive_types()[(0, 1)]), (60.0, DriveType::Force));
    assert_reported(&sim, &["actuator \"pa\"", "\"a\" is a mimic joint of \"b\""]);
    sim.robot_mut(id).set_qpos_target(&array![[0.3]], Some(&[b]), None).unwrap();
    sim.update(2000);
    let qpos = sim.robot(id).qpos();
    // Nothing moves any more, so no coupling is loaded: only the decay of four seconds is left.
    assert!(largest(&(&qpos - &array![[-0.1, 0.2, -0.3]])) < 1e-4, "{qpos}");

    // A follower of a polynomial cannot be represented by its driver's drive; the diagnostic names the lost actuator.
    let (sim, id) = with(1, robot("r", &CHAIN.replace("0 -0.5 0 0 0", "0 -0.5 0.1 0 0")));
    assert!(sim.robot(id).drive_types().iter().all(|kind| *kind == DriveType::None));
    for name in ["pa", "pc"] {
        assert_reported(&sim, &[&format!("actuator {name:?}"), "a joint equality that is not a mimic relation"]);
    }
}

/// Two fingers on one tendon, as in parallel grippers; `%` is replaced by the linear coefficient of the second.
pub(super) const GRIPPER: &str = r#"<mujoco><compiler angle="radian" autolimits="true"/><option timestep="0.0001" gravity="0 0 0"/>
  <default><geom contype="0" conaffinity="0"/></default><worldbody><body name="palm"><geom size="0.03" mass="1"/>
    <body name="left"><joint name="left" type="slide" axis="0 1 0" range="0 0.04"/><geom size="0.01" mass="0.5"/></body>
    <body name="right"><joint name="right" type="slide" axis="0 -1 0" range="0 0.04"/><geom size="0.01" mass="0.5"/></body>
  </body></worldbody>
  <tendon><fixed name="split"><joint joint="right" coef="0.5"/><joint joint="left" coef="0.5"/></fixed></tendon>
  <equality><joint joint1="right" joint2="left" polycoef="0 % 0 0 0" solref="0.002 1"/></equality>
  <actuator><general name="grip" tendon="split" gaintype="fixed" biastype="affine" gainprm="0.01568627451 0 0"
    biasprm="0 -100 -10" ctrlrange="0 255" forcerange="-100 100"/></actuator></mujoco>"#;

/// A gripper closes like the tendon that moves both fingers. The reference is MuJoCo with the file alone, at its own
/// step of h = 1e-4 s: m = 1 kg, k = 100, d = 10, so ω = 10 and ζ = 1/2. Our drive is evaluated at the end of the step,
/// which adds h k = 0.01 to d, 0.1 percent. The coupling, loaded by half of a force of at most 3 N at 0.5 kg, yields by
/// less than 6 m/s² (0.002 s)² = 2.4e-5 m. The tolerance is 1e-4 m of 0.03.
#[test]
fn gripper() {
    let text = GRIPPER.replace('%', "1");
    let [same, half] = [1.0, 0.5].map(|scale| {
        let cfg = SimulationManagerCfg { physics_dt: 1e-4, gravity: [0.0; 3].into(), ..empty_cfg(1) };
        let mut sim = kinetoscope_testkit::worlds::sim(cfg);
        let id = sim.add_robot(robot("r", &text)).unwrap();
        let mut data = Data::new(&mj::compile(&text, &[]).unwrap().into_model()).unwrap();
        let of = sim.robot(id);
        assert_eq!(of.joint_id("left").unwrap(), JointIndex(0));
        let numbers = [of.stiffness(), of.damping()].map(|gains| gains[(0, 0)]);
        assert_eq!((numbers, of.qf_limits()[(0, 0)]), ([100.0, 10.0], 100.0));
        assert_reported(&sim, &["actuator \"grip\" acts on the tendon \"split\""]);
        assert_eq!(count_diagnostics(&sim, &["ctrlrange"]), 0, "it is all that the fingers can do");
        if scale != 1.0 {
            sim.robot_mut(id).set_stiffness(&row([100.0 * scale]), Some(&[JointIndex(0)]), None).unwrap();
        }
        sim.robot_mut(id).set_qpos_target(&row([0.03]), Some(&[JointIndex(0)]), None).unwrap();
        data.ctrl_mut()[0] = 0.03 * 100.0 / 0.01568627451;
        let [mut worst, mut farthest] = [0.0f64; 2];
        for _ in 0..40 {
            sim.update(100);
            (0..100).for_each(|_| data.step().unwrap());
            let off: Vec<f64> = sim.robot(id).qpos().iter().zip(data.qpos()).map(|(a, b)| a - b).collect();
            (worst, farthest) = (worst.max(largest(&off)), farthest.max(data.qpos()[0]));
        }
        assert!(farthest > 0.025, "it came there: {farthest}");
        worst
    });
    assert!(same < 1e-4 && half > 2e-3, "{same} m; the control, half the stiffness: {half} m");

    // A tendon whose length does not change with the fingers drives nothing.
    let (sim, id) = with(1, robot("r", &GRIPPER.replace('%', "-1")));
    assert_eq!(sim.robot(id).drive_types()[(0, 0)], DriveType::None);
    assert_eq!(sim.robot(id).stiffness(), Array2::<f64>::zeros((1, 2)));
    assert_reported(&sim, &["actuator \"grip\"", "its effort on \"left\" is always zero"]);
}

/// The scale of a control is not part of the gains, and each difference between a drive and the actuator is reported.
#[test]
fn differences() {
    let scaled = r#"gaintype="fixed" biastype="affine" gainprm="0.0157 0 0" biasprm="0 -100 -10""#;
    let with_scaled = |more: &str| format!("{scaled} {more}");
    let (servo, plain, infinite) = ((100.0, 10.0), (1e4, 1e3), f64::INFINITY);
    for (range, actuator, gains, limit, words) in [
        ("", with_scaled(""), servo, infinite, ""),
        (r#"range="0 0.04""#, with_scaled(r#"ctrlrange="0 255""#), servo, infinite, ""),
        (r#"range="0 0.05""#, with_scaled(r#"ctrlrange="0 255""#), servo, infinite, "0 .. 255 does not limit"),
        ("", with_scaled(r#"ctrlrange="0 255""#), servo, infinite, "its ctrlrange"),
        ("", with_scaled(r#"forcerange="0 5""#), servo, 5.0, "its forcerange 0 .. 5 became -5 .. 5"),
        ("", with_scaled(r#"dyntype="filter" dynprm="0.1""#), servo, infinite, "its activation dynamics (filter)"),
        ("", r#"gainprm="2" ctrlrange="-1 3" forcerange="-5 5""#.into(), plain, 5.0, "-2 .. 6 became -6 .. 6"),
        ("", r#"gainprm="2" ctrlrange="-1 1" forcerange="-5 5""#.into(), plain, 2.0, ""),
        (
            "",
            r#"biastype="affine" gainprm="5" biasprm="1 -5 0""#.into(),
            plain,
            infinite,
            "neither a position or velocity servo nor a motor",
        ),
        ("", r#"gaintype="affine" gainprm="5 1 0""#.into(), plain, infinite, "gaintype affine"),
        ("", r#"gear="0""#.into(), (0.0, 0.0), infinite, "its effort on \"j\" is always zero"),
    ] {
        let text = format!(
            r#"<mujoco><compiler angle="radian" autolimits="true"/><worldbody><body name="base"><geom size="0.1" mass="1"/>
            <body><joint name="j" type="slide" {range}/><geom size="0.05" mass="1"/></body></body></worldbody>
            <actuator><general name="x" joint="j" {actuator}/></actuator></mujoco>"#
        );
        let (sim, id) = with(1, robot("r", &text));
        let of = sim.robot(id);
        let found = (of.stiffness()[(0, 0)], of.damping()[(0, 0)]);
        assert_eq!((found, of.qf_limits()[(0, 0)]), (gains, limit), "{actuator}");
        let all = count_diagnostics(&sim, &["differs from the drive that replaces it"]);
        let expected = usize::from(!words.is_empty());
        let named = count_diagnostics(&sim, &["differs from the drive that replaces it", "actuator \"x\"", words]);
        assert_eq!((all, named), (expected, expected), "{actuator}: {:#?}", sim.diagnostics());
    }
}

//! Actuators of joints that follow others, and of tendons: the drive of the joint that is followed does what they do.

use super::{empty, robot};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;

fn said(sim: &SimulationManager) -> Vec<String> {
    sim.diagnostics().iter().map(ToString::to_string).collect()
}

fn is_said(sim: &SimulationManager, words: &[&str]) -> bool {
    said(sim).iter().any(|d| words.iter().all(|word| d.contains(word)))
}

/// `a` follows `b` by -0.5 and `c` follows `a` by 3; the actuators are at the ends of the chain.
pub(super) const CHAIN: &str = r#"<mujoco><compiler angle="radian" autolimits="true"/><option gravity="0 0 0"/>
  <default><geom contype="0" conaffinity="0"/></default><worldbody><body name="base"><geom size="0.1" mass="1"/>
    <body name="a"><joint name="a" axis="0 0 1"/><geom size="0.01" mass="0.01"/></body>
    <body name="b"><joint name="b" axis="0 0 1" stiffness="61.25"/><geom size="0.05" mass="1"/></body>
    <body name="c"><joint name="c" axis="0 0 1"/><geom size="0.01" mass="0.01"/></body>
  </body></worldbody>
  <equality><joint joint1="a" joint2="b" polycoef="0 -0.5 0 0 0" solref="0.004 1"/>
    <joint joint1="c" joint2="a" polycoef="0 3 0 0 0" solref="0.004 1"/></equality>
  <actuator><position name="pa" joint="a" kp="100" gear="2" forcerange="-30 30"/>
    <general name="pc" joint="c" gaintype="fixed" biastype="affine" gainprm="10" biasprm="0 -10 -4" forcerange="-20 20"/></actuator>
  </mujoco>"#;

/// By virtual work: `k = 100 (2 · 0.5)² + 10 · 1.5²`, `d = 4 · 1.5²`, `F = 30 · 2 · 0.5 + 20 · 1.5`. Against a spring of
/// k / 2 the drive comes two thirds of the way.
#[test]
fn an_actuator_of_a_follower_drives_what_it_follows() {
    let mut sim = empty(1);
    let id = sim.add_robot(robot("r", CHAIN)).unwrap();
    let b = sim.robot(id).joint_id("b").unwrap();
    assert_eq!(sim.robot(id).get_stiffness(), array![[0.0, 122.5, 0.0]]);
    assert_eq!(sim.robot(id).get_damping(), array![[0.0, 9.0, 0.0]]);
    assert_eq!(sim.robot(id).qf_limits()[(0, 1)], 60.0);
    assert_eq!(sim.robot(id).get_drive_types()[(0, 1)], DriveType::Force);
    assert!(is_said(&sim, &["actuator \"pa\"", "\"a\" follows \"b\""]), "{:?}", said(&sim));
    sim.robot_mut(id).set_qpos(&array![[0.3]], Some(&[b]), None).unwrap();
    sim.update(2000);
    let qpos = sim.robot(id).get_qpos();
    // Nothing moves any more, so no coupling is loaded but by nothing: what is left is the decay of four seconds.
    for (found, expected) in [(qpos[(0, 1)], 0.2), (qpos[(0, 0)], -0.1), (qpos[(0, 2)], -0.3)] {
        assert!((found - expected).abs() < 1e-4, "{qpos}");
    }
}

/// Two fingers on one tendon, the pattern of parallel grippers; `%` is the polynomial of the second.
pub(super) const GRIPPER: &str = r#"<mujoco><compiler angle="radian" autolimits="true"/><option timestep="0.0001" gravity="0 0 0"/>
  <default><geom contype="0" conaffinity="0"/></default><worldbody><body name="palm"><geom size="0.03" mass="1"/>
    <body name="left"><joint name="left" type="slide" axis="0 1 0" range="0 0.04"/><geom size="0.01" mass="0.5"/></body>
    <body name="right"><joint name="right" type="slide" axis="0 -1 0" range="0 0.04"/><geom size="0.01" mass="0.5"/></body>
  </body></worldbody>
  <tendon><fixed name="split"><joint joint="right" coef="0.5"/><joint joint="left" coef="0.5"/></fixed></tendon>
  <equality><joint joint1="right" joint2="left" polycoef="0 % 0 0 0" solref="0.002 1"/></equality>
  <actuator><general name="grip" tendon="split" gaintype="fixed" biastype="affine" gainprm="0.01568627451 0 0"
    biasprm="0 -100 -10" ctrlrange="0 255" forcerange="-100 100"/></actuator></mujoco>"#;

/// MuJoCo with the file alone is the judge, at its own step of h = 1e-4 s: m = 1 kg, k = 100, d = 10, so ω = 10 and ζ = 1/2.
/// Our drive is evaluated at the end of the step, which adds h k = 0.01 to d, 0.1 percent; the coupling, loaded by half of
/// the force of at most 3 N at 0.5 kg, gives way by less than 6 m/s² (0.002 s)² = 2.4e-5 m. So 1e-4 m of 0.03.
#[test]
fn a_gripper_closes_as_the_tendon_that_moves_both_fingers() {
    use kinetoscope::sim::mj;
    let text = GRIPPER.replace('%', "1");
    let cfg = || SimulationManagerCfg {
        physics_dt: 1e-4,
        gravity: [0.0; 3].into(),
        ground: None,
        lights: vec![],
        ..Default::default()
    };
    let moved = |scale: f64| {
        let mut sim = SimulationManager::new(cfg()).unwrap();
        let id = sim.add_robot(robot("r", &text)).unwrap();
        let left = sim.robot(id).joint_id("left").unwrap();
        if scale == 1.0 {
            assert_eq!((sim.robot(id).get_stiffness()[(0, 0)], sim.robot(id).get_damping()[(0, 0)]), (100.0, 10.0));
            assert_eq!(sim.robot(id).qf_limits()[(0, 0)], 100.0);
            assert!(is_said(&sim, &["actuator \"grip\" acts on the tendon \"split\""]), "{:?}", said(&sim));
            assert!(!is_said(&sim, &["ctrlrange"]), "it is all that the fingers can do: {:?}", said(&sim));
        } else {
            sim.robot_mut(id).set_stiffness(&array![[100.0 * scale]], Some(&[left]), None).unwrap();
        }
        sim.robot_mut(id).set_qpos(&array![[0.03]], Some(&[left]), None).unwrap();
        let mut data = mj::Data::new(&mj::compile(&text, &[]).unwrap().into_model()).unwrap();
        data.ctrl_mut()[0] = 0.03 * 100.0 / 0.01568627451;
        let mut worst = 0.0f64;
        for _ in 0..40 {
            sim.update(100);
            (0..100).for_each(|_| data.step().unwrap());
            let ours = sim.robot(id).get_qpos();
            worst = worst.max((ours[(0, 0)] - data.qpos()[0]).abs()).max((ours[(0, 1)] - data.qpos()[1]).abs());
        }
        assert!(data.qpos()[0] > 0.025, "it came there: {:?}", data.qpos());
        worst
    };
    let (same, half) = (moved(1.0), moved(0.5));
    assert!(same < 1e-4, "{same} m");
    assert!(half > 2e-3, "the control, half the stiffness: {half} m");
}

/// The tendon keeps its length while the fingers go: nothing drives them.
#[test]
fn an_actuator_whose_effort_cancels_drives_nothing() {
    let mut sim = empty(1);
    let id = sim.add_robot(robot("r", &GRIPPER.replace('%', "-1"))).unwrap();
    assert_eq!(sim.robot(id).get_drive_types()[(0, 0)], DriveType::None);
    assert_eq!(sim.robot(id).get_stiffness(), Array2::<f64>::zeros((1, 2)));
    assert!(is_said(&sim, &["actuator \"grip\"", "never moves \"left\""]), "{:?}", said(&sim));
}

/// What a curve couples follows nothing that a drive could stand for; that its actuator is gone is said.
#[test]
fn an_actuator_of_a_joint_that_a_curve_holds_is_said_to_be_gone() {
    let text = CHAIN.replace("0 -0.5 0 0 0", "0 -0.5 0.1 0 0");
    let mut sim = empty(1);
    let id = sim.add_robot(robot("r", &text)).unwrap();
    assert!(sim.robot(id).get_drive_types().iter().all(|kind| *kind == DriveType::None));
    for name in ["pa", "pc"] {
        assert!(is_said(&sim, &[&format!("actuator {name:?}"), "an equality holds"]), "{:?}", said(&sim));
    }
}

/// The scale of a control is no part of the gains, and what a drive does not do as the actuator is said, one by one.
#[test]
fn what_a_drive_does_not_say_of_an_actuator_is_said() {
    let file = |range: &str, actuator: &str| {
        format!(
            r#"<mujoco><compiler angle="radian" autolimits="true"/><worldbody><body name="base"><geom size="0.1" mass="1"/>
            <body><joint name="j" type="slide" {range}/><geom size="0.05" mass="1"/></body></body></worldbody>
            <actuator><general name="x" joint="j" {actuator}/></actuator></mujoco>"#
        )
    };
    let scaled = r#"gaintype="fixed" biastype="affine" gainprm="0.0157 0 0" biasprm="0 -100 -10""#;
    let infinite = f64::INFINITY;
    for (range, actuator, gains, limit, words) in [
        ("", scaled.to_string(), (100.0, 10.0), infinite, ""),
        (r#"range="0 0.04""#, format!(r#"{scaled} ctrlrange="0 255""#), (100.0, 10.0), infinite, ""),
        (
            r#"range="0 0.05""#,
            format!(r#"{scaled} ctrlrange="0 255""#),
            (100.0, 10.0),
            infinite,
            "0 .. 255 does not limit",
        ),
        ("", format!(r#"{scaled} ctrlrange="0 255""#), (100.0, 10.0), infinite, "its ctrlrange"),
        ("", format!(r#"{scaled} forcerange="0 5""#), (100.0, 10.0), 5.0, "its forcerange 0 .. 5 became -5 .. 5"),
        ("", format!(r#"{scaled} dyntype="filter" dynprm="0.1""#), (100.0, 10.0), infinite, "its activation (filter)"),
        ("", r#"gainprm="2" ctrlrange="-1 3" forcerange="-5 5""#.into(), (1e4, 1e3), 5.0, "-2 .. 6 became -6 .. 6"),
        ("", r#"gainprm="2" ctrlrange="-1 1" forcerange="-5 5""#.into(), (1e4, 1e3), 2.0, ""),
        ("", r#"biastype="affine" gainprm="5" biasprm="1 -5 0""#.into(), (1e4, 1e3), infinite, "no servo and no motor"),
        ("", r#"gaintype="affine" gainprm="5 1 0""#.into(), (1e4, 1e3), infinite, "gaintype affine"),
        ("", r#"gear="0""#.into(), (0.0, 0.0), infinite, "never moves"),
    ] {
        let mut sim = empty(1);
        let id = sim.add_robot(robot("r", &file(range, &actuator))).unwrap();
        let robot_ = sim.robot(id);
        assert_eq!((robot_.get_stiffness()[(0, 0)], robot_.get_damping()[(0, 0)]), gains, "{actuator}");
        assert_eq!(robot_.qf_limits()[(0, 0)], limit, "{actuator}");
        let differs: Vec<String> = said(&sim).into_iter().filter(|d| d.contains("differs from its drive")).collect();
        assert_eq!(differs.len(), usize::from(!words.is_empty()), "{actuator}: {differs:?}");
        assert!(differs.iter().all(|d| d.contains("actuator \"x\"") && d.contains(words)), "{actuator}: {differs:?}");
    }
}

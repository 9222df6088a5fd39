//! Equality constraints of joints: mimic joints, and constraints that only hold.

use super::*;
use kinetoscope::ndarray::array;
use kinetoscope::robot::diagnostic::DiagnosticKind;
use kinetoscope::robot::kinematics::{IkCfg, KinematicsError, TipFrame};
use kinetoscope::sim::Error;
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::worlds::count_diagnostics;

/// A driven crank, a finger on either side, and a fourth joint; `%` is replaced by the equalities.
const HAND: &str = r#"<mujoco><compiler angle="radian" autolimits="true"/><worldbody><body name="palm"><geom size="0.03" mass="1"/>
    <body name="crank"><joint name="crank" axis="0 0 1" range="-1 1" ref="0.1"/><geom size="0.02" pos="0.05 0 0" mass="0.2"/></body>
    <body name="left" pos="0 0.1 0"><joint name="left" axis="0 0 1" range="-2 2" ref="-0.2"/>
      <geom size="0.01" pos="0.05 0 0" mass="0.05"/></body>
    <body name="right" pos="0 -0.1 0"><joint name="right" type="slide" axis="1 0 0" range="-0.3 0.3"/>
      <geom size="0.01" mass="0.05"/></body>
    <body name="other" pos="0 -0.2 0"><joint name="other" axis="0 0 1" range="-1 1" damping="0.1"/>
      <geom size="0.01" pos="0.05 0 0" mass="0.05"/></body>
  </body></worldbody><equality>%</equality></mujoco>"#;

const LINES: &str = r#"<joint joint1="left" joint2="crank" polycoef="0.05 -1.5 0 0 0" solref="0.004 1"/>
    <joint joint1="right" joint2="left" polycoef="0 0.1 0 0 0" solref="0.004 1"/>"#;

fn hand(equalities: &str) -> RobotCfg {
    robot("hand", &HAND.replace('%', equalities))
}

/// `left - ref = 0.05 - 1.5 (crank - ref)`, as in MuJoCo's equation; `right` follows `left`, and thus the crank.
fn implied(crank: f64) -> (f64, f64) {
    let left = -0.2 + 0.05 - 1.5 * (crank - 0.1);
    (left, 0.1 * (left + 0.2))
}

#[test]
fn lines() {
    let (mut sim, id) = with(1, hand(LINES));
    let crank = sim.robot(id).joint_id("crank").unwrap();
    let columns = ["crank", "left", "right", "other"].map(|name| sim.robot(id).joint_id(name).unwrap());
    assert_eq!(columns.map(|c| sim.robot(id).is_mimic(c).unwrap()), [false, true, true, false]);
    let drivers = sim.robot(id).mimic_drivers();
    let (left, right) = implied(0.0);
    assert_eq!((drivers[1].0, drivers[2].0), (crank, crank));
    for (found, expected) in [(drivers[1].1, -1.5), (drivers[1].2, left), (drivers[2].1, -0.15), (drivers[2].2, right)]
    {
        assert!((found - expected).abs() < 1e-15, "{drivers:?}");
    }
    // Followers start at their implied positions, other joints at those of the file.
    let (left, right) = implied(0.1);
    let start = sim.robot(id).default_qpos();
    assert!((start - array![[0.1, left, right, 0.0]]).iter().all(|d| d.abs() < 1e-15));
    for target in [0.6, -0.7] {
        sim.robot_mut(id).set_qpos_target(&array![[target]], Some(&[crank]), None).unwrap();
        sim.update(500);
        let qpos = sim.robot(id).qpos();
        let (left, right) = implied(qpos[(0, 0)]);
        assert!((qpos[(0, 0)] - target).abs() < 1e-3, "{qpos}");
        // MuJoCo's couplings yield slightly, those of light unloaded fingers hardly.
        assert!((qpos[(0, 1)] - left).abs() < 1e-3 && (qpos[(0, 2)] - right).abs() < 1e-3, "{qpos}: {left} {right}");
        let targets = sim.robot(id).qpos_target();
        assert!((targets[(0, 1)] - implied(target).0).abs() < 1e-12, "{targets}");
    }
    // Forward kinematics apply the couplings too.
    let fk = sim.robot(id).compute_fk(&array![[0.3, 9.0, 9.0, 0.0]], "right", None).unwrap();
    assert!((fk[(0, 0)] - implied(0.3).1).abs() < 1e-12, "{fk}");
}

/// A parabola, a constant position, and a cycle of linear couplings: joints are not driven against them.
#[test]
fn curves_and_circles() {
    let circle = format!("{LINES}<joint joint1=\"crank\" joint2=\"right\" polycoef=\"0 1 0 0 0\"/>");
    for (equalities, qpos) in [
        (r#"<joint joint1="left" joint2="crank" polycoef="0 0.5 0.8 0 0"/>"#, Some(-0.2 + 0.5 * 0.4 + 0.8 * 0.16)),
        (r#"<joint joint1="left" polycoef="0.3 0 0 0 0"/>"#, Some(0.1)),
        (circle.as_str(), None),
    ] {
        let (mut sim, id) = with(1, hand(equalities));
        assert_eq!(count_diagnostics(&sim, &["is not a linear mimic relation"]), 1, "{:?}", sim.diagnostics());
        let Some(expected) = qpos else {
            assert!(count_diagnostics(&sim, &["joint \"crank\" has no drive"]) > 0, "{:?}", sim.diagnostics());
            // crank = 0.1 + right, right = 0.1 (left + 0.2) and left = -0.15 - 1.5 (crank - 0.1) have one common
            // solution, right = 0.1 (0.05 - 1.5 right). The couplings are solved together, so the joints settle within
            // 1e-3 of the solution.
            let right = 0.005 / 1.15;
            assert_eq!(sim.robot(id).stiffness().row(0).to_vec(), [0.0, 0.0, 0.0, 1e4]);
            sim.update(1000);
            let qpos = sim.robot(id).qpos();
            for (column, expected) in [(0, 0.1 + right), (1, -0.15 - 1.5 * right), (2, right)] {
                assert!((qpos[(0, column)] - expected).abs() < 1e-3, "{qpos}: {expected}");
            }
            assert!(sim.diverged().is_empty());
            continue;
        };
        assert_eq!(sim.robot(id).stiffness().row(0).to_vec(), [1e4, 0.0, 1e4, 1e4]);
        sim.robot_mut(id).set_qpos_target(&array![[0.5, 0.0, 0.0, 0.0]], None, None).unwrap();
        sim.update(1000);
        let left = sim.robot(id).qpos()[(0, 1)];
        assert!((left - expected).abs() < 1e-3, "{left} is not {expected}");
        let undriven = sim.robot_mut(id).set_stiffness(&row([1.0; 4]), None, None);
        assert!(matches!(&undriven, Err(Error::NotDriven { joint, .. }) if joint == "left"), "{undriven:?}");
    }
}

/// Followers of polynomials start on their curve for any start of their driver, also through mimics and other curves:
/// MuJoCo's equalities have no residual, and nothing moves. Positions are exact up to rounding, 1e-15 of 1. (The forces
/// of the equalities are not solved before the first step: MuJoCo 4 leaves old memory there.)
#[test]
fn starts_on_curves() {
    let parabola = r#"<joint joint1="left" joint2="crank" polycoef="0.02 0.5 0.8 -0.3 0.1"/>"#;
    let at = |x: f64| -0.2 + 0.02 + 0.5 * x + 0.8 * x * x - 0.3 * x * x * x + 0.1 * x * x * x * x;
    let chain = format!("{parabola}<joint joint1=\"right\" joint2=\"left\" polycoef=\"0 0.1 0.2 0 0\"/>");
    let of_mimic = format!("{parabola}<joint joint1=\"right\" joint2=\"left\" polycoef=\"0 0.1 0 0 0\"/>");
    let behind = |x: f64, square: f64| 0.1 * (at(x) + 0.2) + square * (at(x) + 0.2).powi(2);
    let constant = r#"<joint joint1="left" polycoef="0.3 0 0 0 0"/>"#;
    for (equalities, crank, left, right) in [
        (parabola, 0.5, at(0.4), 0.0),
        // A joint without a given start begins at the position of the file.
        (parabola, 0.1, at(0.0), 0.0),
        (chain.as_str(), -0.4, at(-0.5), behind(-0.5, 0.2)),
        (of_mimic.as_str(), -0.4, at(-0.5), behind(-0.5, 0.0)),
        (constant, 0.5, -0.2 + 0.3, 0.0),
    ] {
        // A start given for the follower itself is ignored, as for a mimic.
        let mut init_qpos = vec![("left".to_string(), 1.5)];
        if crank != 0.1 {
            init_qpos.push(("crank".into(), crank));
        }
        let (mut sim, id) = with(2, RobotCfg { init_qpos, ..hand(equalities) });
        let expected = array![crank, left, right, 0.0];
        for when in ["at first", "after a reset"] {
            let qpos = sim.robot(id).qpos();
            assert!((&qpos.row(1) - &expected).iter().all(|d| d.abs() < 1e-14), "{when}: {qpos}, not {expected}");
            assert_eq!(sim.robot(id).default_qpos().row(0), qpos.row(0));
            let off = sim.batch().read(0, |env| env.data().efc_pos()[..env.data().ne()].to_vec());
            assert!(!off.is_empty() && off.iter().all(|off| off.abs() < 1e-14), "{when}: {off:?}");
            sim.update(50);
            let moved = largest(&(sim.robot(id).qpos() - &expected));
            assert!(moved < 1e-9, "{when}: {moved}");
            sim.reset(None).unwrap();
        }
        assert_eq!(count_diagnostics(&sim, &["the start position"]), 0, "{:?}", sim.diagnostics());
    }
    // A cycle of curves, and two curves for one joint, do not determine a position: the file's own is used.
    let circle = format!("{parabola}<joint joint1=\"crank\" joint2=\"left\" polycoef=\"0 0 1 0 0\"/>");
    let twice = format!("{parabola}{constant}");
    for (equalities, starts) in [(circle, [0.1, at(0.0)]), (twice, [0.1, -0.2])] {
        let (sim, id) = with(1, hand(&equalities));
        let qpos = sim.robot(id).qpos();
        assert!((qpos[(0, 0)] - starts[0]).abs() + (qpos[(0, 1)] - starts[1]).abs() < 1e-14, "{equalities}: {qpos}");
    }
}

/// left - ref = (crank - ref)⁴ on a crank without limits, or with a factor on a crank with limits: 1e100⁴ overflows,
/// and a start beyond the follower's own limits is reported.
#[test]
fn starts_beyond_limits() {
    let quartic = r#"<joint joint1="left" joint2="crank" polycoef="0 0 0 0 1"/>"#;
    let unlimited = HAND.replace('%', quartic).replacen(r#"range="-1 1" ref="0.1""#, r#"ref="0.1""#, 1);
    let starts = |at: f64| {
        let mut sim = empty(1);
        let init_qpos = vec![("crank".into(), at)];
        sim.add_robot(RobotCfg { init_qpos, ..robot("hand", &unlimited) }).map(|id| {
            let mut messages = sim.diagnostics().to_vec();
            messages.retain(|d| d.kind == DiagnosticKind::FollowerStartsBeyondLimits);
            (sim.robot(id).qpos()[(0, 1)], messages.into_iter().map(|d| d.message.clone()).collect::<Vec<String>>())
        })
    };
    assert_error(starts(1e100), "", &["\"left\" is inf"]);
    // -0.2 + 1.5⁴ = 4.8625, beyond 2.
    let (left, said) = starts(1.6).unwrap();
    assert!((left - 4.8625).abs() < 1e-12 && said.len() == 1, "{left} {said:?}");
    assert!(["\"left\"", "4.8625", "-2.0000 .. 2.0000"].iter().all(|word| said[0].contains(word)), "{said:?}");
    // Control: 1.2⁴ - 0.2 = 1.87 is inside.
    assert_eq!(starts(1.3).unwrap().1, Vec::<String>::new());
}

/// A follower of a polynomial would have to move with the solved joints: inverse kinematics refuse it if it moves the
/// frame.
#[test]
fn inverse_kinematics() {
    let (sim, id) = with(1, hand(r#"<joint joint1="left" joint2="crank" polycoef="0 0.5 0.8 0 0"/>"#));
    let robot = sim.robot(id);
    let ik = |link: &str| {
        let target = robot.link_pose(link).unwrap();
        robot.compute_ik(&target, TipFrame::of_link(link), &IkCfg::default(), None, None)
    };
    let Err(Error::Kinematics { error, .. }) = ik("left") else { panic!("accepted") };
    let is_named = |joint: &str, link: &str| joint == "left" && link == "left";
    assert!(matches!(&*error, KinematicsError::PolynomialCoupling { joint, link } if is_named(joint, link)), "{error}");
    // Controls: the follower moves neither its driver's own link nor the link of another joint.
    assert!(ik("crank").unwrap().success[0] && ik("other").unwrap().success[0]);
}

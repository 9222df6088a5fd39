//! An arm of two links in a plane: everything has a closed form.

use crate::kinematics::robots::*;
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;

const L1: f64 = 0.5;
const L2: f64 = 0.3;

fn two_links(limit: &str) -> (tempfile::TempDir, SimulationManager, RobotId) {
    let joints = [
        joint(
            "shoulder",
            "revolute",
            ["root", "upper"],
            "0 0 0",
            "0 0 1",
            "<limit lower=\"-3.2\" upper=\"3.2\" effort=\"9\" velocity=\"9\"/>",
        ),
        joint("elbow", "revolute", ["upper", "lower"], &format!("{L1} 0 0"), "0 0 1", limit),
    ];
    let dir = written(&["root", "upper", "lower"], &joints);
    let (sim, id) = simulation(1, arm(dir.path().join("r.urdf")));
    (dir, sim, id)
}

const WIDE: &str = "<limit lower=\"-3.2\" upper=\"3.2\" effort=\"9\" velocity=\"9\"/>";

fn hand() -> Tip<'static> {
    Tip::of_part("arm").with_tcp(Pose::translation(L2, 0.0, 0.0))
}

/// Shoulder and elbow for the point (x, y): the law of cosines, elbow turned to the side of `side`.
fn closed_form(x: f64, y: f64, side: f64) -> [f64; 2] {
    let cosine = (x * x + y * y - L1 * L1 - L2 * L2) / (2.0 * L1 * L2);
    let elbow = side * cosine.acos();
    [y.atan2(x) - (L2 * elbow.sin()).atan2(L1 + L2 * elbow.cos()), elbow]
}

/// A variable moves a frame exactly where the frame's Jacobian has a column for it that is not zero.
#[test]
fn joints_beyond_a_link_do_not_move_it() {
    use kinetoscope::sim::kinematics::Chain;
    let (_dir, sim, id) = two_links(WIDE);
    let robot = sim.robot(id);
    for (link, moved) in [("root", [false, false]), ("upper", [true, false]), ("lower", [true, true])] {
        let chain = Chain::new(robot.description(), robot.link_id(link).unwrap(), &Pose::identity()).unwrap();
        assert_eq!([0, 1].map(|variable| chain.is_moved_by(variable)), moved, "{link}");
        assert!(!chain.is_moved_by(2), "there is no such variable");
        let turned = [0, 1].map(|variable| {
            let mut q = [0.3, 0.4];
            let before = chain.pose(&q);
            q[variable] += 0.1;
            chain.pose(&q).rotation.angle_to(&before.rotation) > 0.09
        });
        assert_eq!(turned, moved, "{link}");
    }
}

fn at(x: f64, y: f64) -> Array2<f64> {
    array![[x, y, 0.0, 1.0, 0.0, 0.0, 0.0]]
}

/// A position alone leaves two solutions: each start finds its own. 1e-4 m at the hand are at most 1e-4 / 0.1 rad at a
/// joint, the smallest singular value of these Jacobians being above 0.1; the finish leaves far less.
#[test]
fn a_position_has_two_solutions() {
    let (_dir, sim, id) = two_links(WIDE);
    let robot = sim.robot(id);
    let cfg = IkCfg { task: IkTask::Position, ..Default::default() };
    for (x, y) in [(0.5, 0.2), (-0.3, 0.4), (0.1, -0.6), (0.35, 0.0)] {
        let both = [1.0, -1.0].map(|side| closed_form(x, y, side));
        assert!((both[0][1] - both[1][1]).abs() > 0.5, "two that differ");
        for expected in both {
            let near = array![[expected[0] + 0.2, expected[1] - 0.15]];
            let found = robot.compute_ik(&at(x, y), hand(), &cfg, Some(near.view()), None).unwrap();
            assert!(found.success[0] && found.seed[0] == 0, "{found:?}");
            for (q, expected) in found.qpos.iter().zip(expected) {
                assert!((q - expected).abs() < 1e-5, "({x}, {y}): {} is not {expected:?}", found.qpos);
            }
        }
    }
}

/// A pose has one: that whose hand points as wanted, from wherever the search starts.
#[test]
fn a_pose_has_one_solution() {
    let (_dir, sim, id) = two_links(WIDE);
    let robot = sim.robot(id);
    for side in [1.0, -1.0] {
        let expected = closed_form(0.45, -0.3, side);
        let turn = nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, expected[0] + expected[1]);
        let target = Pose::from_parts(nalgebra::Translation3::new(0.45, -0.3, 0.0), turn);
        for start in [[0.0, 0.0], [1.5, -2.0], [-2.0, 2.5]] {
            let start = array![start];
            let found = robot.compute_ik(&target, hand(), &IkCfg::default(), Some(start.view()), None).unwrap();
            assert!(found.success[0], "{found:?}");
            for (q, expected) in found.qpos.iter().zip(expected) {
                assert!((q - expected).abs() < 1e-5, "{} is not {expected:?}", found.qpos);
            }
        }
    }
}

/// Beyond the outer circle and inside of the inner one the distance to them is left, the hand points at the target or
/// away from it, and it says that it failed. The search ends where the error does not grow smaller in double precision:
/// it is quadratic in the angle that is still missing, of about 1e-7.
#[test]
fn what_is_out_of_reach_is_approached_and_said_so() {
    let (_dir, sim, id) = two_links(WIDE);
    let robot = sim.robot(id);
    let cfg = IkCfg { task: IkTask::Position, ..Default::default() };
    for (x, y) in [(1.0_f64, 0.4), (-0.7, 0.7), (0.0, -0.9), (0.81, 0.0), (0.1, 0.05), (-0.12, 0.1)] {
        let r = x.hypot(y);
        let expected = (r - (L1 + L2)).max(L1 - L2 - r);
        let found = robot.compute_ik(&at(x, y), hand(), &cfg, None, None).unwrap();
        assert!(!found.success[0] && expected > 0.0);
        assert!((found.position_error[0] - expected).abs() < 1e-9, "({x}, {y}): {found:?}, expected {expected}");
        let hand = robot.compute_fk(&found.qpos, hand(), None).unwrap();
        let on_circle = hand[(0, 0)].hypot(hand[(0, 1)]);
        let circle = if r > L1 { L1 + L2 } else { L1 - L2 };
        assert!((on_circle - circle).abs() < 1e-9, "{on_circle}");
    }
    // The control: a hair inside it succeeds.
    let found = robot.compute_ik(&at(L1 + L2 - 1e-6, 0.0), hand(), &cfg, None, None).unwrap();
    assert!(found.success[0], "{found:?}");
}

/// Out of the plane: the height is left, and so is the turn about the axes that no joint has.
#[test]
fn what_no_joint_does_is_left() {
    let (_dir, sim, id) = two_links(WIDE);
    let robot = sim.robot(id);
    let cfg = IkCfg { task: IkTask::Position, ..Default::default() };
    let mut target = at(0.5, 0.2);
    target[(0, 2)] = 0.25;
    let found = robot.compute_ik(&target, hand(), &cfg, None, None).unwrap();
    assert!(!found.success[0] && (found.position_error[0] - 0.25).abs() < 1e-9, "{found:?}");
    let expected = [closed_form(0.5, 0.2, 1.0), closed_form(0.5, 0.2, -1.0)];
    assert!(expected.iter().any(|e| (found.qpos[(0, 0)] - e[0]).abs() + (found.qpos[(0, 1)] - e[1]).abs() < 1e-5));
}

/// An elbow that cannot stretch: it stays at its limit, and the hand as far out as that lets it, which is the third
/// side of the triangle.
#[test]
fn a_limit_keeps_the_arm_short() {
    let (_dir, sim, id) = two_links("<limit lower=\"0.8\" upper=\"2.5\" effort=\"9\" velocity=\"9\"/>");
    let robot = sim.robot(id);
    let cfg = IkCfg { task: IkTask::Position, ..Default::default() };
    let longest = (L1 * L1 + L2 * L2 + 2.0 * L1 * L2 * 0.8_f64.cos()).sqrt();
    let found = robot.compute_ik(&at(0.0, longest + 0.02), hand(), &cfg, None, None).unwrap();
    assert!(!found.success[0] && (found.position_error[0] - 0.02).abs() < 1e-9, "{found:?}");
    assert_eq!(found.qpos[(0, 1)], 0.8);
    // Just inside, with the elbow a little bent.
    let found = robot.compute_ik(&at(0.0, longest - 0.01), hand(), &cfg, None, None).unwrap();
    assert!(found.success[0] && found.qpos[(0, 1)] > 0.8, "{found:?}");
}

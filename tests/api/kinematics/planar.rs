//! A planar arm of two links, with closed forms for everything.

use super::*;
use kinetoscope::robot::description::LinkId;
use kinetoscope::robot::kinematics::{Chain, IkSolver, KinematicsError};
use kinetoscope::robot::kinematics::{IkCfg, IkTask, TipFrame};
use kinetoscope_testkit::urdf::joint;

const L1: f64 = 0.5;
const L2: f64 = 0.3;

fn two_links(elbow: [f64; 2]) -> (SimulationManager, RobotId) {
    let joints = [
        joint("shoulder", "revolute", ["root", "upper"], [0.0; 3], "0 0 1", &wide([-3.2, 3.2])),
        joint("elbow", "revolute", ["upper", "lower"], [L1, 0.0, 0.0], "0 0 1", &wide(elbow)),
    ];
    built(1, &["root", "upper", "lower"], &joints)
}

fn hand() -> TipFrame<'static> {
    TipFrame::of_part("arm").with_tcp(Pose::translation(L2, 0.0, 0.0))
}

fn position() -> IkCfg {
    IkCfg { task: IkTask::Position, ..Default::default() }
}

/// Shoulder and elbow angles for the point (x, y) by the law of cosines, with the elbow on the side given by `side`.
fn closed_form(x: f64, y: f64, side: f64) -> [f64; 2] {
    let cosine = (x * x + y * y - L1 * L1 - L2 * L2) / (2.0 * L1 * L2);
    let elbow = side * cosine.acos();
    [y.atan2(x) - (L2 * elbow.sin()).atan2(L1 + L2 * elbow.cos()), elbow]
}

fn at(x: f64, y: f64) -> Array2<f64> {
    row(&[x, y, 0.0, 1.0, 0.0, 0.0, 0.0])
}

/// A position alone has two solutions, and each start leads to its own; a pose has one solution, with the requested
/// hand direction, from any start. 1e-4 m at the hand are at most 1e-4 / 0.1 rad at a joint, because the smallest
/// singular value of these Jacobians is above 0.1; the final iterations leave far less.
#[test]
fn solutions() {
    let (sim, id) = two_links([-3.2, 3.2]);
    let robot = sim.robot(id);
    let mut cases = Vec::new();
    for (x, y) in [(0.5, 0.2), (-0.3, 0.4), (0.1, -0.6), (0.35, 0.0)] {
        let both = [1.0, -1.0].map(|side| closed_form(x, y, side));
        assert!((both[0][1] - both[1][1]).abs() > 0.5, "two that differ");
        cases.extend(both.map(|q| (at(x, y), position(), [q[0] + 0.2, q[1] - 0.15], q)));
    }
    for side in [1.0, -1.0] {
        let q = closed_form(0.45, -0.3, side);
        let turn = nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, q[0] + q[1]);
        let target = row(&[0.45, -0.3, 0.0, turn.w, turn.i, turn.j, turn.k]);
        cases.extend([[0.0, 0.0], [1.5, -2.0], [-2.0, 2.5]].map(|from| (target.clone(), IkCfg::default(), from, q)));
    }
    for (target, cfg, from, expected) in cases {
        let found = robot.compute_ik(&target, hand(), &cfg, Some(row(&from).view()), None).unwrap();
        assert!(found.success[0] && (cfg.task != IkTask::Position || found.seed[0] == 0), "{found:?}");
        let off = found.qpos.iter().zip(expected).map(|(q, expected)| (q - expected).abs()).fold(0.0, f64::max);
        assert!(off < 1e-5, "{target} from {from:?}: {} is not {expected:?}", found.qpos);
    }
}

/// Beyond the outer circle and inside of the inner one the distance to the circle remains, the hand points toward or
/// away from the target, and the search reports a failure. The search ends when the error stops decreasing in double
/// precision: it is quadratic in the remaining angle, about 1e-7.
#[test]
fn out_of_reach() {
    let (sim, id) = two_links([-3.2, 3.2]);
    let robot = sim.robot(id);
    let solve = |target: &Array2<f64>| robot.compute_ik(target, hand(), &position(), None, None).unwrap();
    for (x, y) in [(1.0_f64, 0.4), (-0.7, 0.7), (0.0, -0.9), (0.81, 0.0), (0.1, 0.05), (-0.12, 0.1)] {
        let r = x.hypot(y);
        let expected = (r - (L1 + L2)).max(L1 - L2 - r);
        let found = solve(&at(x, y));
        assert!(!found.success[0] && expected > 0.0);
        assert!((found.position_error[0] - expected).abs() < 1e-9, "({x}, {y}): {found:?}, expected {expected}");
        let hand = robot.compute_fk(&found.qpos, hand(), None).unwrap();
        let circle = if r > L1 { L1 + L2 } else { L1 - L2 };
        assert!((hand[(0, 0)].hypot(hand[(0, 1)]) - circle).abs() < 1e-9, "{hand}");
    }
    // Control: a target slightly inside succeeds.
    let found = solve(&at(L1 + L2 - 1e-6, 0.0));
    assert!(found.success[0], "{found:?}");
    // Out of the plane the height remains as the error.
    let mut target = at(0.5, 0.2);
    target[(0, 2)] = 0.25;
    let found = solve(&target);
    assert!(!found.success[0] && (found.position_error[0] - 0.25).abs() < 1e-9, "{found:?}");
    let expected = [closed_form(0.5, 0.2, 1.0), closed_form(0.5, 0.2, -1.0)];
    assert!(expected.iter().any(|e| (found.qpos[(0, 0)] - e[0]).abs() + (found.qpos[(0, 1)] - e[1]).abs() < 1e-5));
}

/// An elbow with a limit: it stays at its limit, and the hand is as far out as the limit allows, at the third side of
/// the triangle. Slightly inside, the elbow is slightly bent.
#[test]
fn elbow_limit() {
    let (sim, id) = two_links([0.8, 2.5]);
    let longest = (L1 * L1 + L2 * L2 + 2.0 * L1 * L2 * 0.8_f64.cos()).sqrt();
    let [beyond, inside] = [0.02, -0.01]
        .map(|by| sim.robot(id).compute_ik(&at(0.0, longest + by), hand(), &position(), None, None).unwrap());
    assert!(!beyond.success[0] && (beyond.position_error[0] - 0.02).abs() < 1e-9, "{beyond:?}");
    assert_eq!(beyond.qpos[(0, 1)], 0.8);
    assert!(inside.success[0] && inside.qpos[(0, 1)] > 0.8, "{inside:?}");
}

/// A variable moves a frame only if the frame is downstream of its joint.
#[test]
fn moved_by() {
    let (sim, id) = two_links([-3.2, 3.2]);
    let robot = sim.robot(id);
    for (link, moved) in [("root", [false, false]), ("upper", [true, false]), ("lower", [true, true])] {
        let chain = Chain::new(robot.description(), robot.link_id(link).unwrap(), &Pose::identity()).unwrap();
        assert_eq!([0, 1].map(|variable| chain.is_moved_by(variable)), moved, "{link}");
        assert!(!chain.is_moved_by(2), "there is no such variable");
        let turned = [[0.4, 0.4], [0.3, 0.5]]
            .map(|q| chain.pose(&q).rotation.angle_to(&chain.pose(&[0.3, 0.4]).rotation) > 0.09);
        assert_eq!(turned, moved, "{link}");
    }
}

/// Chains and solvers without a robot: two links, and a slide that does not move the hand, the second column of three.
#[test]
fn chains() {
    let joints = [
        joint("shoulder", "continuous", ["root", "upper"], [0.0; 3], "0 0 1", ""),
        joint("slide", "prismatic", ["root", "sled"], [0.0, 0.0, 1.0], "1 0 0", &wide([-1.0, 1.0])),
        joint("elbow", "continuous", ["upper", "lower"], [L1, 0.0, 0.0], "0 0 1", ""),
    ];
    let (sim, id) = built(1, &["root", "upper", "sled", "lower"], &joints);
    let robot = sim.robot(id);
    let tool = Pose::translation(L2, 0.0, 0.0);
    let chain = Chain::new(robot.description(), robot.link_id("lower").unwrap(), &tool).unwrap();
    let is_hand = |pose: &Pose, shoulder: f64, elbow: f64| {
        let x = L1 * shoulder.cos() + L2 * (shoulder + elbow).cos();
        let y = L1 * shoulder.sin() + L2 * (shoulder + elbow).sin();
        (pose.translation.x - x).abs() < 1e-12 && (pose.translation.y - y).abs() < 1e-12
    };
    assert_eq!((chain.variables(), [0, 1, 2].map(|k| chain.is_moved_by(k))), (3, [true, false, true]));
    assert!((chain.reach() - (L1 + L2)).abs() < 1e-15);
    assert!(is_hand(&chain.pose(&[0.4, 9.0, -1.1]), 0.4, -1.1));
    // No farther than its reach, and exactly there when stretched.
    let far = |elbow: f64| chain.pose(&[0.4, 0.0, elbow]).translation.vector.norm();
    assert!((0..63).all(|k| far(0.1 * f64::from(k)) <= chain.reach() + 1e-15));
    assert!((far(0.0) - chain.reach()).abs() < 1e-15);

    // Held joints keep their positions, and the remaining variables are renumbered.
    let held = chain.clone().reduced(&[2], &[0.7, 0.2, 0.5]);
    assert_eq!(held.variables(), 1);
    assert!([-1.0, 0.0, 2.0].into_iter().all(|elbow| is_hand(&held.pose(&[elbow]), 0.7, elbow)));
    assert!(is_hand(&chain.clone().reduced(&[2, 0], &[0.0; 3]).pose(&[-0.6, 1.2]), 1.2, -0.6), "the other way round");
    let all = chain.clone().reduced(&[], &[0.7, 0.2, 0.5]);
    assert!(all.variables() == 0 && is_hand(&all.pose(&[]), 0.7, 0.5));

    let bound = chain.reduced(&[0, 2], &[0.0; 3]);
    let mut solver = IkSolver::new(bound.clone(), vec![[-2.0, 2.0]; 2], IkCfg::default()).unwrap();
    assert_eq!(solver.chain(), &bound);
    let found = solver.solve(&bound.pose(&[0.3, 0.9]), &[0.0, 0.5]).unwrap();
    assert!(found.success && (found.positions[0] - 0.3).abs() < 1e-3 && (found.positions[1] - 0.9).abs() < 1e-3);
}

/// A chain from a link other than the root: its poses and Jacobians are in the axes of that link, and the joints above it do
/// not move it.
#[test]
fn chains_from_another_base() {
    let (sim, id) = two_links([-3.2, 3.2]);
    let robot = sim.robot(id);
    let (description, tool) = (robot.description(), Pose::translation(L2, 0.0, 0.0));
    let [root, upper, lower] = ["root", "upper", "lower"].map(|link| robot.link_id(link).unwrap());
    let chain = Chain::between(description, upper, lower, &tool).unwrap();
    assert_eq!((chain.base(), [0, 1].map(|variable| chain.is_moved_by(variable))), (upper, [false, true]));
    let mut columns = [nalgebra::Vector6::zeros(); 2];
    for elbow in [-1.2, 0.0, 0.7] {
        let (x, y) = (L1 + L2 * f64::cos(elbow), L2 * f64::sin(elbow));
        let pose = chain.jacobian(&[0.9, elbow], &mut columns);
        assert!((pose.translation.vector - nalgebra::Vector3::new(x, y, 0.0)).norm() < 1e-15, "{pose}");
        assert!((columns[1] - nalgebra::Vector6::new(-y, x - L1, 0.0, 0.0, 0.0, 1.0)).norm() < 1e-15, "{}", columns[1]);
        assert_eq!(columns[0], nalgebra::Vector6::zeros());
    }
    assert_eq!(Chain::between(description, root, lower, &tool), Chain::new(description, lower, &tool));
    assert_eq!(Chain::between(description, lower, lower, &tool).unwrap().pose(&[]), tool);
    let error = Chain::between(description, lower, upper, &tool).unwrap_err();
    let above = vec!["root".to_owned()];
    assert_eq!(error, KinematicsError::BaseNotAbove { base: "lower".into(), link: "upper".into(), above });
    assert_eq!(error.to_string(), "link \"lower\" is no base of a chain to link \"upper\"; links above it: \"root\"");
    let missing = Chain::between(description, LinkId(3), lower, &tool);
    assert_eq!(missing, Err(KinematicsError::NoSuchLink { index: 3, count: 3 }));
}

//! Chains and solvers by themselves, against closed forms of two links in a plane.

use crate::kinematics::robots::*;
use kinetoscope::prelude::*;
use kinetoscope::sim::kinematics::{Chain, IkSolver};

const L1: f64 = 0.5;
const L2: f64 = 0.3;

/// Two links in a plane, and a slide that the hand is not on.
fn chain() -> Chain {
    let joints = [
        joint("shoulder", "continuous", ["root", "upper"], "0 0 0", "0 0 1", ""),
        joint(
            "slide",
            "prismatic",
            ["root", "sled"],
            "0 0 1",
            "1 0 0",
            "<limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/>",
        ),
        joint("elbow", "continuous", ["upper", "lower"], &format!("{L1} 0 0"), "0 0 1", ""),
    ];
    let dir = written(&["root", "upper", "sled", "lower"], &joints);
    let (sim, id) = simulation(1, arm(dir.path().join("r.urdf")));
    let robot = sim.robot(id);
    Chain::new(robot.description(), robot.link_id("lower").unwrap(), &Pose::translation(L2, 0.0, 0.0)).unwrap()
}

fn hand(shoulder: f64, elbow: f64) -> [f64; 2] {
    [L1 * shoulder.cos() + L2 * (shoulder + elbow).cos(), L1 * shoulder.sin() + L2 * (shoulder + elbow).sin()]
}

fn close(pose: &Pose, expected: [f64; 2]) -> bool {
    (pose.translation.x - expected[0]).abs() < 1e-12 && (pose.translation.y - expected[1]).abs() < 1e-12
}

#[test]
fn a_chain_says_how_many_numbers_it_needs_and_how_far_it_gets() {
    let chain = chain();
    // The slide is the second column of three, and moves nothing here.
    assert_eq!((chain.variables(), [0, 1, 2].map(|k| chain.is_moved_by(k))), (3, [true, false, true]));
    assert!((chain.reach() - (L1 + L2)).abs() < 1e-15);
    assert!(close(&chain.pose(&[0.4, 9.0, -1.1]), hand(0.4, -1.1)));
    // Nowhere farther, and there where it is stretched.
    let far = |elbow: f64| chain.pose(&[0.4, 0.0, elbow]).translation.vector.norm();
    assert!(
        (0..63).all(|k| far(0.1 * f64::from(k)) <= chain.reach() + 1e-15) && (far(0.0) - chain.reach()).abs() < 1e-15
    );
}

#[test]
fn what_is_held_stays_where_it_is_and_the_rest_is_counted_anew() {
    let held = chain().held(&[2], &[0.7, 0.2, 0.5]);
    assert_eq!(held.variables(), 1);
    for elbow in [-1.0, 0.0, 2.0] {
        assert!(close(&held.pose(&[elbow]), hand(0.7, elbow)));
    }
    let other_way_round = chain().held(&[2, 0], &[0.0; 3]);
    assert!(close(&other_way_round.pose(&[-0.6, 1.2]), hand(1.2, -0.6)));
    let all = chain().held(&[], &[0.7, 0.2, 0.5]);
    assert_eq!(all.variables(), 0);
    assert!(close(&all.pose(&[]), hand(0.7, 0.5)));
}

#[test]
fn a_solver_has_the_chain_it_was_given() {
    let bound = chain().held(&[0, 2], &[0.0; 3]);
    let mut solver = IkSolver::new(bound.clone(), vec![[-2.0, 2.0]; 2], IkCfg::default()).unwrap();
    assert_eq!(solver.chain(), &bound);
    let target = bound.pose(&[0.3, 0.9]);
    let found = solver.solve(&target, &[0.0, 0.5]).unwrap();
    assert!(found.success && (found.positions[0] - 0.3).abs() < 1e-3 && (found.positions[1] - 0.9).abs() < 1e-3);
}

#[test]
fn every_number_of_a_configuration_is_checked() {
    let good = || IkCfg { posture: Some(Posture::at([0.1, 0.2])), ..IkCfg::default() };
    good().validate(2).unwrap();
    IkCfg::default().validate(7).unwrap();
    let smallest = IkCfg { max_iterations: 1, num_seeds: 1, ..good() };
    smallest.validate(2).unwrap();
    IkCfg { num_seeds: 100_000, ..good() }.validate(2).unwrap();
    let posture = |gain, rest: &[f64]| Some(Posture { rest: rest.to_vec(), gain });
    let bad = [
        ("position_tolerance", IkCfg { position_tolerance: 0.0, ..good() }),
        ("position_tolerance", IkCfg { position_tolerance: f64::INFINITY, ..good() }),
        ("rotation_tolerance", IkCfg { rotation_tolerance: -1e-3, ..good() }),
        ("damping", IkCfg { damping: f64::NAN, ..good() }),
        ("max_iterations", IkCfg { max_iterations: 0, ..good() }),
        ("num_seeds", IkCfg { num_seeds: 0, ..good() }),
        ("num_seeds", IkCfg { num_seeds: 100_001, ..good() }),
        ("posture.rest", IkCfg { posture: posture(1.0, &[0.1]), ..good() }),
        ("posture.rest", IkCfg { posture: posture(1.0, &[0.1, f64::NAN]), ..good() }),
        ("posture.gain", IkCfg { posture: posture(0.0, &[0.1, 0.2]), ..good() }),
        ("posture.gain", IkCfg { posture: posture(1.1, &[0.1, 0.2]), ..good() }),
    ];
    for (field, cfg) in bad {
        let error = cfg.validate(2).unwrap_err().to_string();
        assert!(error.contains(field), "{field}: {error}");
    }
}

//! Mistakes give errors that name them.

use super::*;
use kinetoscope::ndarray::array;
use kinetoscope::robot::kinematics::{IkCfg, NullSpacePosture, TipFrame};
use kinetoscope::sim::Result;
use kinetoscope_testkit::error_tables::assert_error;

#[track_caller]
fn assert_says(result: Result<impl std::fmt::Debug>, parts: &[&str]) {
    assert_error(result, "", parts);
}

#[test]
fn names() {
    let (sim, id) = simulation(2, arm_and_hand());
    let robot = sim.robot(id);
    let qpos = robot.qpos();
    assert_says(robot.compute_fk(&qpos, "amr", None), &["control part or link \"amr\"", "\"arm\""]);
    assert_says(
        robot.compute_fk(&qpos, TipFrame::of_part("ee_link"), None),
        &["control part \"ee_link\"", "\"arm\"", "\"hand\""],
    );
    assert_says(robot.compute_fk(&qpos, TipFrame::of_link("ee_lnik"), None), &["link \"ee_lnik\"", "\"ee_link\""]);
    assert_says(robot.jacobian(TipFrame::of_part("arm").at("hnad"), None, None), &["link \"hnad\""]);
    // A hand ends in five fingers.
    let several = ["control part \"hand\"", "\"left_index_dist\"", "\"left_thumb_dist\"", "TipFrame"];
    assert_says(robot.jacobian("hand", None, None), &several);
    let ik = |tip: TipFrame<'_>| robot.compute_ik(&Pose::identity(), tip, &IkCfg::default(), None, None);
    assert_says(ik("hand".into()), &several);
    // No joint of the part moves the link, and no joint moves the root. Their poses can still be computed.
    let above = ["robot \"robot\"", "control part \"hand\"", "\"link4\"", "\"JOINT1\"", "\"JOINT4\""];
    assert_says(ik(TipFrame::of_part("hand").at("link4")), &above);
    assert_says(ik(TipFrame::of_part("arm").at("base_link")), &["\"base_link\"", "the link is fixed to the base"]);
    assert_eq!(robot.jacobian(TipFrame::of_part("arm").at("base_link"), None, None).unwrap().dim(), (2, 6, 6));
    // A part of followers only, whose error names the drivers; and a part without joints.
    for (part, joints, parts) in [
        (
            "tips",
            vec!["LEFT_INDEX_PIP".into()],
            &["control part \"tips\"", "\"left_index_dist\"", "\"LEFT_HAND_INDEX\""][..],
        ),
        ("none", vec![], &["\"none\"", "empty"]),
    ] {
        let (sim, id) = simulation(1, RobotCfg { control_parts: vec![(part.into(), joints)], ..arm_and_hand() });
        assert_says(sim.robot(id).compute_ik(&Pose::identity(), part, &IkCfg::default(), None, None), parts);
    }
}

#[test]
fn numbers_and_shapes() {
    let (sim, id) = simulation(2, sr5());
    let robot = sim.robot(id);
    let solve = |targets: Array2<f64>| robot.compute_ik(&targets, "arm", &IkCfg::default(), None, None);
    assert_says(solve(row(&[0.1, f64::NAN, 0.3, 1.0, 0.0, 0.0, 0.0])), &["compute_ik", "[0, 1]", "NaN"]);
    assert_says(solve(row(&[0.1, 0.2, 0.3, 1.0, 0.0, f64::INFINITY, 0.0])), &["compute_ik", "[0, 5]", "inf"]);
    assert_says(solve(row(&[0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 0.0])), &["quaternion", "row 0", "not zero"]);
    assert_says(solve(Array2::zeros((1, 6))), &["compute_ik", "6]", "7]"]);
    assert_says(solve(Array2::from_elem((3, 7), 0.5)), &["compute_ik", "[3, 7]", "[2, 7]"]);
    assert_says(solve(Array2::zeros((0, 7))), &["compute_ik", "[0, 7]"]);
    let zero = nalgebra::UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(0.0, 0.0, 0.0, 0.0));
    let typed = Pose::from_parts(nalgebra::Translation3::identity(), zero);
    assert_says(robot.compute_ik(&typed, "arm", &IkCfg::default(), None, None), &["quaternion"]);
    assert_says(robot.compute_ik(&[Pose::identity(); 3], "arm", &IkCfg::default(), None, None), &["[3, 7]"]);
    let unknown = Some(&[EnvId(2)][..]);
    assert_says(robot.compute_ik(&Pose::identity(), "arm", &IkCfg::default(), None, unknown), &["environment 2"]);

    let five = Array2::zeros((2, 5));
    assert_says(robot.compute_fk(&five, "arm", None), &["compute_fk", "[2, 5]", "[2, 6]"]);
    assert_says(robot.compute_link_fk(&five, None), &["compute_link_fk", "[2, 5]", "[2, 6]"]);
    assert_says(robot.jacobian("arm", Some(five.view()), None), &["jacobian", "[2, 5]", "[2, 6]"]);
    let from = |q: &Array2<f64>| robot.compute_ik(&Pose::identity(), "arm", &IkCfg::default(), Some(q.view()), None);
    assert_says(from(&five), &["compute_ik, initial", "[2, 5]"]);
    let bad = array![[0.0, 0.0, f64::NAN, 0.0, 0.0, 0.0]];
    assert_says(robot.compute_fk(&bad, "arm", None), &["\"JOINT3\"", "NaN"]);
    assert_says(from(&bad), &["\"JOINT3\""]);
    let tcp = TipFrame::of_part("arm").with_tcp(Pose::translation(f64::NAN, 0.0, 0.0));
    assert_says(robot.compute_fk(&array![[0.0; 6]], tcp, None), &["tcp", "finite"]);
    // Unreachable targets terminate without success.
    for far in [1e3, 1e9, 1e30] {
        let found = robot.compute_ik(&Pose::translation(far, -far, far), "arm", &IkCfg::default(), None, None).unwrap();
        assert!(!found.success[0] && found.qpos.iter().all(|q| q.is_finite()), "{found:?}");
        assert!((found.position_error[0] / (far * 3.0_f64.sqrt()) - 1.0).abs() < 1e-2, "{found:?}");
    }
}

/// Every number of a configuration is checked, alone and on use.
#[test]
fn configurations() {
    let (sim, id) = simulation(1, sr5());
    let good = || IkCfg { posture: Some(NullSpacePosture::at([0.1; 6])), ..IkCfg::default() };
    for (cfg, variables) in [
        (good(), 6),
        (IkCfg::default(), 7),
        (IkCfg { max_iterations: 1, num_seeds: 1, ..good() }, 6),
        (IkCfg { num_seeds: 100_000, ..good() }, 6),
    ] {
        cfg.validate(variables).unwrap();
    }
    let posture = |gain, rest: &[f64]| Some(NullSpacePosture { rest: rest.to_vec(), gain });
    let nan = f64::NAN;
    for (cfg, parts) in [
        (IkCfg { position_tolerance: 0.0, ..good() }, &["position_tolerance is 0.0", "above 0"][..]),
        (IkCfg { position_tolerance: f64::INFINITY, ..good() }, &["position_tolerance"]),
        (IkCfg { rotation_tolerance: -1e-3, ..good() }, &["rotation_tolerance"]),
        (IkCfg { rotation_tolerance: nan, ..good() }, &["rotation_tolerance is NaN"]),
        (IkCfg { damping: -1.0, ..good() }, &["damping is -1.0"]),
        (IkCfg { damping: nan, ..good() }, &["damping"]),
        (IkCfg { max_iterations: 0, ..good() }, &["max_iterations is 0"]),
        (IkCfg { num_seeds: 0, ..good() }, &["num_seeds is 0"]),
        (IkCfg { num_seeds: 100_001, ..good() }, &["num_seeds"]),
        (IkCfg { num_seeds: u32::MAX, ..good() }, &["num_seeds", "100000"]),
        (IkCfg { posture: posture(1.0, &[0.1; 5]), ..good() }, &["posture.rest", "5", "6"]),
        (
            IkCfg { posture: posture(1.0, &[0.1, 0.1, 0.1, 0.1, 0.1, nan]), ..good() },
            &["posture.rest", "NaN or infinity"],
        ),
        (IkCfg { posture: posture(0.0, &[0.1; 6]), ..good() }, &["posture.gain is 0.0"]),
        (IkCfg { posture: posture(1.1, &[0.1; 6]), ..good() }, &["posture.gain"]),
        (IkCfg { posture: posture(1.5, &[0.1; 6]), ..good() }, &["posture.gain is 1.5"]),
    ] {
        assert_error(cfg.validate(6), "", parts);
        assert_says(sim.robot(id).compute_ik(&Pose::identity(), "arm", &cfg, None, None), parts);
    }
}

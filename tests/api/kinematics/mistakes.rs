//! Mistakes are errors that name them.

use crate::kinematics::robots::*;
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;

fn says(result: Result<impl std::fmt::Debug>, parts: &[&str]) {
    let message = result.unwrap_err().to_string();
    assert!(parts.iter().all(|part| message.contains(part)), "{message} lacks one of {parts:?}");
}

#[test]
fn names() {
    let (sim, id) = simulation(2, arm_and_hand());
    let robot = sim.robot(id);
    let qpos = robot.get_qpos();
    says(robot.compute_fk(&qpos, "amr", None), &["control part or link \"amr\"", "\"arm\""]);
    says(robot.compute_fk(&qpos, Tip::of_part("ee_link"), None), &["control part \"ee_link\"", "\"arm\"", "\"hand\""]);
    says(robot.compute_fk(&qpos, Tip::of_link("ee_lnik"), None), &["link \"ee_lnik\"", "\"ee_link\""]);
    says(robot.jacobian(Tip::of_part("arm").at("hnad"), None, None), &["link \"hnad\""]);
    // A hand ends in five fingers.
    let several = ["control part \"hand\"", "\"left_index_dist\"", "\"left_thumb_dist\"", "Tip::at"];
    says(robot.jacobian("hand", None, None), &several);
    says(robot.compute_ik(&Pose::identity(), "hand", &IkCfg::default(), None, None), &several);
    // Nothing of the part is above the link; nothing at all is above the root.
    let finger_of_arm =
        robot.compute_ik(&Pose::identity(), Tip::of_part("hand").at("link4"), &IkCfg::default(), None, None);
    says(finger_of_arm, &["robot \"robot\"", "control part \"hand\"", "\"link4\"", "\"JOINT1\"", "\"JOINT4\""]);
    let root = robot.compute_ik(&Pose::identity(), Tip::of_part("arm").at("base_link"), &IkCfg::default(), None, None);
    says(root, &["\"base_link\"", "it stands fixed"]);
    // Where it is can be asked nevertheless.
    assert_eq!(robot.jacobian(Tip::of_part("arm").at("base_link"), None, None).unwrap().dim(), (2, 6, 6));
}

/// A part of followers only has nothing to move, and says whose joints would.
#[test]
fn a_part_of_followers_only() {
    let cfg = RobotCfg { control_parts: vec![("tips".into(), vec!["LEFT_INDEX_PIP".into()])], ..arm_and_hand() };
    let (sim, id) = simulation(1, cfg);
    let found = sim.robot(id).compute_ik(&Pose::identity(), "tips", &IkCfg::default(), None, None);
    says(found, &["control part \"tips\"", "\"left_index_dist\"", "\"LEFT_HAND_INDEX\""]);
}

#[test]
fn a_part_without_joints() {
    let (sim, id) = simulation(1, RobotCfg { control_parts: vec![("none".into(), Vec::new())], ..sr5() });
    says(sim.robot(id).compute_ik(&Pose::identity(), "none", &IkCfg::default(), None, None), &["\"none\"", "empty"]);
}

#[test]
fn numbers_and_shapes() {
    let (sim, id) = simulation(2, sr5());
    let robot = sim.robot(id);
    let solve = |targets: Array2<f64>| robot.compute_ik(&targets, "arm", &IkCfg::default(), None, None);
    let row = |numbers: [f64; 7]| Array2::from_shape_vec((1, 7), numbers.to_vec()).unwrap();
    says(solve(row([0.1, f64::NAN, 0.3, 1.0, 0.0, 0.0, 0.0])), &["compute_ik", "[0, 1]", "NaN"]);
    says(solve(row([0.1, 0.2, 0.3, 1.0, 0.0, f64::INFINITY, 0.0])), &["compute_ik", "[0, 5]", "inf"]);
    says(solve(row([0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 0.0])), &["quaternion", "row 0", "not zero"]);
    says(solve(Array2::zeros((1, 6))), &["compute_ik", "6]", "7]"]);
    says(solve(Array2::from_elem((3, 7), 0.5)), &["compute_ik", "[3, 7]", "[2, 7]"]);
    says(solve(Array2::zeros((0, 7))), &["compute_ik", "[0, 7]"]);
    let typed = Pose::from_parts(
        nalgebra::Translation3::identity(),
        nalgebra::UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(0.0, 0.0, 0.0, 0.0)),
    );
    says(robot.compute_ik(&typed, "arm", &IkCfg::default(), None, None), &["quaternion"]);
    says(robot.compute_ik(&[Pose::identity(); 3], "arm", &IkCfg::default(), None, None), &["[3, 7]"]);
    let nobody = robot.compute_ik(&Pose::identity(), "arm", &IkCfg::default(), None, Some(&[EnvId(2)]));
    says(nobody, &["environment 2"]);

    let five = Array2::zeros((2, 5));
    says(robot.compute_fk(&five, "arm", None), &["compute_fk", "[2, 5]", "[2, 6]"]);
    says(robot.compute_link_fk(&five, None), &["compute_link_fk", "[2, 5]", "[2, 6]"]);
    says(robot.jacobian("arm", Some(five.view()), None), &["jacobian", "[2, 5]", "[2, 6]"]);
    let initial = robot.compute_ik(&Pose::identity(), "arm", &IkCfg::default(), Some(five.view()), None);
    says(initial, &["compute_ik, initial", "[2, 5]"]);
    let bad = array![[0.0, 0.0, f64::NAN, 0.0, 0.0, 0.0]];
    says(robot.compute_fk(&bad, "arm", None), &["\"JOINT3\"", "NaN"]);
    says(robot.compute_ik(&Pose::identity(), "arm", &IkCfg::default(), Some(bad.view()), None), &["\"JOINT3\""]);
    let tcp = Tip::of_part("arm").with_tcp(Pose::translation(f64::NAN, 0.0, 0.0));
    says(robot.compute_fk(&array![[0.0; 6]], tcp, None), &["tcp", "finite"]);
}

#[test]
fn configurations() {
    let (sim, id) = simulation(1, sr5());
    let solve = |cfg: IkCfg| sim.robot(id).compute_ik(&Pose::identity(), "arm", &cfg, None, None);
    let plain = IkCfg::default();
    says(solve(IkCfg { position_tolerance: 0.0, ..plain.clone() }), &["position_tolerance is 0.0", "above 0"]);
    says(solve(IkCfg { rotation_tolerance: f64::NAN, ..plain.clone() }), &["rotation_tolerance is NaN"]);
    says(solve(IkCfg { damping: -1.0, ..plain.clone() }), &["damping is -1.0"]);
    says(solve(IkCfg { max_iterations: 0, ..plain.clone() }), &["max_iterations is 0"]);
    says(solve(IkCfg { num_seeds: 0, ..plain.clone() }), &["num_seeds is 0"]);
    says(solve(IkCfg { num_seeds: u32::MAX, ..plain.clone() }), &["num_seeds", "100000"]);
    says(solve(IkCfg { posture: Some(Posture::at([0.0; 5])), ..plain.clone() }), &["posture.rest", "5", "6"]);
    says(solve(IkCfg { posture: Some(Posture::at([f64::NAN; 6])), ..plain.clone() }), &["posture.rest", "finite"]);
    let gain = |gain| Some(Posture { gain, ..Posture::at([0.0; 6]) });
    says(solve(IkCfg { posture: gain(0.0), ..plain.clone() }), &["posture.gain is 0.0"]);
    says(solve(IkCfg { posture: gain(1.5), ..plain.clone() }), &["posture.gain is 1.5"]);
}

/// Absurd targets end, without success.
#[test]
fn absurd_targets() {
    let (sim, id) = simulation(1, sr5());
    for far in [1e3, 1e9, 1e30] {
        let found =
            sim.robot(id).compute_ik(&Pose::translation(far, -far, far), "arm", &IkCfg::default(), None, None).unwrap();
        assert!(!found.success[0] && found.qpos.iter().all(|q| q.is_finite()), "{found:?}");
        assert!((found.position_error[0] / (far * 3.0_f64.sqrt()) - 1.0).abs() < 1e-2, "{found:?}");
    }
}

//! Targets that are only reached at limits, joints without limits, and whole turns.

use crate::kinematics::robots::*;
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use std::f64::consts::{PI, TAU};

/// Poses that need one, two or three joints of the arm to stand at their limits.
#[test]
fn poses_at_limits_are_reached() {
    for (name, cfg, link) in [("SR5", sr5(), "ee_link"), ("seven axes", seven_axes(), "link8")] {
        let (mut sim, id) = simulation(1, cfg);
        let limits = sim.robot(id).qpos_limits();
        let mut qpos = random_qpos(&sim, id, 60, 31);
        for (row, mut qpos) in qpos.rows_mut().into_iter().enumerate() {
            for k in 0..=row % 3 {
                let joint = (row + 2 * k) % qpos.len();
                qpos[joint] = limits[(0, joint, row / 2 % 2)];
            }
        }
        let start = sim.robot(id).get_default_qpos();
        let mut solved = 0;
        for row in qpos.rows() {
            let row = row.to_owned().insert_axis(kinetoscope::ndarray::Axis(0));
            sim.robot_mut(id).write_qpos(&row, None, None).unwrap();
            let target = sim.robot(id).link_pose(link).unwrap();
            let tip = Tip::of_part("arm").at(link);
            let found = sim.robot(id).compute_ik(&target, tip, &IkCfg::default(), Some(start.view()), None).unwrap();
            for (joint, &q) in found.qpos.iter().enumerate() {
                assert!(q >= limits[(0, joint, 0)] && q <= limits[(0, joint, 1)], "{name}: joint {joint} at {q}");
            }
            sim.robot_mut(id).write_qpos(&found.qpos, None, None).unwrap();
            let (far, turned) = apart(&sim.robot(id).link_pose(link).unwrap(), &target);
            assert_eq!(found.success[0], far <= 1e-4 && turned <= 1e-3);
            solved += usize::from(found.success[0]);
        }
        println!("{name}: {solved} of 60 at limits");
        // Reachable they all are; 99 % of 60 is all but none.
        assert!(solved >= 59, "{name}: {solved} of 60");
    }
}

/// A joint without limits takes the shortest way, and goes on from where it is: no unneeded turns.
#[test]
fn joints_without_limits_take_no_unneeded_turns() {
    let joints = [
        joint("turn", "continuous", ["root", "a"], "0 0 0", "0 0 1", ""),
        joint(
            "lift",
            "prismatic",
            ["a", "b"],
            "0.4 0 0",
            "0 0 1",
            "<limit lower=\"0\" upper=\"0.5\" effort=\"9\" velocity=\"9\"/>",
        ),
    ];
    let dir = written(&["root", "a", "b"], &joints);
    let (sim, id) = simulation(1, arm(dir.path().join("r.urdf")));
    for (now, aim, expected) in
        [(0.0, 3.0, 3.0), (0.0, 4.0, 4.0 - TAU), (13.0, 1.0, 1.0 + 2.0 * TAU), (-20.0, 0.5, 0.5 - 3.0 * TAU)]
    {
        let target = sim.robot(id).compute_fk(&array![[aim, 0.3]], "arm", None).unwrap();
        let start = array![[now, 0.0]];
        let found = sim.robot(id).compute_ik(&target, "arm", &IkCfg::default(), Some(start.view()), None).unwrap();
        assert!(found.success[0], "{found:?}");
        assert!((found.qpos[(0, 0)] - expected).abs() < 1e-5, "{} is not {expected}", found.qpos);
        assert!((found.qpos[(0, 0)] - now).abs() <= PI + 1e-3 && (found.qpos[(0, 1)] - 0.3).abs() < 1e-5);
    }
}

/// A gripper whose finger follows another, and an arm whose second joint follows the first: what was found, written
/// into MuJoCo with the follower where it belongs, is at the target.
#[test]
fn followers_follow() {
    let limit = "<limit lower=\"-1.5\" upper=\"1.5\" effort=\"9\" velocity=\"9\"/>";
    let mimic = format!("{limit}<mimic joint=\"a\" multiplier=\"0.8\" offset=\"0.1\"/>");
    let joints = [
        joint("a", "revolute", ["root", "1"], "0 0 0.2", "0 1 0", limit),
        joint("b", "revolute", ["1", "2"], "0.3 0 0", "0 1 0", &mimic),
        joint("c", "revolute", ["2", "3"], "0.3 0 0", "0 0 1", limit),
        joint(
            "d",
            "prismatic",
            ["3", "4"],
            "0.2 0 0",
            "1 0 0",
            "<limit lower=\"0\" upper=\"0.3\" effort=\"9\" velocity=\"9\"/>",
        ),
    ];
    let dir = written(&["root", "1", "2", "3", "4"], &joints);
    let (mut sim, id) = simulation(1, arm(dir.path().join("r.urdf")));
    for row in random_qpos(&sim, id, 30, 5).rows() {
        let there = row.to_owned().insert_axis(kinetoscope::ndarray::Axis(0));
        sim.robot_mut(id).write_qpos(&there, None, None).unwrap();
        let target = sim.robot(id).link_pose("4").unwrap();
        sim.reset(None).unwrap();
        let found = sim.robot(id).compute_ik(&target, "arm", &IkCfg::default(), None, None).unwrap();
        assert!(found.success[0], "{there}: {found:?}");
        assert_eq!(found.qpos[(0, 1)], 0.8 * found.qpos[(0, 0)] + 0.1);
        // The follower's own limits bind the joint that it follows.
        assert!(found.qpos.iter().take(3).all(|q| q.abs() <= 1.5 + 1e-12));
        sim.robot_mut(id).write_qpos(&found.qpos, None, None).unwrap();
        let (far, turned) = apart(&sim.robot(id).link_pose("4").unwrap(), &target);
        assert!(far <= 1e-4 && turned <= 1e-3, "{far} {turned}");
    }
}

/// Joints of a part that do not move the frame stay where the search starts.
#[test]
fn joints_that_do_not_move_the_frame_stay() {
    let (sim, id) = simulation(1, arm_and_hand());
    let robot = sim.robot(id);
    let qpos = random_qpos(&sim, id, 1, 8);
    let target = robot.compute_fk(&qpos, "left_index_prox", None).unwrap();
    let start = Array2::from_elem((1, robot.dof()), 0.2);
    let found = robot.compute_ik(&target, "left_index_prox", &IkCfg::default(), Some(start.view()), None).unwrap();
    assert!(found.success[0]);
    let stays = |name: &str| found.qpos[(0, robot.joint_id(name).unwrap().0)] == 0.2;
    assert!(stays("LEFT_HAND_THUMB1") && stays("LEFT_HAND_RING") && !stays("JOINT2"));
    let dip = found.qpos[(0, robot.joint_id("LEFT_THUMB_DIP").unwrap().0)];
    assert!((dip - 1.05 * 0.2).abs() < 1e-15, "a follower follows: {dip}");
}

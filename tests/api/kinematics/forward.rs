//! Poses of frames are MuJoCo's.
//!
//! Both multiply the same transforms, a dozen of them, in a different order: positions of a metre differ by some units of
//! 2e-16. 1e-12 is the bound asked for.

use crate::kinematics::robots::*;
use kinetoscope::ndarray::{Axis, array, s};
use kinetoscope::prelude::*;

const BOUND: f64 = 1e-12;

/// Every link of `robot` at random positions is where MuJoCo puts it.
fn check(name: &str, sim: &mut SimulationManager, id: RobotId, seed: u64) {
    let qpos = random_qpos(sim, id, sim.num_envs(), seed);
    let links = sim.robot(id).compute_link_fk(&qpos, None).unwrap();
    // Nothing was written: the links are elsewhere. The control of everything below.
    let last = *sim.robot(id).link_names().last().unwrap();
    let before = sim.robot(id).link_pose(last).unwrap();
    let (far, turned) = apart(&before, &links.index_axis(Axis(1), links.len_of(Axis(1)) - 1).to_owned());
    assert!(far + turned > 0.01, "{name}: {last} moved by {far} m, {turned} rad");

    sim.robot_mut(id).write_qpos(&qpos, None, None).unwrap();
    let robot = sim.robot(id);
    let mut worst = (0.0_f64, 0.0_f64);
    for (k, link) in robot.link_names().into_iter().enumerate() {
        let judge = robot.link_pose(link).unwrap();
        for ours in
            [robot.compute_fk(&qpos, Tip::of_link(link), None).unwrap(), links.index_axis(Axis(1), k).to_owned()]
        {
            let (far, turned) = apart(&ours, &judge);
            worst = (worst.0.max(far), worst.1.max(turned));
        }
    }
    println!("{name}: {} links within {:.1e} m, {:.1e} rad of MuJoCo's", robot.link_names().len(), worst.0, worst.1);
    assert!(worst.0 < BOUND && worst.1 < BOUND, "{name}: {worst:?}");
}

#[test]
fn every_link_of_every_robot_is_where_mujoco_puts_it() {
    let robots =
        [("SR5", sr5()), ("SR5 and hand", arm_and_hand()), ("seven axes", seven_axes()), ("six axes", six_axes())];
    for (name, cfg) in robots {
        let tilted = Pose::new(nalgebra::Vector3::new(0.3, -0.2, 0.5), nalgebra::Vector3::new(0.4, -1.1, 0.3));
        let (mut sim, id) = simulation(5, RobotCfg { init_pose: tilted, ..cfg });
        check(name, &mut sim, id, 1);
    }
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn links_of_the_vendors_robot_too() {
    let cfg = vendors_sr5();
    let (mut sim, id) = simulation(3, cfg);
    check("the vendor's SR5", &mut sim, id, 2);
}

/// A robot whose root moves, differently in each environment.
#[test]
fn a_moving_root_is_part_of_the_pose() {
    let urdf = UrdfCfg::single(assets::path("quadruped/quadruped.urdf").unwrap());
    let (mut sim, id) = simulation(3, RobotCfg { urdf, fix_base: false, ..Default::default() });
    let roots = array![
        [1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0],
        [-4.0, 0.5, 1.0, 0.6, 0.0, 0.8, 0.0],
        [0.0, 0.0, 9.0, 1.0, 1.0, 1.0, 1.0]
    ];
    sim.robot_mut(id).write_root_pose(&roots, None).unwrap();
    check("quadruped", &mut sim, id, 3);
}

/// A link behind a planar joint: it slid and turned to where it is, and what hangs on it is placed from there.
#[test]
fn what_hangs_on_a_planar_joint_is_placed_from_where_that_is() {
    let links = ["root", "plate", "arm"];
    let joints = [
        joint("slip", "planar", ["root", "plate"], "0.1 0 0.2", "1 0 0.2", ""),
        joint("turn", "continuous", ["plate", "arm"], "0 0.3 0.1", "0 1 1", ""),
    ];
    let dir = written(&links, &joints);
    let (mut sim, id) =
        simulation(2, RobotCfg { urdf: UrdfCfg::single(dir.path().join("r.urdf")), ..Default::default() });
    let start = sim.robot(id).link_pose("plate").unwrap();
    sim.update(30);
    let (fell, _) = apart(&start, &sim.robot(id).link_pose("plate").unwrap());
    assert!(fell > 0.1, "{fell}");
    check("planar", &mut sim, id, 4);
}

/// Rows, columns and names: a part, a link, a tool; one row for all; joints outside of the part stay where they are.
#[test]
fn tips_name_joints_and_frames() {
    let (mut sim, id) = simulation(3, arm_and_hand());
    let qpos = random_qpos(&sim, id, 3, 5);
    sim.robot_mut(id).write_qpos(&qpos, None, None).unwrap();
    let robot = sim.robot(id);
    let (hand, arm) = (robot.get_joint_ids("hand").unwrap(), robot.get_joint_ids("arm").unwrap());
    let of_part = |ids: &[JointIndex]| qpos.select(Axis(1), &ids.iter().map(|id| id.0).collect::<Vec<_>>());

    // The arm ends in the link on its flange, by a name that may be a part or a link.
    let judge = robot.link_pose("ee_link").unwrap();
    for tip in [Tip::of_part("arm"), Tip::of_part("arm").at("ee_link"), "arm".into()] {
        let (far, turned) = apart(&robot.compute_fk(&of_part(&arm), tip, None).unwrap(), &judge);
        assert!(far < BOUND && turned < BOUND, "{tip:?}: {far} {turned}");
    }
    let (far, _) = apart(&robot.compute_fk(&qpos, "ee_link", None).unwrap(), &judge);
    assert!(far < BOUND);

    // A finger by the joints of the hand: the arm stays where it is in each environment. The columns of followers count for
    // nothing.
    let finger = Tip::of_part("hand").at("left_index_dist");
    let mut columns = of_part(&hand);
    let found = robot.compute_fk(&columns, finger, None).unwrap();
    let (far, turned) = apart(&found, &robot.link_pose("left_index_dist").unwrap());
    assert!(far < BOUND && turned < BOUND, "{far} {turned}");
    for (k, &joint) in hand.iter().enumerate().filter(|(_, joint)| robot.is_mimic(**joint).unwrap()) {
        assert!(robot.mimic_drivers()[joint.0].0 != joint);
        columns.column_mut(k).fill(0.1);
    }
    assert_eq!(robot.compute_fk(&columns, finger, None).unwrap(), found);

    // A tool, one row for two environments in the order asked for.
    let tcp = Pose::new(nalgebra::Vector3::new(0.1, 0.0, 0.2), nalgebra::Vector3::new(0.0, 0.7, 0.0));
    let row = of_part(&arm).slice(s![1..2, ..]).to_owned();
    let ids = [EnvId(2), EnvId(0)];
    let tool = robot.compute_fk(&row, Tip::of_part("arm").with_tcp(tcp), Some(&ids)).unwrap();
    assert_eq!(tool.dim(), (2, 7));
    for row in tool.rows() {
        let (far, turned) = errors(&pose(row), &(pose(judge.row(1)) * tcp));
        assert!(far < BOUND && turned < BOUND, "{far} {turned}");
    }
}

//! Robots from MJCF in scenes: many environments, snapshots, more added later, wrenches, self-collision, files.

use super::{ODD, empty, passive, robot};
use kinetoscope::ndarray::{Array2, Axis, array};
use kinetoscope::prelude::*;

/// Three environments on their way to different targets.
fn moving() -> (SimulationManager, RobotId) {
    let mut sim = empty(3);
    let drive = DriveCfg { stiffness: 300.0.into(), damping: 30.0.into(), ..Default::default() };
    let id = sim.add_robot(RobotCfg { drive, ..robot("odd", ODD) }).unwrap();
    let targets = Array2::from_shape_fn((3, 7), |(env, joint)| 0.1 * env as f64 - 0.05 * joint as f64);
    sim.robot_mut(id).set_qpos(&targets, None, None).unwrap();
    (sim, id)
}

fn state(sim: &SimulationManager, id: RobotId) -> (Array2<f64>, Array2<f64>, Array2<f64>) {
    (sim.robot(id).get_qpos(), sim.robot(id).get_qvel(), sim.robot(id).get_target_qpos())
}

#[test]
fn snapshots_bring_back_and_what_is_added_later_changes_nothing() {
    let (mut sim, id) = moving();
    sim.update(40);
    let (snapshot, there) = (sim.snapshot(None).unwrap(), state(&sim, id));
    sim.update(40);
    let end = state(&sim, id);
    assert_ne!(end.0.index_axis(Axis(0), 0), end.0.index_axis(Axis(0), 2), "environments differ");
    sim.restore(&snapshot, None).unwrap();
    assert_eq!(state(&sim, id), there);
    sim.update(40);
    assert_eq!(state(&sim, id), end, "going on is bit-identical");

    sim.update(460);
    let end = state(&sim, id);
    sim.restore(&snapshot, None).unwrap();
    sim.add_rigid_object(RigidObjectCfg {
        uid: "cube".into(),
        init_pose: Pose::translation(5.0, 0.0, 5.0),
        ..Default::default()
    })
    .unwrap();
    sim.add_robot(RobotCfg { init_pose: Pose::translation(0.0, 5.0, 0.0), ..robot("second", ODD) }).unwrap();
    assert_eq!(state(&sim, id), there, "bit-equal right after");
    sim.update(500);
    // A second without any contact: what is added is no part of the robot's equations.
    let off = (sim.robot(id).get_qpos() - &end.0).iter().fold(0.0f64, |far, d| far.max(d.abs()));
    assert!(off < 1e-9, "{off}");
}

/// Gravity compensation of all links holds an arm that nothing else holds; gravity of one kilogram is felt by an external
/// wrench.
#[test]
fn wrenches_and_gravity_compensation_act_on_links() {
    let mut sim = empty(2);
    let text = ODD.replace(r#"stiffness="1.5""#, "");
    let id = sim.add_robot(passive("odd", &text)).unwrap();
    let start = sim.robot(id).get_qpos();
    sim.robot_mut(id).set_gravity_compensation(true, None, Some(&[EnvId(1)])).unwrap();
    sim.update(100);
    let off = sim.robot(id).get_qpos() - &start;
    assert!(off.row(1).iter().all(|d| d.abs() < 1e-9) && off.row(0).iter().any(|d| d.abs() > 0.05), "{off}");
    let hand = sim.robot(id).link_id("hand").unwrap();
    let forces = kinetoscope::ndarray::Array3::from_shape_fn((1, 1, 3), |(_, _, k)| [0.0, 0.0, 5.0][k]);
    let none = kinetoscope::ndarray::Array3::zeros((1, 1, 3));
    sim.robot_mut(id)
        .set_external_wrench(&forces, &none, WrenchFrame::World, Some(&[hand]), Some(&[EnvId(1)]))
        .unwrap();
    sim.update(50);
    assert!((sim.robot(id).get_qpos() - &start).row(1).iter().any(|d| d.abs() > 0.01));
}

/// Two fingers that close on each other: they pass through each other unless told to collide; a pair of the file holds only then.
#[test]
fn links_collide_with_each_other_only_where_told() {
    let text = r#"<mujoco><compiler angle="radian"/><worldbody><body name="palm"><geom name="palm" size="0.02" mass="1"/>
        <body name="left" pos="0 0.06 0"><joint name="left" type="slide" axis="0 -1 0"/><geom name="l" size="0.02" mass="0.1"
          contype="4" conaffinity="8"/></body>
        <body name="right" pos="0 -0.06 0"><joint name="right" type="slide" axis="0 1 0"/><geom name="r" size="0.02" mass="0.1"/>
        </body></body></worldbody><contact><pair geom1="l" geom2="r" margin="0.001"/><exclude body1="palm" body2="left"/>
          <exclude body1="palm" body2="right"/></contact></mujoco>"#;
    let closed = |self_collision: bool| {
        let mut sim = empty(1);
        let drive = DriveCfg {
            stiffness: 50.0.into(),
            damping: 10.0.into(),
            max_effort: Some(5.0.into()),
            ..Default::default()
        };
        let id = sim.add_robot(RobotCfg { self_collision, drive, ..robot("hand", text) }).unwrap();
        sim.robot_mut(id).set_qpos(&array![[0.06, 0.06]], None, None).unwrap();
        sim.update(1000);
        assert!(sim.diverged().is_empty());
        sim.robot(id).get_qpos()
    };
    let (through, held) = (closed(false), closed(true));
    assert!(through.iter().all(|q| (q - 0.06).abs() < 1e-3), "{through}");
    // The centres stay a diameter of 0.04 m apart: each finger has gone (0.12 - 0.04) / 2.
    assert!(held.iter().all(|q| (q - 0.04).abs() < 2e-3), "{held}");
}

/// A ball of the robot lies on the ground, whatever its bits in the file; one that collides with nothing falls through.
#[test]
fn robots_collide_with_the_ground() {
    let text = |bits: &str| {
        format!(
            r#"<mujoco><worldbody><body name="b" pos="0 0 0.3"><freejoint/><geom size="0.1" mass="1" {bits}/>
            <body><joint name="j"/><geom size="0.01" pos="0 0 0.05" mass="0.01" contype="0" conaffinity="0"/></body></body>
            </worldbody></mujoco>"#
        )
    };
    let settled = |bits: &str| {
        let mut sim = SimulationManager::new(SimulationManagerCfg::default()).unwrap();
        let id = sim.add_robot(RobotCfg { fix_base: false, ..robot("r", &text(bits)) }).unwrap();
        sim.update(200);
        sim.robot(id).get_root_pose()[(0, 2)]
    };
    for bits in ["", r#"contype="0" conaffinity="1""#, r#"contype="8" conaffinity="16""#] {
        assert!((settled(bits) - 0.1).abs() < 2e-3, "{bits}: {}", settled(bits));
    }
    assert!(settled(r#"contype="0" conaffinity="0""#) < -1.0);
}

/// A scene file names the MJCF of a robot by its path, beside the file.
#[test]
fn scene_files_name_mjcf_robots() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("odd.xml"), ODD).unwrap();
    let path = dir.path().join("scene.toml");
    std::fs::write(&path, "[entities.arm]\ntype = \"robot\"\nmjcf = \"odd.xml\"\ndrive.stiffness = 500.0\n").unwrap();
    let text = SceneCfg::from_file(&path).unwrap().to_toml(&EntityTypes::default()).unwrap();
    let again = dir.path().join("again.toml");
    std::fs::write(&again, text).unwrap();
    for file in [&path, &again] {
        let scene = InteractiveScene::from_file(file).unwrap();
        let arm = scene.robot("arm").unwrap();
        assert_eq!((arm.dof(), arm.get_stiffness()[(0, 0)]), (7, 500.0));
    }
}

/// What is dumped opens in plain MuJoCo and is the same robot, drives included.
#[test]
fn a_dump_is_a_model_of_its_own() {
    let (mut sim, id) = moving();
    let dir = tempfile::tempdir().unwrap();
    sim.dump(dir.path()).unwrap();
    let file = if kinetoscope::sim::mj::TARGET == kinetoscope::sim::mj::Target::V2 {
        "robot.mjcf2.xml"
    } else {
        "robot.mjcf4.xml"
    };
    let model = kinetoscope::sim::mj::compile_file(&dir.path().join(file)).unwrap().into_model();
    assert_eq!((model.nv(), model.nu()), (7, 7));
    let mass: f64 = model.body_mass().iter().sum();
    assert!((mass - 7.2).abs() < 1e-12);
    assert_eq!((model.dof_damping()[2], model.dof_armature()[1]), (0.2, 0.01));
    // As a URDF it is the same tree: its joints and masses, without shapes.
    let urdf = UrdfCfg::single(dir.path().join("robot.urdf"));
    let mut other = empty(1);
    let again = other.add_robot(RobotCfg { urdf, ..Default::default() }).unwrap();
    assert_eq!(other.robot(again).joint_names(), sim.robot(id).joint_names());
    let qpos = array![[0.3, -0.4, 0.5, 0.1, 0.2, -0.6, 0.7]];
    sim.robot_mut(id).write_qpos(&qpos, None, None).unwrap();
    other.robot_mut(again).write_qpos(&qpos, None, None).unwrap();
    let (base, tip) = (sim.robot(id).link_pose("base").unwrap(), sim.robot(id).link_pose("tip").unwrap());
    let row = |rows: &Array2<f64>| kinetoscope::scene::pose::from_row(&std::array::from_fn(|k| rows[(0, k)]));
    let here = row(&base).inverse() * row(&tip);
    let there = row(&other.robot(again).link_pose("tip").unwrap());
    assert!((here.translation.vector - there.translation.vector).norm() < 1e-9);
    assert!(here.rotation.angle_to(&there.rotation) < 1e-7);
}

/// A slide without limits and without efforts is written so that it can be read again, and is not limited then.
#[test]
fn the_urdf_of_a_dump_can_be_read() {
    let text = r#"<mujoco><worldbody><body name="base"><geom size="0.1" mass="1"/><body name="cart">
        <joint name="rail" type="slide" axis="1 0 0"/><geom size="0.1" mass="1"/></body></body></worldbody></mujoco>"#;
    let mut sim = empty(1);
    let id = sim.add_robot(robot("cart", text)).unwrap();
    let dir = tempfile::tempdir().unwrap();
    sim.dump(dir.path()).unwrap();
    let urdf = UrdfCfg::single(dir.path().join("robot.urdf"));
    let mut other = empty(1);
    let again = other.add_robot(RobotCfg { urdf, ..Default::default() }).unwrap();
    assert_eq!(other.robot(again).qpos_limits(), sim.robot(id).qpos_limits());
    assert_eq!(other.robot(again).qpos_limits()[(0, 0, 1)], f64::INFINITY);
}

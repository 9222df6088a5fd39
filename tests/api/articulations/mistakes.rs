//! What is wrong with an articulation is said, and the simulation stays as it was.

use super::*;
use kinetoscope::ndarray::array;

fn error(cfg: ArticulationCfg) -> Error {
    let mut sim = sim(1);
    sim.add_articulation(cabinet()).unwrap();
    let error = sim.add_articulation(cfg).unwrap_err();
    assert_eq!(sim.articulation(sim.articulation_id("cabinet").unwrap()).get_qpos(), array![[0.0]]);
    error
}

#[test]
fn configurations_are_checked() {
    assert!(matches!(error(cabinet()), Error::DuplicateUid(uid) if uid == "cabinet"));
    let named = |uid: &str| ArticulationCfg { uid: uid.into(), ..cabinet() };
    assert!(matches!(error(named("a/b")), Error::InvalidUid(uid) if uid == "a/b"));
    let missing = ArticulationCfg { urdf: UrdfCfg::single("nowhere/cabinet.urdf"), ..named("b") };
    assert!(error(missing).to_string().contains("nowhere/cabinet.urdf"));
    let init_qpos = vec![("drawer".to_string(), 0.1)];
    let text = error(ArticulationCfg { init_qpos, ..named("b") }).to_string();
    assert!(text.starts_with("articulation \"b\": "), "{text}");
    assert!(text.contains("init_qpos") && text.contains("drawer_slide"), "{text}");
    let drive = Some(DriveCfg { stiffness: (-1.0).into(), ..Default::default() });
    let text = error(ArticulationCfg { drive, ..named("b") }).to_string();
    assert!(text.contains("stiffness") && text.contains("-1"), "{text}");
    let init_pose = Pose::translation(f64::NAN, 0.0, 0.0);
    assert!(matches!(error(ArticulationCfg { init_pose, ..named("b") }), Error::Config { field: "init_pose", .. }));
}

#[test]
fn a_robot_is_no_other_articulation() {
    let mut sim = sim(1);
    sim.add_robot(RobotCfg { uid: "arm".into(), urdf: UrdfCfg::single(cabinet_urdf()), ..Default::default() }).unwrap();
    sim.add_articulation(cabinet()).unwrap();
    let text = sim.articulation_id("arm").unwrap_err().to_string();
    assert!(text.contains("no articulation \"arm\"") && text.contains("cabinet"), "{text}");
    let text = sim.robot_id("cabinet").unwrap_err().to_string();
    assert!(text.contains("no robot \"cabinet\"") && text.contains("arm"), "{text}");
}

#[test]
fn what_is_written_is_checked() {
    let mut sim = sim(2);
    let id = sim.add_articulation(cabinet()).unwrap();
    let mut cabinet = sim.articulation_mut(id);
    assert!(matches!(cabinet.write_qpos(&array![[f64::NAN]], None, None), Err(Error::NotFinite { .. })));
    assert!(matches!(cabinet.write_qpos(&array![[0.1, 0.2]], None, None), Err(Error::Shape { .. })));
    let pose = array![[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]];
    assert!(matches!(cabinet.write_root_pose(&pose, None), Err(Error::FixedBody(uid)) if uid == "cabinet"));
    let undriven = cabinet.set_stiffness(&array![[1.0]], None, None);
    assert!(matches!(&undriven, Err(Error::NotDriven { robot, .. }) if *robot == "cabinet"), "{undriven:?}");
    let text = undriven.unwrap_err().to_string();
    assert!(text.contains("articulation \"cabinet\"") && !text.contains("robot"), "{text}");
    let names = cabinet.read().find_joints(&["nothing"]).unwrap_err().to_string();
    assert!(names.starts_with("articulation \"cabinet\": "), "{names}");
    assert!(cabinet.read().link_pose("door").unwrap_err().to_string().contains("drawer"));
}

#[test]
#[should_panic(expected = "another SimulationManager")]
fn handles_are_of_their_manager() {
    let (mut one, other) = (sim(1), sim(1));
    let id = one.add_articulation(cabinet()).unwrap();
    other.articulation(id);
}

/// MuJoCo has 31 contact bits; one is the world's.
#[test]
fn there_are_only_so_many() {
    let (_files, door) = of_text("door", DOOR);
    let mut sim = sim(1);
    for k in 0..30 {
        sim.add_articulation(ArticulationCfg { uid: format!("door{k}"), ..door.clone() }).unwrap();
    }
    let error = sim.add_articulation(door.clone()).unwrap_err();
    assert!(matches!(error, Error::TooManyRobots(30)), "{error}");
    let robot = RobotCfg { urdf: door.urdf, ..Default::default() };
    assert!(matches!(sim.add_robot(robot), Err(Error::TooManyRobots(30))));
}

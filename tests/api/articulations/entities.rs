//! Poses, names and contacts of articulations, scene files and exports; mistakes, which leave the simulation unchanged.

use super::*;
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::scene::pose::{from_xyz_rpy, to_row};
use kinetoscope::sensors::JointStateCfg;
use kinetoscope::sim::{EntityTypes, Error};
use kinetoscope_testkit::error_tables::{assert_error, assert_errors_unchanged};
use kinetoscope_testkit::worlds::{add_ball, object, pose_error, pose_of_row};

#[test]
fn free_base() {
    let (mut sim, id) = with(2, ArticulationCfg { fix_base: false, ..cabinet() });
    let places = [from_xyz_rpy([0.5, -0.2, 0.0], [0.0, 0.0, 0.7]), from_xyz_rpy([-1.0, 2.0, 0.0], [0.0, 0.0, -2.0])];
    let rows = Array2::from_shape_fn((2, 7), |(env, k)| to_row(&places[env])[k]);
    sim.articulation_mut(id).write_root_pose(&rows, None).unwrap();
    sim.update(500);
    let drawers = sim.articulation(id).link_pose("drawer").unwrap();
    for (env, place) in places.iter().enumerate() {
        // A mass of 22 kg on four soft contacts sinks in by micrometers.
        let (off, angle) = pose_error(&pose_of_row(&drawers, env), &(place * Pose::translation(0.2, 0.0, 0.2)));
        assert!(off < 5e-4 && angle < 1e-3, "{off} {angle}");
    }
}

#[test]
fn contact_with_a_ball() {
    let (mut sim, _) = with(1, cabinet());
    let ball = object("ball", ObjectShape::Sphere { radius: 0.05 }, [0.0, 0.0, 0.45]);
    let ball = sim.add_rigid_object(ball).unwrap();
    sim.update(2000);
    let height = sim.rigid_object(ball).pose()[(0, 2)];
    assert!((height - (0.34 + 0.05)).abs() < 1e-3, "{height}: the cabinet is 0.34 m high");
}

#[test]
fn names() {
    let mut sim = sim(1);
    let robot = sim.add_robot(RobotCfg { urdf: cabinet_urdf(), ..Default::default() }).unwrap();
    let first = sim.add_articulation(cabinet()).unwrap();
    let other = ArticulationCfg { uid: "other".into(), semantic_class: Some("furniture".into()), ..cabinet() };
    let second = sim.add_articulation(other).unwrap();
    let classes: Vec<(&str, Option<&str>, &str)> =
        sim.scene().mask_ids().iter().map(|id| (id.object.as_str(), id.link.as_deref(), id.class.as_str())).collect();
    for expected in [
        ("robot", Some("drawer"), "robot"),
        ("cabinet", Some("cabinet"), "articulation"),
        ("cabinet", Some("drawer"), "articulation"),
        ("other", Some("drawer"), "furniture"),
    ] {
        assert!(classes.contains(&expected), "{classes:?}");
    }
    let joints = sim.add_sensor("joints", JointStateCfg::default()).unwrap();
    let names = sim.sensor(joints).unwrap().joint_names().to_vec();
    assert_eq!(names, ["robot/drawer_slide", "cabinet/drawer_slide", "other/drawer_slide"]);
    assert_eq!(sim.entities().robot_id("robot").unwrap(), robot);
    assert_eq!(["cabinet", "other"].map(|uid| sim.entities().articulation_id(uid).unwrap()), [first, second]);
    assert_error(sim.entities().articulation_id("robot"), "", &["unknown articulation \"robot\"", "cabinet"]);
    assert_error(sim.entities().robot_id("cabinet"), "", &["unknown robot \"cabinet\"", "robot"]);
    let view = sim.articulation(second);
    assert_eq!((view.uid(), view.dof(), view.link_names()), ("other", 1, vec!["cabinet", "drawer"]));
    assert!((view.total_mass() - 22.0).abs() < 1e-12);
}

#[test]
fn recompilation() {
    let (mut sim, id) = with(1, cabinet());
    sim.articulation_mut(id).set_qf_target(&array![[6.0]], None, None).unwrap();
    sim.update(300);
    let (open, speed) = (sim.articulation(id).qpos(), sim.articulation(id).qvel());
    assert!(open[(0, 0)] > 0.05);
    add_ball(&mut sim, "ball", [3.0, 0.0, 1.0]);
    let view = sim.articulation(id);
    assert_eq!((view.qpos(), view.qvel()), (open, speed), "bit for bit");
}

#[test]
fn scene_file() {
    let types = EntityTypes::default();
    let text = "[entities.closet]\ntype = \"articulation\"\nurdf = \"c/closet.urdf\"\nfix_base = false\n\
                init_qpos = { \"drawer.*\" = 0.1 }\nsemantic_class = \"furniture\"";
    let named = |scene: &SceneCfg| -> Vec<ArticulationCfg> {
        let of = |(name, entity): &(String, EntityCfg)| match entity {
            EntityCfg::Articulation(cfg) => ArticulationCfg { uid: name.clone(), ..(**cfg).clone() },
            other => panic!("{other:?}"),
        };
        scene.entities.iter().map(of).collect()
    };
    let scene = SceneCfg::from_toml(text, "dir/scene.toml", &types).unwrap();
    let expected = ArticulationCfg {
        uid: "closet".into(),
        urdf: UrdfCfg::single("dir/c/closet.urdf"),
        fix_base: false,
        init_qpos: vec![("drawer.*".into(), 0.1)],
        semantic_class: Some("furniture".into()),
        ..Default::default()
    };
    assert!(matches!(&scene.entities[..], [(_, EntityCfg::Articulation(found))] if **found == expected), "{scene:?}");
    assert_eq!(named(&scene), [expected]);

    let drive = Some(DriveCfg { friction: Some(0.25.into()), ..Default::default() });
    let cfg = SceneCfg::default().with("cabinet", cabinet()).with("sprung", ArticulationCfg { drive, ..cabinet() });
    let again = SceneCfg::from_toml(&cfg.to_toml(&types).unwrap(), "elsewhere/scene.toml", &types).unwrap();
    assert_eq!(named(&again), named(&cfg));

    let mut scene = InteractiveScene::new(cfg).unwrap();
    let open = array![[0.125]];
    scene.articulation_mut("{ENV}/cabinet").unwrap().write_qpos(&open, None, None).unwrap();
    assert_eq!(scene.articulation("cabinet").unwrap().qpos(), open);
    assert_eq!(scene.articulation_id("sprung").unwrap(), scene.sim().entities().articulation_id("sprung").unwrap());
    assert_error(scene.robot("cabinet").map(drop), "", &["cabinet", "articulation", "robot"]);
}

/// The export contains the joint of the file, for plain MuJoCo.
#[test]
fn export() {
    let (sim, _) = with(1, cabinet());
    let dir = tempfile::tempdir().unwrap();
    sim.dump(dir.path()).unwrap();
    let text = std::fs::read_to_string(dir.path().join("robot.mjcf2.xml")).unwrap();
    let joint = text.lines().find(|line| line.contains("<joint") && line.contains("cabinet/drawer_slide")).unwrap();
    for part in ["type=\"slide\"", "damping=\"8\"", "frictionloss=\"2\"", "range=\"0 0.3\""] {
        assert!(joint.contains(part), "{joint}");
    }
    assert!(!text.contains("<actuator"), "nothing drives it");
}

#[test]
fn refused_configurations() {
    let (mut sim, id) = with(1, cabinet());
    let b = || ArticulationCfg { uid: "b".into(), ..cabinet() };
    let negative = Some(DriveCfg { stiffness: (-1.0).into(), ..Default::default() });
    let (init_qpos, init_pose) = (vec![("drawer".into(), 0.1)], Pose::translation(f64::NAN, 0.0, 0.0));
    let nowhere = ArticulationCfg { urdf: UrdfCfg::single("nowhere/cabinet.urdf"), ..b() };
    let rows = [
        ("twice", cabinet(), "DuplicateUid(\"cabinet\")", &[][..]),
        // Regression: robots and articulations could have the name of MuJoCo's world and of the ground.
        ("world", ArticulationCfg { uid: "world".into(), ..cabinet() }, "DuplicateUid(\"world\")", &[]),
        ("ground", ArticulationCfg { uid: "ground".into(), ..cabinet() }, "DuplicateUid(\"ground\")", &[]),
        ("slash", ArticulationCfg { uid: "a/b".into(), ..cabinet() }, "InvalidUid(\"a/b\")", &[]),
        ("no file", nowhere, "", &["nowhere/cabinet.urdf"]),
        ("joint", ArticulationCfg { init_qpos, ..b() }, "", &["articulation \"b\": ", "init_qpos", "drawer_slide"]),
        ("drive", ArticulationCfg { drive: negative, ..b() }, "", &["stiffness", "-1"]),
        ("pose", ArticulationCfg { init_pose, ..b() }, "Config { field: \"init_pose\"", &[]),
    ];
    let cabinet =
        |sim: &SimulationManager| (sim.articulation(id).qpos(), sim.entities().articulation_id("cabinet").unwrap());
    assert_eq!(cabinet(&sim), (array![[0.0]], id));
    assert_errors_unchanged(&mut sim, cabinet, rows, |sim, cfg| sim.add_articulation(cfg));
}

#[test]
fn refused_writes() {
    let (mut sim, id) = with(2, cabinet());
    let mut cabinet = sim.articulation_mut(id);
    assert_error(cabinet.write_qpos(&array![[f64::NAN]], None, None), "NotFinite", &[]);
    assert_error(cabinet.write_qpos(&array![[0.1, 0.2]], None, None), "Shape", &[]);
    let pose = array![[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]];
    assert_error(cabinet.write_root_pose(&pose, None), "FixedBody(\"cabinet\")", &[]);
    let undriven = cabinet.set_stiffness(&array![[1.0]], None, None).unwrap_err();
    assert!(!undriven.to_string().contains("robot"), "{undriven}");
    assert!(matches!(&undriven, Error::NotDriven { robot, .. } if *robot == "cabinet"), "{undriven:?}");
    assert_error(Err::<(), _>(undriven), "NotDriven", &["articulation \"cabinet\""]);
    let names = cabinet.read().find_joints(&["nothing"]).unwrap_err().to_string();
    assert!(names.starts_with("articulation \"cabinet\": "), "{names}");
    assert_error(cabinet.read().link_pose("door"), "", &["drawer"]);
}

#[test]
#[should_panic(expected = "another SimulationManager")]
fn handle_of_another_manager() {
    let ((_one, id), other) = (with(1, cabinet()), sim(1));
    other.articulation(id);
}

/// MuJoCo has 31 contact bits; the world uses one.
#[test]
fn too_many() {
    let (files, mut sim) = (TempFiles::default(), sim(1));
    let door = door(&files);
    for k in 0..30 {
        sim.add_articulation(ArticulationCfg { uid: format!("door{k}"), ..door.clone() }).unwrap();
    }
    assert_error(sim.add_articulation(door.clone()), "TooManyRobots(30)", &[]);
    assert_error(sim.add_robot(RobotCfg { urdf: door.urdf, ..Default::default() }), "TooManyRobots(30)", &[]);
}

//! Where articulations stand, what they are called, and that others can touch and see them.

use super::*;
use kinetoscope::ndarray::Array2;
use kinetoscope::scene::pose::{from_row, from_xyz_rpy, to_row};

#[test]
fn a_free_one_stands_elsewhere_in_each_environment() {
    let mut sim = sim(2);
    let id = sim.add_articulation(ArticulationCfg { fix_base: false, ..cabinet() }).unwrap();
    let places = [from_xyz_rpy([0.5, -0.2, 0.0], [0.0, 0.0, 0.7]), from_xyz_rpy([-1.0, 2.0, 0.0], [0.0, 0.0, -2.0])];
    let rows = Array2::from_shape_fn((2, 7), |(env, k)| to_row(&places[env])[k]);
    sim.articulation_mut(id).write_root_pose(&rows, None).unwrap();
    sim.update(500);
    let drawers = sim.articulation(id).link_pose("drawer").unwrap();
    for (env, place) in places.iter().enumerate() {
        let drawer = from_row(&std::array::from_fn(|k| drawers[(env, k)]));
        let expected = place * Pose::translation(0.2, 0.0, 0.2);
        // 22 kg on four soft contacts sink in by micrometres.
        let off = (drawer.translation.vector - expected.translation.vector).norm();
        assert!(off < 5e-4 && drawer.rotation.angle_to(&expected.rotation) < 1e-3, "{off} {drawer}");
    }
}

#[test]
fn a_ball_lies_on_it() {
    let mut sim = sim(1);
    sim.add_articulation(cabinet()).unwrap();
    let (shape, radius) = (ObjectShape::Sphere { radius: 0.05 }, 0.05);
    let init_pose = Pose::translation(0.0, 0.0, 0.45);
    let ball = sim.add_rigid_object(RigidObjectCfg { shape, init_pose, ..Default::default() }).unwrap();
    sim.update(2000);
    let height = sim.rigid_object(ball).get_pose()[(0, 2)];
    assert!((height - (0.34 + radius)).abs() < 1e-3, "{height}: the cabinet is 0.34 m high");
}

#[test]
fn masks_sensors_and_look_up_know_it() {
    let mut sim = sim(1);
    let robot = sim.add_robot(RobotCfg { urdf: UrdfCfg::single(cabinet_urdf()), ..Default::default() }).unwrap();
    let first = sim.add_articulation(cabinet()).unwrap();
    let other = ArticulationCfg { uid: "other".into(), semantic_class: Some("furniture".into()), ..cabinet() };
    let second = sim.add_articulation(other).unwrap();
    let classes: Vec<(&str, Option<&str>, &str)> =
        sim.mask_ids().iter().map(|id| (id.object.as_str(), id.link.as_deref(), id.class.as_str())).collect();
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
    assert_eq!(sim.robot_id("robot").unwrap(), robot);
    assert_eq!((sim.articulation_id("cabinet").unwrap(), sim.articulation_id("other").unwrap()), (first, second));
    let view = sim.articulation(second);
    assert_eq!((view.uid(), view.dof(), view.link_names()), ("other", 1, vec!["cabinet", "drawer"]));
    assert!((view.total_mass() - 22.0).abs() < 1e-12);
}

#[test]
fn it_stays_open_when_more_is_added() {
    let mut sim = sim(1);
    let id = sim.add_articulation(cabinet()).unwrap();
    sim.articulation_mut(id).set_qf(&kinetoscope::ndarray::array![[6.0]], None, None).unwrap();
    sim.update(300);
    let (open, speed) = (sim.articulation(id).get_qpos(), sim.articulation(id).get_qvel());
    assert!(open[(0, 0)] > 0.05);
    sim.add_rigid_object(RigidObjectCfg { init_pose: Pose::translation(3.0, 0.0, 1.0), ..Default::default() }).unwrap();
    let view = sim.articulation(id);
    assert_eq!((view.get_qpos(), view.get_qvel()), (open, speed), "bit for bit");
}

#[test]
fn a_scene_file_names_it() {
    let types = EntityTypes::default();
    let text = "[entities.closet]\ntype = \"articulation\"\nurdf = \"c/closet.urdf\"\nfix_base = false\n\
                init_qpos = { \"drawer.*\" = 0.1 }\nsemantic_class = \"furniture\"";
    let scene = SceneCfg::from_toml(text, "dir/scene.toml", &types).unwrap();
    let [(name, EntityCfg::Articulation(found))] = scene.entities.as_slice() else { panic!("{scene:?}") };
    let expected = ArticulationCfg {
        uid: "closet".into(),
        urdf: UrdfCfg::single("dir/c/closet.urdf"),
        fix_base: false,
        init_qpos: vec![("drawer.*".into(), 0.1)],
        semantic_class: Some("furniture".into()),
        ..Default::default()
    };
    assert_eq!((name.as_str(), &**found), ("closet", &expected));

    let drive = Some(DriveCfg { friction: Some(0.25.into()), ..Default::default() });
    let cfg = SceneCfg::default().with("cabinet", cabinet()).with("sprung", ArticulationCfg { drive, ..cabinet() });
    let again = SceneCfg::from_toml(&cfg.to_toml(&types).unwrap(), "elsewhere/scene.toml", &types).unwrap();
    let named = |scene: &SceneCfg| -> Vec<ArticulationCfg> {
        let of = |(name, entity): &(String, EntityCfg)| match entity {
            EntityCfg::Articulation(cfg) => ArticulationCfg { uid: name.clone(), ..(**cfg).clone() },
            other => panic!("{other:?}"),
        };
        scene.entities.iter().map(of).collect()
    };
    assert_eq!(named(&again), named(&cfg));

    let mut scene = InteractiveScene::new(cfg).unwrap();
    let open = kinetoscope::ndarray::array![[0.125]];
    scene.articulation_mut("{ENV}/cabinet").unwrap().write_qpos(&open, None, None).unwrap();
    assert_eq!(scene.articulation("cabinet").unwrap().get_qpos(), open);
    assert_eq!(scene.articulation_id("sprung").unwrap(), scene.sim().articulation_id("sprung").unwrap());
    let error = scene.robot("cabinet").unwrap_err().to_string();
    assert!(error.contains("cabinet") && error.contains("articulation") && error.contains("robot"), "{error}");
}

/// The export holds what the file says, for MuJoCo alone.
#[test]
fn the_export_has_its_joint() {
    let mut sim = sim(1);
    sim.add_articulation(cabinet()).unwrap();
    let dir = tempfile::tempdir().unwrap();
    sim.dump(dir.path()).unwrap();
    let text = std::fs::read_to_string(dir.path().join("robot.mjcf2.xml")).unwrap();
    let joint = text.lines().find(|line| line.contains("<joint") && line.contains("cabinet/drawer_slide")).unwrap();
    for part in ["type=\"slide\"", "damping=\"8\"", "frictionloss=\"2\"", "range=\"0 0.3\""] {
        assert!(joint.contains(part), "{joint}");
    }
    assert!(!text.contains("<actuator"), "nothing drives it");
}

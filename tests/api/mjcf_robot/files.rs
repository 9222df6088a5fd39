//! Names and control parts, dumps, and MuJoCo's own sample models as robots.

use super::*;
use kinetoscope::mujoco::{BUILD_VERSION, SupportedVersion, compile_file};
use kinetoscope::ndarray::array;
use kinetoscope::robot::diagnostic::DiagnosticKind;
use kinetoscope::sim::{Error, SurfaceCfg};
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::worlds::{gains, pose_error, pose_of_row, urdf_robot};

/// Unnamed elements are named by their number.
#[test]
fn unnamed_elements() {
    let text = r#"<mujoco><worldbody><body><geom size="0.1" mass="1"/>
        <body name="joint1"><joint axis="0 0 1"/><geom size="0.1" mass="1"/><site/></body>
        <body><joint name="joint0" axis="0 0 1" pos="0.1 0 0"/><joint axis="0 1 0" pos="0 0.1 0"/><geom size="0.1" mass="1"/>
          <site name="joint1"/></body></body></worldbody></mujoco>"#;
    let (sim, id) = with(1, robot("r", text));
    // The joint named joint0 in the file keeps its name; the unnamed joint before it gets another.
    assert_eq!(sim.robot(id).joint_names(), ["joint0_", "joint0", "joint2"]);
    let links = ["body1", "joint1", "body3", "joint1.site"];
    assert_eq!(sim.robot(id).link_names(), links, "a site with the same name as a body");
    assert!(sim.diagnostics().iter().any(|d| d.kind == DiagnosticKind::NameClash));
}

/// Control parts are patterns of joint names.
#[test]
fn control_parts() {
    let part = |name: &str, patterns: &[&str]| (name.to_string(), patterns.iter().map(|p| p.to_string()).collect());
    let cfg = RobotCfg {
        control_parts: vec![part("arm", &["pan", "lift|elbow"]), part("wrist", &["[ry].*l|yaw|pitch"])],
        init_qpos: vec![("arm".into(), 0.25), ("rail".into(), 0.05)],
        drive: DriveCfg { stiffness: [("arm", 500.0), ("wrist", 40.0)].into(), ..Default::default() },
        ..robot("odd", ODD)
    };
    let (sim, id) = with(1, cfg);
    let of = sim.robot(id);
    assert_eq!(of.control_parts(), ["arm", "wrist"]);
    assert_eq!(of.joint_ids("arm").unwrap(), [0, 1, 2].map(JointIndex));
    assert_eq!(of.joint_ids("wrist").unwrap(), [3, 4, 5, 6].map(JointIndex));
    assert_eq!(of.stiffness().row(0).to_vec(), [500.0, 500.0, 500.0, 40.0, 40.0, 40.0, 40.0]);
    assert_eq!(of.qpos().row(0).to_vec(), [0.25, 0.25, 0.25, 0.05, 0.0, 0.0, 0.0]);
    assert_error(of.link_id("hnd"), "", &["\"hand\""]);
    // Frames behind the joints of a body are unnamed if another joint follows or the anchor is off the body's origin:
    // two of the shoulder, two of the carriage, one of the hand.
    assert!(of.link_id("pan.frame").is_err());
    let named: Vec<&str> = of.description().named_links().iter().map(|link| link.name.as_str()).collect();
    assert_eq!(named[..6], ["base", "shoulder", "fore", "carriage", "plate", "hand"]);
    assert!(named.contains(&"tip") && named.contains(&"shoulder_site"), "{named:?}");
    assert_eq!(of.description().links.len() - named.len(), 2 + 2 + 1);
}

/// Root cause: patterns of surfaces were matched with all links, including the unnamed frames between joints.
#[test]
fn surfaces() {
    let with_surfaces = |patterns: &[&str]| {
        let surfaces = patterns.iter().map(|pattern| (pattern.to_string(), SurfaceCfg::metal(0.5))).collect();
        empty(1).add_robot(RobotCfg { surfaces, ..robot("odd", ODD) })
    };
    assert_error(with_surfaces(&["pan.frame"]), "", &["surfaces", "\"pan.frame\" matches no link"]);
    // The links plate and hand; both patterns match pan.frame.
    with_surfaces(&["p.*", "[hp]an.*"]).unwrap();
    // Control: both patterns match the hand.
    assert_error(with_surfaces(&["h.*", "[hp]an.*"]), "", &["surfaces", "matched by both"]);
}

/// A dump loads in plain MuJoCo and describes the same robot, including drives. As a URDF it has the same tree, joints
/// and masses, without shapes.
#[test]
fn dumps() {
    let (mut sim, id) = with(1, RobotCfg { drive: gains(300.0, 30.0), ..robot("odd", ODD) });
    let files = TempFiles::default();
    sim.dump(files.folder()).unwrap();
    let file = if BUILD_VERSION == SupportedVersion::V2 { "robot.mjcf2.xml" } else { "robot.mjcf4.xml" };
    let model = compile_file(files.folder().join(file)).unwrap().into_model();
    assert_eq!((model.nv(), model.nu()), (7, 7));
    assert!((model.body_mass().iter().sum::<f64>() - 7.2).abs() < 1e-12);
    assert_eq!((model.dof_damping()[2], model.dof_armature()[1]), (0.2, 0.01));
    let (mut other, again) = with(1, urdf_robot("robot", files.folder().join("robot.urdf")));
    assert_eq!(other.robot(again).joint_names(), sim.robot(id).joint_names());
    let qpos = array![[0.3, -0.4, 0.5, 0.1, 0.2, -0.6, 0.7]];
    sim.robot_mut(id).write_qpos(&qpos, None, None).unwrap();
    other.robot_mut(again).write_qpos(&qpos, None, None).unwrap();
    let [base, tip] = ["base", "tip"].map(|link| pose_of_row(&sim.robot(id).link_pose(link).unwrap(), 0));
    let (far, angle) =
        pose_error(&(base.inverse() * tip), &pose_of_row(&other.robot(again).link_pose("tip").unwrap(), 0));
    assert!(far < 1e-9 && angle < 1e-7, "{far} {angle}");

    // A slide without limits and efforts can be read again, and is then unlimited.
    let text = r#"<mujoco><worldbody><body name="base"><geom size="0.1" mass="1"/><body name="cart">
        <joint name="rail" type="slide" axis="1 0 0"/><geom size="0.1" mass="1"/></body></body></worldbody></mujoco>"#;
    let ((sim, id), files) = (with(1, robot("cart", text)), TempFiles::default());
    sim.dump(files.folder()).unwrap();
    let (other, again) = with(1, urdf_robot("robot", files.folder().join("robot.urdf")));
    assert_eq!(other.robot(again).qpos_limits(), sim.robot(id).qpos_limits());
    assert_eq!(other.robot(again).qpos_limits()[(0, 0, 1)], f64::INFINITY);
}

/// With a fixed trunk, each joint of the humanoid settles in the static equilibrium of springs, gravity and drive. The
/// reference torque is MuJoCo's bias and passive force there, which causes the sag `kp (q* - q) = τ`. Without drives
/// the same robot moves by radians.
#[test]
#[ignore = "needs MuJoCo's sample models: cargo xtask test"]
fn humanoid() {
    let of_file = |name: &str| RobotCfg {
        mjcf: Some(MjcfFile::new(kinetoscope_testkit::test_resources::sample_model(name))),
        ..Default::default()
    };
    assert_error(empty(1).add_robot(of_file("humanoid/22_humanoids.xml")), "", &["top-level bodies"]);
    let (mut sim, id) = with(2, of_file("humanoid/humanoid.xml"));
    let of = sim.robot(id);
    assert_eq!((of.dof(), of.qpos().dim(), of.root_pose().dim()), (21, (2, 21), (2, 7)));
    let mass: f64 = sim.batch().read(0, |env| env.data().model().body_mass().iter().sum());
    assert!((of.total_mass() - mass).abs() < 1e-9 * mass && mass > 30.0, "{} {mass}", of.total_mass());
    let (start, kp) = (of.qpos(), of.stiffness());
    sim.update(2000);
    assert!(sim.diverged().is_empty());
    let (off, speed) = (&start - &sim.robot(id).qpos(), sim.robot(id).qvel());
    let load: Vec<f64> = sim.batch().read(0, |env| {
        env.data().qfrc_bias().iter().zip(env.data().qfrc_passive()).map(|(bias, passive)| bias - passive).collect()
    });
    assert_eq!(load.len(), 21);
    // The solver stops at 1e-8 of the scale of the scene; 1e-3 of the largest load is far above that, and far below the
    // effect of a wrong sign.
    assert!(largest(&load) > 1.0, "something is carried: {load:?}");
    for (joint, load_) in load.iter().enumerate() {
        assert!(speed[(0, joint)].abs() < 1e-4, "joint {joint} rests: {}", speed[(0, joint)]);
        let held = kp[(0, joint)] * off[(0, joint)];
        assert!((held - load_).abs() < 1e-2 * largest(&load), "joint {joint}: {held} N m, {load_} N m");
    }
    let (mut limp, id) = with(1, passive(of_file("humanoid/humanoid.xml")));
    limp.update(500);
    let off = limp.robot(id).qpos() - start.row(0);
    assert!(largest(&off) > 0.3, "{off}");
}

/// Every other sample model is a robot that steps or a typed error, never a panic. Every file that MuJoCo compiles
/// alone compiles in the scene: an error in the scene's document would be ours.
#[test]
#[ignore = "needs MuJoCo's sample models: cargo xtask test"]
fn other_samples() {
    let (mut robots, mut refused) = (0, 0);
    for folder in std::fs::read_dir(kinetoscope_testkit::test_resources::sample_model("")).unwrap().flatten() {
        for file in std::fs::read_dir(folder.path()).into_iter().flatten().flatten().map(|file| file.path()) {
            for fix_base in [true, false] {
                if file.extension().is_none_or(|extension| extension != "xml") {
                    continue;
                }
                let mut sim = empty(1);
                match sim.add_robot(RobotCfg { mjcf: Some(MjcfFile::new(&file)), fix_base, ..Default::default() }) {
                    Ok(id) => {
                        let rows = Array2::zeros((1, sim.robot(id).dof()));
                        sim.robot_mut(id).set_qpos_target(&rows, None, None).unwrap();
                        sim.update(5);
                        assert!(sim.diverged().is_empty(), "{}: {:?}", file.display(), sim.diverged());
                        robots += 1;
                    }
                    Err(error) => {
                        assert!(matches!(error, Error::RobotFile { .. }), "{}: {error}", file.display());
                        refused += 1;
                    }
                }
            }
        }
    }
    assert!(robots >= 2 && refused >= 10, "{robots} {refused}");
}

//! What has no name, what is called alike, and patterns.

use super::{ODD, empty, robot};
use kinetoscope::prelude::*;
use kinetoscope::sim::DiagnosticKind;

#[test]
fn what_has_no_name_is_called_by_its_number() {
    let text = r#"<mujoco><worldbody><body><geom size="0.1" mass="1"/>
        <body name="joint1"><joint axis="0 0 1"/><geom size="0.1" mass="1"/><site/></body>
        <body><joint name="joint0" axis="0 0 1" pos="0.1 0 0"/><joint axis="0 1 0" pos="0 0.1 0"/><geom size="0.1" mass="1"/>
          <site name="joint1"/></body></body></worldbody></mujoco>"#;
    let mut sim = empty(1);
    let id = sim.add_robot(robot("r", text)).unwrap();
    let robot = sim.robot(id);
    // The joint that is joint0 in the file keeps its name, the one before it that has none gets another.
    assert_eq!(robot.joint_names(), ["joint0_", "joint0", "joint2"]);
    assert_eq!(robot.link_names(), ["body1", "joint1", "body3", "joint1.site"], "a site that is called as a body");
    assert!(sim.diagnostics().iter().any(|d| d.kind == DiagnosticKind::NameClash));
}

#[test]
fn control_parts_are_patterns_of_joint_names() {
    let parts = vec![
        ("arm".to_string(), vec!["pan".to_string(), "lift|elbow".to_string()]),
        ("wrist".to_string(), vec!["[ry].*l|yaw|pitch".to_string()]),
    ];
    let mut sim = empty(1);
    let cfg = RobotCfg {
        control_parts: parts.clone(),
        init_qpos: vec![("arm".into(), 0.25), ("rail".into(), 0.05)],
        drive: DriveCfg { stiffness: [("arm", 500.0), ("wrist", 40.0)].into(), ..Default::default() },
        ..robot("odd", ODD)
    };
    let id = sim.add_robot(cfg.clone()).unwrap();
    let robot_ = sim.robot(id);
    assert_eq!(robot_.control_parts(), ["arm", "wrist"]);
    assert_eq!(robot_.get_joint_ids("arm").unwrap(), [0, 1, 2].map(JointIndex));
    assert_eq!(robot_.get_joint_ids("wrist").unwrap(), [3, 4, 5, 6].map(JointIndex));
    assert_eq!(robot_.get_stiffness().row(0).to_vec(), [500.0, 500.0, 500.0, 40.0, 40.0, 40.0, 40.0]);
    assert_eq!(robot_.get_qpos().row(0).to_vec(), [0.25, 0.25, 0.25, 0.05, 0.0, 0.0, 0.0]);

    let wrong = RobotCfg { control_parts: vec![("arm".into(), vec!["elbo".into()])], ..cfg.clone() };
    let error = empty(1).add_robot(wrong).unwrap_err().to_string();
    assert!(error.contains("elbo") && error.contains("\"elbow\""), "{error}");
    let wrong = RobotCfg { drive: DriveCfg { stiffness: [("lft", 1.0)].into(), ..Default::default() }, ..cfg };
    let error = empty(1).add_robot(wrong).unwrap_err().to_string();
    assert!(error.contains("lft") && error.contains("\"lift\""), "{error}");
    let error = robot_.link_id("hnd").unwrap_err().to_string();
    assert!(error.contains("\"hand\""), "{error}");
    // Frames behind the joints of a body are nobody's, where a joint follows or the anchor is beside the body's origin: two of
    // the shoulder, two of the carriage, one of the hand.
    assert!(robot_.link_id("pan.frame").is_err());
    let description = robot_.description();
    let named: Vec<&str> = description.named_links().iter().map(|link| link.name.as_str()).collect();
    assert_eq!(named[..6], ["base", "shoulder", "fore", "carriage", "plate", "hand"]);
    assert!(named.contains(&"tip") && named.contains(&"shoulder_site"), "{named:?}");
    assert_eq!(description.links.len() - named.len(), 2 + 2 + 1);
}

#[test]
fn robots_of_one_file_are_told_apart_by_their_uid() {
    let mut sim = empty(1);
    let ids = ["left", "right"].map(|uid| sim.add_robot(robot(uid, ODD)).unwrap());
    let error = sim.add_robot(robot("left", ODD)).unwrap_err();
    assert!(matches!(error, Error::DuplicateUid(_)), "{error}");
    sim.add_mjcf(MjcfCfg::text("part", ODD)).unwrap();
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    sim.add_robot(RobotCfg { uid: "sr5".into(), urdf, ..Default::default() }).unwrap();
    sim.robot_mut(ids[1]).write_qpos(&kinetoscope::ndarray::array![[0.3]], Some(&[JointIndex(6)]), None).unwrap();
    assert_eq!((sim.robot(ids[0]).get_qpos()[(0, 6)], sim.robot(ids[1]).get_qpos()[(0, 6)]), (0.0, 0.3));
    assert_eq!(sim.robot(ids[1]).joint_names(), sim.robot(ids[0]).joint_names());
}

//! Several URDF files become one robot: who hangs from whom, what things are called, and what is refused.

use kinetoscope::sim::urdf::{ComponentCfg, NameCase, NameCaseCfg, UrdfCfg, UrdfError, assemble, write_urdf};
use kinetoscope::sim::{Diagnostic, DiagnosticKind, RobotDescription};
use nalgebra::{Translation3, UnitQuaternion};
use std::path::{Path, PathBuf};

type Pose = kinetoscope::scene::Pose;

struct Files(tempfile::TempDir);

impl Files {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// A URDF from `parent joint child` triples; joints that start with `r` are revolute. The first link is the first
    /// parent.
    fn write(&self, name: &str, tree: &str) -> PathBuf {
        let mut links: Vec<&str> = Vec::new();
        let mut joints = String::new();
        for edge in tree.split(',') {
            let words: Vec<&str> = edge.split_whitespace().collect();
            for &link in words.iter().step_by(2).filter(|_| words.len() != 2) {
                if !links.contains(&link) {
                    links.push(link);
                }
            }
            if let [parent, joint, child] = words[..] {
                let kind = if joint.to_lowercase().starts_with('r') { "revolute" } else { "fixed" };
                let limit = "<limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/>";
                let followed = joint.strip_suffix("_m");
                let mimic = followed.map(|f| format!("<mimic joint=\"{f}\"/>")).unwrap_or_default();
                joints += &format!(
                    "<joint name=\"{joint}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
                     {limit}{mimic}</joint>\n"
                );
            }
        }
        let links: String = links.iter().map(|l| format!("<link name=\"{l}\"/>\n")).collect();
        let path = self.0.path().join(format!("{name}.urdf"));
        std::fs::write(&path, format!("<robot name=\"{name}\">\n{links}{joints}</robot>")).unwrap();
        path
    }

    fn arm(&self) -> PathBuf {
        self.write("arm", "base_link r1 link1, link1 r2 link2, link1 camera_mount camera, link2 tool ee_link")
    }

    fn hand(&self) -> PathBuf {
        self.write("hand", "base_link palm_joint palm, palm r_thumb thumb, palm r_thumb_m finger")
    }
}

fn moved() -> Pose {
    Pose::from_parts(Translation3::new(0.1, 0.2, 0.3), UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3))
}

fn cfg(components: Vec<ComponentCfg>) -> UrdfCfg {
    UrdfCfg { components, ..Default::default() }
}

fn link_names(robot: &RobotDescription) -> Vec<&str> {
    robot.links.iter().map(|l| l.name.as_str()).collect()
}

fn joint_names(robot: &RobotDescription) -> Vec<&str> {
    robot.joints.iter().map(|l| l.name.as_str()).collect()
}

/// The parent link of the root of a component.
fn attached_to<'r>(robot: &'r RobotDescription, component: &str) -> Option<&'r str> {
    let links = robot.links.iter().filter(|l| l.component == component);
    let parents = links.filter_map(|l| l.parent_joint).map(|j| robot.link(robot.joint(j).parent));
    parents.filter(|p| p.component != component).map(|p| p.name.as_str()).next()
}

fn of_kind(diagnostics: &[Diagnostic], kind: DiagnosticKind) -> Vec<String> {
    diagnostics.iter().filter(|d| d.kind == kind).map(ToString::to_string).collect()
}

/// What holds for every merged robot.
fn check(robot: &RobotDescription) {
    let unique = |names: Vec<&str>| names.iter().collect::<std::collections::HashSet<_>>().len() == names.len();
    assert!(unique(link_names(robot)) && unique(joint_names(robot)));
    assert_eq!(robot.joints.len() + 1, robot.links.len());
    for (id, link) in robot.links.iter().enumerate() {
        assert_eq!(link.parent_joint.is_none(), id == robot.root.0, "{}", link.name);
        assert!(link.parent_joint.is_none_or(|j| robot.joint(j).child.0 == id));
        assert!(link.child_joints.iter().all(|&j| robot.joint(j).parent.0 == id));
    }
    let again = kinetoscope::sim::urdf::parse_str(&write_urdf(robot), Path::new("again.urdf")).unwrap();
    assert_eq!(again.robot.links.len(), robot.links.len());
}

/// File names are what the caller says, of each mesh and texture, and what is written reads back to them.
#[test]
fn files_are_called_as_the_writer_is_told() {
    let files = Files::new();
    let path = files.0.path().join("meshes.urdf");
    let text = r#"<robot name="m"><link name="a"><visual><geometry><mesh filename="seen.obj"/></geometry>
        <material name="wood"><texture filename="wood.png"/></material></visual>
        <collision><geometry><mesh filename="deep/hit.stl" scale="2 2 2"/></geometry></collision></link></robot>"#;
    std::fs::create_dir(files.0.path().join("deep")).unwrap();
    for name in ["seen.obj", "wood.png", "deep/hit.stl"] {
        std::fs::write(files.0.path().join(name), "").unwrap();
    }
    std::fs::write(&path, text).unwrap();
    let robot = assemble(&UrdfCfg::single(&path)).unwrap().description;
    let asked = std::cell::RefCell::new(Vec::new());
    let written = kinetoscope::sim::urdf::write_urdf_with(&robot, |file| {
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        asked.borrow_mut().push(name.clone());
        format!("package://m/{name}")
    });
    assert_eq!(*asked.borrow(), ["seen.obj", "wood.png", "hit.stl"]);
    for name in ["seen.obj", "wood.png", "hit.stl"] {
        assert_eq!(written.matches(&format!("filename=\"package://m/{name}\"")).count(), 1, "{name} in {written}");
    }
    // The control: without being told, absolute paths.
    let here = files.0.path().join("deep/hit.stl");
    assert!(write_urdf(&robot).contains(&*here.to_string_lossy()) && !written.contains(&*here.to_string_lossy()));
}

#[test]
fn one_file_stays_as_it_is() {
    let files = Files::new();
    let robot = assemble(&UrdfCfg::single(files.arm())).unwrap();
    check(&robot.description);
    assert_eq!(link_names(&robot.description), ["base_link", "link1", "link2", "camera", "ee_link"]);
    assert_eq!(joint_names(&robot.description), ["r1", "r2", "camera_mount", "tool"]);
    assert_eq!(robot.description.name, "arm");
    assert!(robot.diagnostics.is_empty());
}

#[test]
fn transform_prefix_and_case_of_a_single_component_are_honoured() {
    let files = Files::new();
    let component = ComponentCfg {
        transform: moved(),
        prefix: Some("my_".to_owned()),
        ..ComponentCfg::new("left_arm", files.arm())
    };
    let case = NameCaseCfg { joint: NameCase::Upper, link: NameCase::Lower };
    let robot =
        assemble(&UrdfCfg { name_case: case, name: Some("n".to_owned()), ..cfg(vec![component]) }).unwrap().description;
    check(&robot);
    assert_eq!(link_names(&robot)[..2], ["base_link", "my_base_link"]);
    assert_eq!(joint_names(&robot), ["BASE_TO_LEFT_ARM_CONNECTOR", "MY_R1", "MY_R2", "MY_CAMERA_MOUNT", "MY_TOOL"]);
    assert_eq!((robot.joints[0].parent_from_joint, robot.root.0, robot.name.as_str()), (moved(), 0, "n"));

    // The file's own base_link keeps its name, the added link makes way.
    let component = ComponentCfg { transform: moved(), ..ComponentCfg::new("left_arm", files.arm()) };
    let assembly = assemble(&cfg(vec![component])).unwrap();
    assert_eq!(link_names(&assembly.description)[..2], ["base_link_2", "base_link"]);
    assert_eq!(of_kind(&assembly.diagnostics, DiagnosticKind::NameClash).len(), 1);
}

#[test]
fn a_hand_hangs_from_the_tip_of_the_arm_in_any_order() {
    let files = Files::new();
    let hand = ComponentCfg { transform: moved(), ..ComponentCfg::new("hand", files.hand()) };
    let arm = ComponentCfg::new("arm", files.arm());
    for components in [vec![arm.clone(), hand.clone()], vec![hand, arm]] {
        let assembly = assemble(&cfg(components)).unwrap();
        let robot = &assembly.description;
        check(robot);
        assert_eq!(attached_to(robot, "hand"), Some("ee_link"));
        assert_eq!(joint_names(robot)[4..], ["arm_TO_hand_CONNECTOR", "palm_joint", "r_thumb", "r_thumb_m"]);
        assert_eq!(link_names(robot)[5..], ["hand_base_link", "palm", "thumb", "finger"]);
        assert_eq!(robot.joints[4].parent_from_joint, moved());
        let mimic = robot.joints[7].mimic.as_ref().unwrap();
        assert_eq!(robot.joint(mimic.joint).name, "r_thumb");
        let clashes = of_kind(&assembly.diagnostics, DiagnosticKind::NameClash);
        assert_eq!(clashes.len(), 1);
        for part in
            ["hand.urdf:2: ", "link \"base_link\" of \"hand\" is now \"hand_base_link\"", "of \"arm\"", "arm.urdf:2)"]
        {
            assert!(clashes[0].contains(part), "{part} not in {}", clashes[0]);
        }
    }
}

#[test]
fn two_arms_two_hands_and_a_torso() {
    let files = Files::new();
    let torso = files.write("torso", "base r_waist chest, chest left left_mount, chest right right_mount");
    let part = |name: &str, urdf: PathBuf| ComponentCfg::new(name, urdf);
    let on = |link: &str, c: ComponentCfg| ComponentCfg { parent_link: Some(link.to_owned()), ..c };
    let components = vec![
        part("torso", torso),
        on("left_mount", part("left_arm", files.arm())),
        on("right_mount", part("right_arm", files.arm())),
        part("left_hand", files.hand()),
        part("right_hand", files.hand()),
    ];
    let ambiguous = cfg(vec![components[0].clone(), part("left_arm", files.arm())]);
    let error = assemble(&ambiguous).unwrap_err();
    assert!(matches!(error, UrdfError::TipAmbiguous { .. }));
    let text = error.to_string();
    assert!(text.contains("set parent_link") && text.contains("\"left_mount\", \"right_mount\""), "{text}");

    let upper = NameCaseCfg { joint: NameCase::Upper, ..Default::default() };
    let assembly = assemble(&UrdfCfg { name_case: upper, ..cfg(components) }).unwrap();
    let robot = &assembly.description;
    check(robot);
    for (component, link) in [
        ("left_arm", "left_mount"),
        ("right_arm", "right_mount"),
        ("left_hand", "left_ee_link"),
        ("right_hand", "right_ee_link"),
    ] {
        assert_eq!(attached_to(robot, component), Some(link), "{component}");
    }
    assert!(joint_names(robot).contains(&"LEFT_R_THUMB_M") && joint_names(robot).contains(&"LEFT_R1"));
    // Two base_links on each side: the arm's, and the hand's under its component's name.
    assert!(link_names(robot).contains(&"left_base_link") && link_names(robot).contains(&"left_hand_base_link"));
    assert_eq!(
        robot,
        &assemble(&UrdfCfg {
            name_case: upper,
            ..cfg(vec![
                part("torso", files.0.path().join("torso.urdf")),
                on("left_mount", part("left_arm", files.arm())),
                on("right_mount", part("right_arm", files.arm())),
                part("left_hand", files.hand()),
                part("right_hand", files.hand()),
            ])
        })
        .unwrap()
        .description
    );
}

#[test]
fn usual_parents() {
    let files = Files::new();
    let one = |name: &str| ComponentCfg::new(name, files.write(name, &format!("{name}_root r_{name} {name}_tip")));
    let expect = |names: &[&str], expected: &[(&str, Option<&str>)]| {
        let robot = assemble(&cfg(names.iter().map(|n| one(n)).collect())).unwrap().description;
        check(&robot);
        for &(component, parent) in expected {
            assert_eq!(attached_to(&robot, component), parent, "{component} of {names:?}");
        }
    };
    expect(
        &["hand", "arm", "head", "torso", "legs", "chassis"],
        &[
            ("chassis", None),
            ("legs", Some("chassis_root")),
            ("torso", Some("legs_tip")),
            ("head", Some("torso_tip")),
            ("arm", Some("torso_tip")),
            ("hand", Some("arm_tip")),
        ],
    );
    expect(&["chassis", "torso"], &[("torso", Some("chassis_root"))]);
    expect(&["chassis", "arm"], &[("arm", Some("chassis_root"))]);
    expect(&["legs", "torso"], &[("legs", Some("base_link")), ("torso", Some("base_link"))]);
    expect(&["left_arm", "right_arm"], &[("left_arm", Some("base_link")), ("right_arm", Some("base_link"))]);
    expect(&["hand"], &[("hand", None)]);
}

#[test]
fn names_of_any_kind_become_unique() {
    let files = Files::new();
    let twins = files.write("twins", "Base R1 base, base r1 BASE, BASE R_1 x_base, x_base f x_base_2");
    let lower = NameCaseCfg { joint: NameCase::Lower, link: NameCase::Lower };
    let assembly = assemble(&UrdfCfg { name_case: lower, ..cfg(vec![ComponentCfg::new("x", twins)]) }).unwrap();
    check(&assembly.description);
    assert_eq!(link_names(&assembly.description), ["base", "x_base", "x_base_2", "x_x_base", "x_x_base_2"]);
    assert_eq!(of_kind(&assembly.diagnostics, DiagnosticKind::NameClash).len(), 5);
}

#[test]
fn free_names_and_links_by_name() {
    let files = Files::new();
    let tool = files.write("tool", "flange f blade");
    let at = |link: Option<&str>, child: Option<&str>| ComponentCfg {
        parent: Some("robot".to_owned()),
        parent_link: link.map(str::to_owned),
        child_link: child.map(str::to_owned),
        ..ComponentCfg::new("my_tool", &tool)
    };
    let with = |tool: ComponentCfg| assemble(&cfg(vec![ComponentCfg::new("robot", files.arm()), tool]));
    assert_eq!(attached_to(&with(at(None, None)).unwrap().description, "my_tool"), Some("ee_link"));
    let robot = with(at(Some("camera"), Some("flange"))).unwrap().description;
    assert_eq!(attached_to(&robot, "my_tool"), Some("camera"));

    let error = with(at(Some("ee_lnk"), None)).unwrap_err();
    assert!(matches!(error, UrdfError::AttachLinkUnknown { field: "parent_link", .. }));
    assert!(error.to_string().contains("\"ee_lnk\" is not a link of \"robot\"; candidates: \"ee_link\""), "{error}");
    let error = with(at(None, Some("blade"))).unwrap_err();
    assert!(
        matches!(error, UrdfError::ChildLinkNotRoot { .. }) && error.to_string().contains("use \"flange\""),
        "{error}"
    );
    let error = with(at(None, Some("bladee"))).unwrap_err();
    assert!(matches!(error, UrdfError::AttachLinkUnknown { field: "child_link", .. }), "{error}");
}

#[test]
fn wrong_configurations_are_typed_errors() {
    let files = Files::new();
    let part = |name: &str| ComponentCfg::new(name, files.arm());
    let under = |name: &str, parent: &str| ComponentCfg { parent: Some(parent.to_owned()), ..part(name) };
    let error = |components: Vec<ComponentCfg>| assemble(&cfg(components)).unwrap_err();

    assert!(matches!(error(vec![]), UrdfError::NoComponents));
    let e = error(vec![part("arm"), part("arm")]);
    assert!(matches!(e, UrdfError::ComponentRepeated { .. }) && e.to_string().contains("\"arm\""), "{e}");
    let e = error(vec![part("arm"), under("hand", "Arm")]);
    assert!(matches!(e, UrdfError::ComponentUnknown { .. }) && e.to_string().contains("candidates: \"arm\""), "{e}");
    let e = error(vec![part("arm"), part("camera")]);
    assert!(matches!(e, UrdfError::ComponentParentRequired { .. }) && e.to_string().contains("set its parent"), "{e}");
    let e = error(vec![part("arm"), under("a", "b"), under("b", "a")]);
    assert!(matches!(e, UrdfError::ComponentCycle { .. }) && e.to_string().contains("\"a\" -> \"b\" -> \"a\""), "{e}");
    assert!(matches!(error(vec![under("a", "a")]), UrdfError::ComponentCycle { .. }));
    let e = error(vec![ComponentCfg { parent_link: Some("x".to_owned()), ..part("arm") }]);
    assert!(matches!(e, UrdfError::ParentLinkWithoutParent { .. }), "{e}");
    let nan = Pose::translation(f64::NAN, 0.0, 0.0);
    let e = error(vec![ComponentCfg { transform: nan, ..part("arm") }]);
    assert!(matches!(e, UrdfError::ComponentInvalid { .. }) && e.to_string().contains("not finite"), "{e}");
    assert!(matches!(error(vec![part(" ")]), UrdfError::ComponentInvalid { .. }));
    let e = error(vec![ComponentCfg::new("arm", "no/such.urdf")]);
    assert!(matches!(e, UrdfError::FileMissing { .. }), "{e}");
}

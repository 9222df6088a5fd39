//! Assembly of several URDF files into one robot: parent links, names, and refusals.

use kinetoscope::prelude::*;
use kinetoscope::robot::description::RobotDescription;
use kinetoscope::robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope::robot::urdf::{NameCase, NameCaseCfg, UrdfError, assemble, parse_str, write_urdf, write_urdf_with};
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::urdf::{TempFiles, joint, limit};
use nalgebra::{Translation3, UnitQuaternion};
use std::path::{Path, PathBuf};

/// Writes a URDF of `parent joint child` triples; joints that start with `r` are revolute. The first parent is the
/// first link.
fn write(files: &TempFiles, name: &str, tree: &str) -> PathBuf {
    let (mut links, mut joints) = (Vec::<&str>::new(), String::new());
    for edge in tree.split(',') {
        let words: Vec<&str> = edge.split_whitespace().collect();
        let [parent, name, child] = words[..] else { panic!("{edge}") };
        for link in [parent, child] {
            if !links.contains(&link) {
                links.push(link);
            }
        }
        let kind = if name.to_lowercase().starts_with('r') { "revolute" } else { "fixed" };
        let mimic = name.strip_suffix("_m").map(|f| format!("<mimic joint=\"{f}\"/>")).unwrap_or_default();
        let more = limit([-1.0, 1.0], 1.0, 1.0) + &mimic;
        joints += &joint(name, kind, [parent, child], [0.0; 3], "1 0 0", &more);
    }
    let links: String = links.iter().map(|l| format!("<link name=\"{l}\"/>\n")).collect();
    files.write(&format!("{name}.urdf"), format!("<robot name=\"{name}\">\n{links}{joints}</robot>"))
}

fn arm(files: &TempFiles) -> PathBuf {
    write(files, "arm", "base_link r1 link1, link1 r2 link2, link1 camera_mount camera, link2 tool ee_link")
}

fn hand(files: &TempFiles) -> PathBuf {
    write(files, "hand", "base_link palm_joint palm, palm r_thumb thumb, palm r_thumb_m finger")
}

fn moved() -> Pose {
    Pose::from_parts(Translation3::new(0.1, 0.2, 0.3), UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3))
}

fn cfg(components: Vec<ComponentCfg>) -> UrdfCfg {
    UrdfCfg { components, ..Default::default() }
}

/// The merged robot and its diagnostics; asserts the invariants of every merged robot.
#[track_caller]
fn merged(cfg: &UrdfCfg) -> (RobotDescription, Vec<Diagnostic>) {
    let assembly = assemble(cfg).unwrap();
    let robot = assembly.description;
    let unique = |names: Vec<&str>| names.iter().collect::<std::collections::HashSet<_>>().len() == names.len();
    assert!(unique(link_names(&robot)) && unique(joint_names(&robot)));
    assert_eq!(robot.joints.len() + 1, robot.links.len());
    for (id, link) in robot.links.iter().enumerate() {
        assert_eq!(link.parent_joint.is_none(), id == robot.root.0, "{}", link.name);
        assert!(link.parent_joint.is_none_or(|j| robot.joint(j).child.0 == id));
        assert!(link.child_joints.iter().all(|&j| robot.joint(j).parent.0 == id));
    }
    let again = parse_str(&write_urdf(&robot), Path::new("again.urdf")).unwrap();
    assert_eq!(again.robot.links.len(), robot.links.len());
    (robot, assembly.diagnostics)
}

fn link_names(robot: &RobotDescription) -> Vec<&str> {
    robot.links.iter().map(|l| l.name.as_str()).collect()
}

fn joint_names(robot: &RobotDescription) -> Vec<&str> {
    robot.joints.iter().map(|l| l.name.as_str()).collect()
}

/// The parent link of a component's root.
fn attached_to<'r>(robot: &'r RobotDescription, component: &str) -> Option<&'r str> {
    let links = robot.links.iter().filter(|l| l.component == component);
    let parents = links.filter_map(|l| l.parent_joint).map(|j| robot.link(robot.joint(j).parent));
    parents.filter(|p| p.component != component).map(|p| p.name.as_str()).next()
}

fn clashes(diagnostics: &[Diagnostic]) -> Vec<String> {
    diagnostics.iter().filter(|d| d.kind == DiagnosticKind::NameClash).map(ToString::to_string).collect()
}

/// Root cause: a material without values at the top of a file was a definition. It hid a later one at the top or in
/// another visual, and was refused after one.
#[test]
fn materials_without_values() {
    let files = TempFiles::default();
    let empty = "<material name=\"a\"/>";
    let red = "<material name=\"a\"><color rgba=\"1 0 0 1\"/></material>";
    let visual = |material: &str| format!("<visual><geometry><sphere radius=\"1\"/></geometry>{material}</visual>");
    for (top, visuals) in [
        (format!("{empty}{red}"), visual(empty)),
        (format!("{red}{empty}"), visual(empty)),
        (empty.to_string(), visual(red) + &visual(empty)),
    ] {
        let text = format!("<robot name=\"m\">{top}<link name=\"a\">{visuals}</link></robot>");
        let (robot, diagnostics) = merged(&UrdfCfg::single(files.write("materials.urdf", &text)));
        let colors: Vec<_> = robot.links[0].visuals.iter().map(|v| v.material.as_ref().and_then(|m| m.rgba)).collect();
        assert!(colors.iter().all(|color| *color == Some([1.0, 0.0, 0.0, 1.0])), "{text}: {colors:?}");
        assert!(diagnostics.is_empty(), "{text}: {diagnostics:?}");
    }
}

/// The caller sets the file name of each mesh and texture.
#[test]
fn file_names() {
    let files = TempFiles::default();
    let names = ["seen.obj", "wood.png", "hit.stl"];
    let text = r#"<robot name="m"><link name="a"><visual><geometry><mesh filename="seen.obj"/></geometry>
        <material name="wood"><texture filename="wood.png"/></material></visual>
        <collision><geometry><mesh filename="deep/hit.stl" scale="2 2 2"/></geometry></collision></link></robot>"#;
    for name in ["seen.obj", "wood.png", "deep/hit.stl"] {
        files.write(name, "");
    }
    let robot = assemble(&UrdfCfg::single(files.write("meshes.urdf", text))).unwrap().description;
    let asked = std::cell::RefCell::new(Vec::new());
    let written = write_urdf_with(&robot, |file| {
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        asked.borrow_mut().push(name.clone());
        format!("package://m/{name}")
    });
    assert_eq!(*asked.borrow(), names);
    for name in names {
        assert_eq!(written.matches(&format!("filename=\"package://m/{name}\"")).count(), 1, "{name} in {written}");
    }
    // Control: without given names, paths are absolute.
    let here = files.folder().join("deep/hit.stl");
    assert!(write_urdf(&robot).contains(&*here.to_string_lossy()) && !written.contains(&*here.to_string_lossy()));
}

#[test]
fn one_component() {
    let files = TempFiles::default();
    let (robot, diagnostics) = merged(&UrdfCfg::single(arm(&files)));
    assert_eq!(link_names(&robot), ["base_link", "link1", "link2", "camera", "ee_link"]);
    assert_eq!(joint_names(&robot), ["r1", "r2", "camera_mount", "tool"]);
    assert!(robot.name == "arm" && diagnostics.is_empty());

    let at = ComponentCfg { transform: moved(), ..ComponentCfg::new("left_arm", arm(&files)) };
    let component = ComponentCfg { prefix: Some("my_".to_owned()), ..at.clone() };
    let name_case = NameCaseCfg { joint: NameCase::Upper, link: NameCase::Lower };
    let (robot, _) = merged(&UrdfCfg { name_case, name: Some("n".to_owned()), ..cfg(vec![component]) });
    assert_eq!(link_names(&robot)[..2], ["base_link", "my_base_link"]);
    assert_eq!(joint_names(&robot), ["BASE_TO_LEFT_ARM_CONNECTOR", "MY_R1", "MY_R2", "MY_CAMERA_MOUNT", "MY_TOOL"]);
    assert_eq!((robot.joints[0].parent_from_joint, robot.root.0, robot.name.as_str()), (moved(), 0, "n"));
    // The file's own base_link keeps its name, and the added link gets another.
    let (robot, diagnostics) = merged(&cfg(vec![at]));
    assert_eq!(link_names(&robot)[..2], ["base_link_2", "base_link"]);
    assert_eq!(clashes(&diagnostics).len(), 1);

    let case_twins = write(&files, "twins", "Base R1 base, base r1 BASE, BASE R_1 x_base, x_base f x_base_2");
    let name_case = NameCaseCfg { joint: NameCase::Lower, link: NameCase::Lower };
    let (robot, diagnostics) = merged(&UrdfCfg { name_case, ..cfg(vec![ComponentCfg::new("x", case_twins)]) });
    assert_eq!(link_names(&robot), ["base", "x_base", "x_base_2", "x_x_base", "x_x_base_2"]);
    assert_eq!(clashes(&diagnostics).len(), 5);
}

#[test]
fn hand_on_arm() {
    let files = TempFiles::default();
    let hand = ComponentCfg { transform: moved(), ..ComponentCfg::new("hand", hand(&files)) };
    let arm = ComponentCfg::new("arm", arm(&files));
    for components in [vec![arm.clone(), hand.clone()], vec![hand, arm]] {
        let (robot, diagnostics) = merged(&cfg(components));
        assert_eq!(attached_to(&robot, "hand"), Some("ee_link"));
        assert_eq!(joint_names(&robot)[4..], ["arm_TO_hand_CONNECTOR", "palm_joint", "r_thumb", "r_thumb_m"]);
        assert_eq!(link_names(&robot)[5..], ["hand_base_link", "palm", "thumb", "finger"]);
        assert_eq!(robot.joints[4].parent_from_joint, moved());
        assert_eq!(robot.joint(robot.joints[7].mimic.as_ref().unwrap().joint).name, "r_thumb");
        let clashes = clashes(&diagnostics);
        let text = "link \"base_link\" of \"hand\" is now \"hand_base_link\"";
        let parts = ["hand.urdf:2: ", text, "of \"arm\"", "arm.urdf:2)"];
        assert!(clashes.len() == 1 && parts.iter().all(|part| clashes[0].contains(part)), "{clashes:?}");
    }
}

#[test]
fn two_arms_and_hands() {
    let files = TempFiles::default();
    let torso = write(&files, "torso", "base r_waist chest, chest left left_mount, chest right right_mount");
    let part = |name: &str, urdf: PathBuf| ComponentCfg::new(name, urdf);
    let on = |link: &str, c: ComponentCfg| ComponentCfg { parent_link: Some(link.to_owned()), ..c };
    let components = vec![
        part("torso", torso),
        on("left_mount", part("left_arm", arm(&files))),
        on("right_mount", part("right_arm", arm(&files))),
        part("left_hand", hand(&files)),
        part("right_hand", hand(&files)),
    ];
    let ambiguous = cfg(vec![components[0].clone(), part("left_arm", arm(&files))]);
    assert_error(assemble(&ambiguous), "TipAmbiguous", &["set parent_link", "\"left_mount\", \"right_mount\""]);
    let name_case = NameCaseCfg { joint: NameCase::Upper, ..Default::default() };
    let cfg = UrdfCfg { name_case, ..cfg(components) };
    let (robot, _) = merged(&cfg);
    for (component, link) in [
        ("left_arm", "left_mount"),
        ("right_arm", "right_mount"),
        ("left_hand", "left_ee_link"),
        ("right_hand", "right_ee_link"),
    ] {
        assert_eq!(attached_to(&robot, component), Some(link), "{component}");
    }
    assert!(["LEFT_R_THUMB_M", "LEFT_R1"].iter().all(|name| joint_names(&robot).contains(name)));
    // Two links named base_link on each side: the arm's, and the hand's with the name of its component.
    assert!(["left_base_link", "left_hand_base_link"].iter().all(|name| link_names(&robot).contains(name)));
    assert_eq!(robot, assemble(&cfg).unwrap().description);
}

#[test]
fn usual_parents() {
    let files = TempFiles::default();
    type Parent<'a> = (&'a str, Option<&'a str>);
    let rows: [(&[&str], &[Parent<'_>]); 6] = [
        (
            &["hand", "arm", "head", "torso", "legs", "chassis"],
            &[
                ("chassis", None),
                ("legs", Some("chassis_root")),
                ("torso", Some("legs_tip")),
                ("head", Some("torso_tip")),
                ("arm", Some("torso_tip")),
                ("hand", Some("arm_tip")),
            ],
        ),
        (&["chassis", "torso"], &[("torso", Some("chassis_root"))]),
        (&["chassis", "arm"], &[("arm", Some("chassis_root"))]),
        (&["legs", "torso"], &[("legs", Some("base_link")), ("torso", Some("base_link"))]),
        (&["left_arm", "right_arm"], &[("left_arm", Some("base_link")), ("right_arm", Some("base_link"))]),
        (&["hand"], &[("hand", None)]),
    ];
    for (names, expected) in rows {
        let one =
            |name: &&str| ComponentCfg::new(*name, write(&files, name, &format!("{name}_root r_{name} {name}_tip")));
        let (robot, _) = merged(&cfg(names.iter().map(one).collect()));
        for &(component, parent) in expected {
            assert_eq!(attached_to(&robot, component), parent, "{component} of {names:?}");
        }
    }
}

#[test]
fn links_by_name() {
    let files = TempFiles::default();
    let tool = write(&files, "tool", "flange f blade");
    let with = |link: Option<&str>, child: Option<&str>| {
        let tool = ComponentCfg {
            parent: Some("robot".to_owned()),
            parent_link: link.map(str::to_owned),
            child_link: child.map(str::to_owned),
            ..ComponentCfg::new("my_tool", &tool)
        };
        assemble(&cfg(vec![ComponentCfg::new("robot", arm(&files)), tool]))
    };
    assert_eq!(attached_to(&with(None, None).unwrap().description, "my_tool"), Some("ee_link"));
    let robot = with(Some("camera"), Some("flange")).unwrap().description;
    assert_eq!(attached_to(&robot, "my_tool"), Some("camera"));
    // Also if other links come first: those of an added base.
    let robot = ComponentCfg { transform: moved(), ..ComponentCfg::new("robot", arm(&files)) };
    let [parent, parent_link] = ["robot", "camera"].map(|name| Some(name.to_owned()));
    let on_camera = ComponentCfg { parent, parent_link, ..ComponentCfg::new("my_tool", &tool) };
    assert_eq!(attached_to(&merged(&cfg(vec![robot, on_camera])).0, "my_tool"), Some("camera"));
    let parts = ["\"ee_lnk\" is not a link of \"robot\"; candidates: \"ee_link\""];
    let error = with(Some("ee_lnk"), None);
    assert!(matches!(error, Err(UrdfError::AttachLinkUnknown { field: "parent_link", .. })));
    assert_error(error, "AttachLinkUnknown", &parts);
    assert_error(with(None, Some("blade")), "ChildLinkNotRoot", &["use \"flange\""]);
    let error = with(None, Some("bladee"));
    assert!(matches!(error, Err(UrdfError::AttachLinkUnknown { field: "child_link", .. })));
}

#[test]
fn refusals() {
    let files = TempFiles::default();
    let part = |name: &str| ComponentCfg::new(name, arm(&files));
    let under = |name: &str, parent: &str| ComponentCfg { parent: Some(parent.to_owned()), ..part(name) };
    let link = ComponentCfg { parent_link: Some("x".to_owned()), ..part("arm") };
    let nan = ComponentCfg { transform: Pose::translation(f64::NAN, 0.0, 0.0), ..part("arm") };
    let rows: [(Vec<ComponentCfg>, &str, &[&str]); 10] = [
        (vec![], "NoComponents", &[]),
        (vec![part("arm"), part("arm")], "ComponentRepeated", &["\"arm\""]),
        (vec![part("arm"), under("hand", "Arm")], "ComponentUnknown", &["candidates: \"arm\""]),
        (vec![part("arm"), part("camera")], "ComponentParentRequired", &["set its parent"]),
        (vec![part("arm"), under("a", "b"), under("b", "a")], "ComponentCycle", &["\"a\" -> \"b\" -> \"a\""]),
        (vec![under("a", "a")], "ComponentCycle", &[]),
        (vec![link], "ParentLinkWithoutParent", &[]),
        (vec![nan], "ComponentInvalid", &["not finite"]),
        (vec![part(" ")], "ComponentInvalid", &[]),
        (vec![ComponentCfg::new("arm", "no/such.urdf")], "FileMissing", &[]),
    ];
    for (components, kind, parts) in rows {
        assert_error(assemble(&cfg(components)), kind, parts);
    }
}

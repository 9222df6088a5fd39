//! Invalid URDF files: each gives a typed error that names the place, the element, and the correct form.

use kinetoscope::robot::diagnostic::DiagnosticKind;
use kinetoscope::robot::urdf::{
    Strictness, UrdfCfg, UrdfError, UrdfFile, assemble, parse_file, parse_str, parse_str_with,
};
use kinetoscope_testkit::error_tables::assert_errors;
use kinetoscope_testkit::urdf::TempFiles;
use std::path::Path;

fn parse(text: &str) -> Result<UrdfFile, UrdfError> {
    parse_str(text, Path::new("robot.urdf"))
}

fn parse_strictly(text: &str) -> Result<UrdfFile, UrdfError> {
    parse_str_with(text, Path::new("robot.urdf"), Strictness::Strict)
}

/// A robot with the links `a` and `b` and `body` in line 2.
fn robot(body: &str) -> String {
    format!("<robot name=\"r\">\n{body}\n<link name=\"a\"/><link name=\"b\"/></robot>")
}

/// A joint from `a` to `b` in line 2.
fn joint(attributes: &str, body: &str) -> String {
    robot(&format!("<joint name=\"j\" {attributes}>{body}<parent link=\"a\"/><child link=\"b\"/></joint>"))
}

fn revolute(body: &str) -> String {
    joint("type=\"revolute\"", body)
}

/// A robot with one link `l` with its content in line 2.
fn link(body: &str) -> String {
    format!("<robot name=\"r\"><link name=\"l\">\n{body}\n</link></robot>")
}

fn shape(geometry: &str) -> String {
    link(&format!("<visual><geometry>{geometry}</geometry></visual>"))
}

fn visual(material: &str) -> String {
    format!("<visual><geometry><sphere radius=\"1\"/></geometry>{material}</visual>")
}

const INERTIA: &str = "<inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/>";
const LIMIT: &str = "<limit lower=\"-1\" upper=\"1\" effort=\"5\" velocity=\"1\"/>";

#[test]
fn mistakes() {
    let three = |tail: &str| {
        format!(
            "<robot name=\"r\">\n<joint name=\"j1\" type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint>\n\
             {tail}\n<link name=\"a\"/><link name=\"b\"/><link name=\"c\"/></robot>"
        )
    };
    let mimic = |one: &str, two: &str| {
        let joint = |name: &str, parent: &str, child: &str, follows: &str| {
            let mimic = if follows.is_empty() { String::new() } else { format!("<mimic joint=\"{follows}\"/>") };
            format!(
                "<joint name=\"{name}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{child}\"/>{LIMIT}\
                 {mimic}</joint>"
            )
        };
        format!(
            "<robot name=\"r\">\n{}\n{}\n<link name=\"a\"/><link name=\"b\"/><link name=\"c\"/></robot>",
            joint("j1", "a", "b", one),
            joint("j2", "b", "c", two)
        )
    };
    let origin = |o: &str| link(&format!("<visual><origin {o}/><geometry><sphere radius=\"1\"/></geometry></visual>"));
    let inertial = |i: &str| link(&format!("<inertial>{i}</inertial>"));
    let mass = |m: &str| inertial(&format!("<mass value=\"{m}\"/>{INERTIA}"));

    let cases: Vec<(&str, String, &str, &[&'static str])> = vec![
        // Numbers.
        ("word", origin("xyz=\"1 x 2\""), "Number", &["robot.urdf:2: <origin xyz=\"1 x 2\">: \"x\" is not a number; xyz needs three numbers, such as \"0 0 0.1\""]),
        ("too few", origin("xyz=\"1 2\""), "Number", &[":2:", "there are two; xyz needs three"]),
        ("too many", origin("rpy=\"1 2 3 4\""), "Number", &[":2:", "<origin rpy=\"1 2 3 4\">", "there are four"]),
        ("none", origin("xyz=\"\""), "Number", &[":2:", "there are no; xyz needs three"]),
        ("comma", origin("xyz=\"1,5 0 0\""), "Number", &["\"1,5\" is not a number (use a decimal point"]),
        ("nan", origin("xyz=\"0 nan 0\""), "Number", &[":2:", "\"nan\" is not finite"]),
        ("inf", origin("rpy=\"0 0 inf\""), "Number", &["\"inf\" is not finite"]),
        ("overflow", origin("rpy=\"0 0 1e999\""), "Number", &["\"1e999\" is not finite"]),
        ("mass word", mass("heavy"), "Number", &["<mass value=\"heavy\">", "value needs one number"]),
        ("limit word", revolute("<limit lower=\"low\"/>"), "Number", &[":2: <limit lower=\"low\">"]),
        ("both rotations", origin("rpy=\"0 0 0\" quat_xyzw=\"0 0 0 1\""), "Value", &["quat_xyzw and rpy"]),
        ("zero quaternion", origin("quat_xyzw=\"0 0 0 0\""), "Value", &["0 0 0 1"]),
        // Mass.
        ("negative mass", mass("-1"), "Value", &["robot.urdf:2: link \"l\": <mass value=\"-1\">: value is negative"]),
        ("nan mass", mass("NaN"), "Number", &[":2:", "not finite"]),
        ("no mass", inertial(INERTIA), "ElementMissing", &[":2: link \"l\": <inertial> has no <mass>", "<mass value="]),
        ("no inertia", inertial("<mass value=\"1\"/>"), "ElementMissing", &["has no <inertia>", "<inertia ixx="]),
        ("no mass value", inertial(&format!("<mass/>{INERTIA}")), "AttributeMissing", &["<mass> has no value"]),
        ("no iyy", inertial("<mass value=\"1\"/><inertia ixx=\"1\"/>"), "AttributeMissing", &["<inertia> has no iyy"]),
        ("two inertials", inertial(&format!("<mass value=\"1\"/>{INERTIA}</inertial><inertial>")), "ElementRepeated", &[":2: link \"l\": a second <inertial>, the first is at robot.urdf:2"]),
        // Shapes.
        ("box", shape("<box size=\"1 0 1\"/>"), "Value", &["<box size=\"1 0 1\">", "positive"]),
        ("sphere", shape("<sphere radius=\"-1\"/>"), "Value", &["radius must be positive"]),
        ("cylinder", shape("<cylinder radius=\"1\" length=\"0\"/>"), "Value", &["length must be positive"]),
        ("no radius", shape("<cylinder length=\"1\"/>"), "AttributeMissing", &["<cylinder> has no radius"]),
        ("shape", shape("<cilinder/>"), "ShapeUnknown", &["unknown shape <cilinder>", "candidates: \"cylinder\""]),
        ("two shapes", shape("<box size=\"1 1 1\"/><sphere radius=\"1\"/>"), "GeometryRepeated", &[":2: link \"l\": <geometry> must contain one shape, but <sphere> is its second element"]),
        ("no shape", shape(""), "ElementMissing", &["<sphere>"]),
        ("no geometry", link("<collision/>"), "ElementMissing", &["<collision> has no <geometry>"]),
        ("mesh name", shape("<mesh filename=\" \"/>"), "MeshUnnamed", &[":2: link \"l\"", "meshes/part.stl"]),
        ("no mesh name", shape("<mesh/>"), "AttributeMissing", &["<mesh> has no filename"]),
        ("scale", shape("<mesh filename=\"a\" scale=\"0.001\"/>"), "Number", &["there is one", "0.001 0.001 0.001"]),
        ("zero scale", shape("<mesh filename=\"a\" scale=\"1 0 1\"/>"), "Value", &["scale must not be zero"]),
        // Names.
        ("unnamed link", "<robot name=\"r\">\n<link/></robot>".to_owned(), "AttributeMissing", &[":2:", "<link> has no name"]),
        ("control character", "<robot><link name=\"a&#1;\"/></robot>".to_owned(), "Xml", &["robot.urdf:1: column"]),
        ("line break in name", "<robot><link name=\"a&#10;b\"/></robot>".to_owned(), "Value", &["control character"]),
        ("duplicate link", robot("<link name=\"a\"/>"), "NameRepeated", &["robot.urdf:3: a second link named \"a\", the first is at robot.urdf:2"]),
        ("duplicate joint", three("<joint name=\"j1\" type=\"fixed\"><parent link=\"b\"/><child link=\"c\"/></joint>"), "NameRepeated", &["robot.urdf:3: a second joint named \"j1\"", "robot.urdf:2"]),
        ("materials", robot("<material name=\"m\"><color rgba=\"1 1 1 1\"/></material><material name=\"m\"><color rgba=\"0 0 0 1\"/></material>"), "NameRepeated", &["material", "\"m\""]),
        // The tree.
        ("no links", "<robot name=\"r\">\n</robot>".to_owned(), "NoLinks", &["robot.urdf:1", "<link>"]),
        ("no parent", "<robot>\n<joint name=\"j\" type=\"fixed\"><child link=\"b\"/></joint></robot>".to_owned(), "ElementMissing", &[":2: joint \"j\": <joint> has no <parent>"]),
        ("unnamed parent", robot("<joint name=\"j\" type=\"fixed\"><parent/><child link=\"b\"/></joint>"), "AttributeMissing", &["<parent> has no link"]),
        ("dangling parent", robot("<joint name=\"j\" type=\"fixed\"><parent link=\"A\"/><child link=\"b\"/></joint>"), "LinkUnknown", &["robot.urdf:2: joint \"j\": parent link \"A\" does not exist; candidates: \"a\", \"b\""]),
        ("dangling child", robot("<joint name=\"j\" type=\"fixed\"><parent link=\"a\"/>\n<child link=\"bb\"/></joint>"), "LinkUnknown", &["robot.urdf:3: joint \"j\": child link \"bb\"", "\"b\""]),
        ("two parents", three("<joint name=\"j2\" type=\"fixed\"><parent link=\"c\"/><child link=\"b\"/></joint>"), "MultipleParents", &["robot.urdf:3: joint \"j2\" has child \"b\"", "\"j1\" at robot.urdf:2"]),
        ("cycle", three("<joint name=\"j2\" type=\"fixed\"><parent link=\"b\"/><child link=\"a\"/></joint>"), "Cycle", &["robot.urdf:2: joint \"j1\" closes a kinematic loop: \"b\" -> \"a\" -> \"b\""]),
        ("own parent", robot("<joint name=\"j\" type=\"fixed\"><parent link=\"b\"/><child link=\"b\"/></joint>"), "Cycle", &["\"b\" -> \"b\""]),
        ("no root", "<robot>\n<link name=\"a\"/><joint name=\"j\" type=\"fixed\"><parent link=\"a\"/><child link=\"a\"/></joint></robot>".to_owned(), "Cycle", &[":2: joint \"j\""]),
        ("several roots", robot(""), "MultipleRoots", &["2 links have no parent joint", "\"a\" (robot.urdf:3), \"b\" (robot.urdf:3)"]),
        // Joints.
        ("joint type", joint("type=\"revolut\"", ""), "JointTypeUnknown", &["robot.urdf:2: joint \"j\": unknown type \"revolut\"; candidates: \"revolute\""]),
        ("spherical", joint("type=\"spherical\"", ""), "JointTypeUnknown", &["\"spherical\""]),
        ("no type", joint("", ""), "AttributeMissing", &["joint \"j\": <joint> has no type"]),
        ("no limit", revolute(""), "LimitMissing", &["robot.urdf:2: joint \"j\" is revolute and has no <limit>; add <limit lower=", "continuous"]),
        ("no limit 2", joint("type=\"prismatic\"", ""), "LimitMissing", &["prismatic"]),
        ("effort", revolute("<limit effort=\"-1\"/>"), "Value", &["effort must not be negative"]),
        ("velocity", revolute("<limit velocity=\"-1\"/>"), "Value", &["velocity must not be negative"]),
        ("damping", revolute(&format!("{LIMIT}<dynamics damping=\"-1\"/>")), "Value", &["damping must not be negative"]),
        ("zero axis", revolute(&format!("{LIMIT}<axis xyz=\"0 0 0\"/>")), "Value", &[":2: joint \"j\": <axis xyz=\"0 0 0\">", "0 0 1"]),
        ("no axis, fixed", joint("type=\"fixed\"", "<axis/>"), "AttributeMissing", &["<axis> has no xyz"]),
        ("two axes", revolute(&format!("{LIMIT}<axis xyz=\"0 0 1\"/><axis xyz=\"0 0 1\"/>")), "ElementRepeated", &[":2: joint \"j\": a second <axis>"]),
        ("two materials", link(&visual("<material name=\"\"/><material name=\"\"/>")), "ElementRepeated", &[":2: link \"l\": a second <material>"]),
        ("no axis", revolute(&format!("{LIMIT}<axis/>")), "AttributeMissing", &["<axis> has no xyz"]),
        ("mimic missing", mimic("", "jX"), "MimicUnknown", &["robot.urdf:3: joint \"j2\" mimics \"jX\", which does not exist; candidates: \"j1\""]),
        ("mimic itself", mimic("", "j2"), "MimicCycle", &["robot.urdf:3: joint \"j2\" mimics itself: \"j2\" -> \"j2\""]),
        ("mimic circle", mimic("j2", "j1"), "MimicCycle", &["robot.urdf:2: joint \"j1\" mimics itself: \"j1\" -> \"j2\" -> \"j1\""]),
        // Documents.
        ("empty", String::new(), "FileEmpty", &["robot.urdf: is empty", "<robot name="]),
        ("blank", " \n\u{feff}".to_owned(), "Xml", &["robot.urdf:"]),
        ("bom only", "\u{feff}\n".to_owned(), "FileEmpty", &["is empty"]),
        ("unclosed", "<robot>\n<link name=\"a\">".to_owned(), "Xml", &["robot.urdf:2: column"]),
        ("wrong tag", "<robot>\n<link name=\"a\"></lnk></robot>".to_owned(), "Xml", &["robot.urdf:2: column 16"]),
        ("attribute twice", "<robot>\n<link name=\"a\" name=\"b\"/></robot>".to_owned(), "Xml", &["robot.urdf:2"]),
        ("mjcf", "\n<mujoco/>".to_owned(), "WrongRoot", &["robot.urdf:2: the root element is <mujoco>", "MJCF"]),
        ("sdf", "<sdf/>".to_owned(), "WrongRoot", &["<sdf>", "URDF"]),
        ("other root", "<Robot/>".to_owned(), "WrongRoot", &["<Robot>", "<robot name="]),
        ("xacro element", "<robot xmlns:xacro=\"http://wiki.ros.org/xacro\">\n<xacro:macro name=\"m\"/></robot>".to_owned(), "Xacro", &["robot.urdf:2: <xacro:macro>", "xacro file.xacro > file.urdf"]),
        ("xacro unbound", "<robot>\n<xacro:macro name=\"m\"/></robot>".to_owned(), "Xacro", &["robot.urdf:2", "xacro file.xacro"]),
        ("xacro expression", origin("xyz=\"0 0 ${h}\""), "Xacro", &["robot.urdf:2: <origin xyz=\"0 0 ${h}\">"]),
        ("xacro in a link", link("<xacro:inertia mass=\"1\"/>").replace("<robot", "<robot xmlns:xacro=\"http://wiki.ros.org/xacro\""), "Xacro", &["robot.urdf:2: <xacro:inertia>"]),
        ("prefix", link("<drake:joint/>"), "Xml", &["robot.urdf:2: column 2", "drake"]),
        ("declaration", "\n<?xml version=\"1.0\"?>\n<robot><link name=\"a\"/></robot>".to_owned(), "Xml", &["robot.urdf:2", "declaration"]),
        ("doctype", "<?xml version=\"1.0\"?>\n<!DOCTYPE robot SYSTEM \"file:///etc/passwd\"><robot/>".to_owned(), "Doctype", &["robot.urdf:2", "<!DOCTYPE>"]),
        ("bomb", format!("<!DOCTYPE z [<!ENTITY a \"{}\"><!ENTITY b \"&a;&a;&a;&a;\">]><robot name=\"&b;\"/>", "x".repeat(1000)), "Doctype", &["robot.urdf:1"]),
        ("entity", "<robot name=\"&undefined;\"/>".to_owned(), "Xml", &["robot.urdf:1: column"]),
    ];
    let named = |needles: &[&'static str]| [needles, &["robot.urdf"]].concat();
    assert_errors(cases.iter().map(|(what, text, kind, needles)| (what, parse_strictly(text), kind, named(needles))));
}

#[test]
fn unreadable_files() {
    let files = TempFiles::default();
    files.write("arm.urdf", "<robot/>");
    type Row<'a> = (&'a str, Option<&'a [u8]>, &'a str, &'a [&'a str]);
    let rows: [Row<'_>; 5] = [
        ("nothing.urdf", None, "FileMissing", &["nothing.urdf"]),
        (".", None, "FileIsFolder", &["arm.urdf"]),
        ("latin1.urdf", Some(b"<robot>\n<link name=\"\xe9\"/></robot>"), "Encoding", &["latin1.urdf:2: byte 0xe9"]),
        ("utf16.urdf", Some(b"\xff\xfe<\0r\0"), "Encoding", &["UTF-16", "UTF-8"]),
        ("empty.urdf", Some(b""), "FileEmpty", &[]),
    ];
    let read = |name: &str, content: Option<&[u8]>| {
        parse_file(content.map_or_else(|| files.folder().join(name), |content| files.write(name, content)))
    };
    assert_errors(rows.map(|(name, content, kind, needles)| (name, read(name, content), kind, needles)));
    let bom = files.write("bom.urdf", b"\xef\xbb\xbf<robot name=\"r\"><link name=\"a\"/></robot>");
    assert!(parse_file(&bom).is_ok());
}

#[test]
fn missing_meshes() {
    let files = TempFiles::default();
    let assemble_with = |element: &str, uri: &str| {
        let mesh = format!("<{element}><geometry><mesh filename=\"{uri}\"/></geometry></{element}>");
        assemble(&UrdfCfg::single(files.write("robot.urdf", link(&mesh))))
    };
    let unknown = &["package \"not_there\"", "UrdfCfg::packages", "searched:"];
    let rows: [(&str, &str, &[&str]); 5] = [
        ("meshes/a.stl", "MeshMissing", &["meshes/a.stl\" does not exist; searched:\n"]),
        ("../../../b.stl", "MeshMissing", &["b.stl"]),
        ("package://not_there/c.stl", "PackageUnknown", unknown),
        ("https://example.com/d.stl", "UriUnsupported", &["https:// is not supported; use package://"]),
        ("package://x", "UriUnsupported", &["package://name_of_package/"]),
    ];
    for (uri, kind, needles) in rows {
        let needles = [needles, &["robot.urdf:2: link \"l\":"]].concat();
        assert_errors([(uri, assemble_with("collision", uri), kind, needles)]);
        let diagnostics = assemble_with("visual", uri).expect(uri).diagnostics;
        assert_eq!(diagnostics.len(), 1);
        assert_eq!(diagnostics[0].kind, DiagnosticKind::VisualMeshMissing);
        let warning = diagnostics[0].to_string();
        assert!(warning.contains("robot.urdf:2: link \"l\": visual mesh"), "{warning}");
    }
}

#[test]
fn warnings() {
    use DiagnosticKind::*;
    let looks = |materials: &str| {
        let visual = "<visual><geometry><box size=\"1 1 1\"/></geometry><material name=\"m\"/></visual>";
        format!("<robot>{materials}<link name=\"l\">{visual}{visual}</link></robot>")
    };
    let grey = "<material name=\"m\"><color rgba=\"1 1 1 1\"/></material>";
    let fixed = |body: &str| joint("type=\"fixed\"", body);
    let with = |body: &str| fixed("").replacen('\n', &format!("\n{body}"), 1);
    let transmission = |name: &str| with(&format!("<transmission name=\"t\"><joint name=\"{name}\"/></transmission>"));
    let axis = |xyz: &str| revolute(&format!("{LIMIT}<axis xyz=\"{xyz}\"/>"));
    let rows: &[(String, &[DiagnosticKind])] = &[
        (revolute("<limit />"), &[EffortUnlimited]),
        (revolute("<limit effort=\"0\"/>"), &[EffortUnlimited]),
        (joint("type=\"continuous\"", ""), &[EffortUnlimited]),
        (fixed(""), &[]),
        (joint("type=\"floating\"", ""), &[]),
        (joint("type=\"planar\"", ""), &[]),
        // Exporters write a zero axis and a limit for fixed joints.
        (fixed("<axis xyz=\"0 0 0\"/><limit effort=\"0\"/>"), &[]),
        (axis("0 0 1.0001"), &[]),
        (axis("0 0 1e300"), &[AxisNormalized]),
        (with("<sensors/>"), &[ElementIgnored]),
        (with("<gazebo reference=\"a\"/><mujoco/><ros2_control/>"), &[]),
        (transmission("j"), &[]),
        (fixed("<mimic joint=\"j\"/>"), &[ElementIgnored]),
        (looks(""), &[MaterialUndefined]),
        (looks(&format!("{grey}{grey}")), &[]),
        (looks(&grey.replace("1 1 1 1", "255 0 0 1")), &[ColorClamped]),
    ];
    for (text, expected) in rows {
        let kinds: Vec<_> = parse(text).unwrap().diagnostics.iter().map(|d| d.kind).collect();
        assert_eq!(kinds, *expected, "{text}");
    }
    let file = parse(&revolute("\n<limit lower=\"1\" upper=\"-1\" effort=\"5\" velocity=\"2\"/>")).unwrap();
    assert_eq!(file.diagnostics[0].kind, LimitIgnored);
    assert!(file.diagnostics[0].to_string().starts_with("robot.urdf:3: joint \"j\": lower limit 1 is above"));
    let limit = file.joints[0].limit.as_ref().unwrap();
    assert!(!limit.lower && !limit.upper && limit.effort && limit.velocity);
    let file = parse(&axis("0 3 4")).unwrap();
    assert_eq!(file.diagnostics[0].kind, AxisNormalized);
    assert_eq!(file.robot.joints[0].axis.xyz.0, [0.0, 0.6, 0.8]);
    let file = parse(&transmission("jj")).unwrap();
    assert_eq!(file.diagnostics[0].kind, ReferenceUnknown);
    assert!(file.diagnostics[0].message.contains("<transmission name=\"t\"> names joint \"jj\""));
    let file = parse(&link("<colision/><self_filter/>")).unwrap();
    assert_eq!(file.diagnostics.len(), 1);
    assert!(file.diagnostics[0].message.contains("<colision> is not read and was ignored (<collision>?)"));
}

/// Lenient reading of deviations from URDF with a clear meaning. Pinocchio, pybullet and MuJoCo read them: Unitree's
/// Go2 has two materials in a visual, Upkie a box of size 0, and so on. Each gives one warning with its place. In
/// strict reading (the control), each gives an error with the same message.
#[test]
fn lenient_reading() {
    use DiagnosticKind::*;
    let with = |robot: String, namespace: &str| robot.replacen("<robot", &format!("<robot {namespace}"), 1);
    let xacro = "xmlns:xacro=\"http://wiki.ros.org/xacro\"";
    let red = "<material name=\"\"><color rgba=\"1 0 0 1\"/></material>";
    let inertial = |i: &str| link(&format!("<inertial>{i}</inertial>"));
    let rows: Vec<(&str, String, DiagnosticKind, &[&str])> = vec![
        (
            "two materials",
            link(&visual(&format!("{red}<material name=\"blue\"/>"))),
            ElementRepeated,
            &["robot.urdf:2: link \"l\": a second <material>", "the first is used"],
        ),
        (
            "two inertials",
            inertial(&format!("<mass value=\"1\"/>{INERTIA}</inertial><inertial>")),
            ElementRepeated,
            &[":2: link \"l\": a second <inertial>"],
        ),
        (
            "two axes",
            revolute(&format!("{LIMIT}<axis xyz=\"0 0 1\"/><axis xyz=\"1 0 0\"/>")),
            ElementRepeated,
            &[":2: joint \"j\": a second <axis>"],
        ),
        (
            "two limits",
            revolute(&format!("{LIMIT}{LIMIT}<axis xyz=\"0 0 1\"/>")),
            ElementRepeated,
            &[":2: joint \"j\": a second <limit>", "the first is used"],
        ),
        (
            "a visual without geometry",
            link("<visual/>"),
            ShapeEmpty,
            &[":2: link \"l\": <visual> has no <geometry>", "the visual is left out"],
        ),
        (
            "a visual without a shape",
            link("<visual><geometry/></visual>"),
            ShapeEmpty,
            &[":2: link \"l\": <geometry> has no <box>", "the visual is left out"],
        ),
        (
            "no products of inertia",
            inertial("<mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\"/>"),
            InertialIncomplete,
            &["ixy", "missing products of inertia are 0"],
        ),
        (
            "commas",
            link(&visual("<material name=\"\"><color rgba=\"1, 0, 0, 1\"/></material>")),
            CommasIgnored,
            &["robot.urdf:2: the commas in \"1, 0, 0, 1\" were ignored"],
        ),
        (
            "material in a geometry",
            shape("<box size=\"1 1 1\"/><material name=\"m\"/>"),
            ElementRepeated,
            &["<material> is its second element, the first is at robot.urdf:2"],
        ),
        (
            "box",
            shape("<box size=\"0 0 0\"/>"),
            ShapeEmpty,
            &[":2: link \"l\": <box size=\"0 0 0\">: size must be positive", "the shape is left out"],
        ),
        ("sphere", shape("<sphere radius=\"0.0\"/>"), ShapeEmpty, &["radius must be positive"]),
        (
            "cylinder",
            link("<collision><geometry><cylinder radius=\"1\" length=\"0\"/></geometry></collision>"),
            ShapeEmpty,
            &["length must be positive"],
        ),
        ("prefix", link("<drake:joint/>"), NamespaceUnbound, &["robot.urdf:2: the XML prefix \"drake\""]),
        (
            "prefix of an attribute",
            link("<visual sensor:a=\"b\"><geometry><sphere radius=\"1\"/></geometry></visual>"),
            NamespaceUnbound,
            &["robot.urdf:2: the XML prefix \"sensor\""],
        ),
        (
            "xacro in a link",
            with(link("<xacro:inertia><xacro:inner/></xacro:inertia>"), xacro),
            XacroLeftover,
            &["robot.urdf:2: <xacro:inertia> is xacro", "inside <link>"],
        ),
        (
            "xacro in gazebo",
            with(
                robot(
                    "<gazebo><xacro:sensor/></gazebo><joint name=\"j\" type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint>",
                ),
                xacro,
            ),
            XacroLeftover,
            &["<xacro:sensor>", "inside <gazebo>"],
        ),
        (
            "declaration",
            "\n<?xml version=\"1.0\"?>\n<robot><link name=\"a\"/></robot>".to_owned(),
            DeclarationMisplaced,
            &["robot.urdf:2:"],
        ),
        (
            "declaration after a comment",
            "<!-- c -->\n\n<?xml version=\"1.0\"\n?><robot><link name=\"a\"/></robot>".to_owned(),
            DeclarationMisplaced,
            &["robot.urdf:3:"],
        ),
        (
            "no inertia",
            inertial("<mass value=\"1\"/>"),
            InertialIncomplete,
            &["link \"l\": <inertial> has no <inertia>", "the inertia is computed from the link's shapes"],
        ),
        (
            "no mass",
            inertial(INERTIA),
            InertialIncomplete,
            &["<inertial> has no <mass>", "the mass is computed from the link's shapes"],
        ),
        (
            "density",
            inertial("<density value=\"7800\"/>"),
            InertialIncomplete,
            &["mass and inertia are computed from the link's shapes"],
        ),
        (
            "axis",
            joint("type=\"fixed\"", "<axis/>"),
            ElementIgnored,
            &["joint \"j\": <axis> has no xyz", "a fixed joint needs no axis"],
        ),
        (
            "scale",
            shape("<mesh filename=\"a\" scale=\"0.001\"/>"),
            ScaleUniform,
            &["there is one", "the value is used for all three axes"],
        ),
    ];
    for (what, text, kind, needles) in rows {
        let file = parse(&text).unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_eq!(file.diagnostics.iter().map(|d| d.kind).collect::<Vec<_>>(), [kind], "{what}");
        let warning = file.diagnostics[0].to_string();
        assert!(needles.iter().all(|needle| warning.contains(needle)), "{what}: {warning}");
        let error = parse_strictly(&text).err().unwrap_or_else(|| panic!("{what} is read strictly")).to_string();
        if !matches!(kind, NamespaceUnbound | DeclarationMisplaced | CommasIgnored) {
            assert!(warning.starts_with(&error), "{what}: {warning:?} does not begin with {error:?}");
        }
    }

    let read = |body: String| parse(&body).unwrap();
    // NUL characters at the end, as in pybullet's humanoid. A decimal comma and the commas of a comment stay.
    let file = read(format!("{}\n\0\0", link("<!-- <a b=\"1, 2\"/> -->")));
    assert!(file.diagnostics.len() == 1 && file.diagnostics[0].to_string().contains("NUL"), "{:?}", file.diagnostics);
    assert!(parse_strictly(&format!("{}\0", link(""))).is_err());
    for scale in ["1,2,3", "1 ,2 , 3", "1, 2, 3,"] {
        let mesh = format!("<visual><geometry><mesh filename=\"a\" scale=\"{scale}\"/></geometry></visual>");
        let file = read(link(&format!("{mesh}{mesh}")));
        assert_eq!(file.diagnostics.len(), 1, "{scale}: one warning for the file: {:?}", file.diagnostics);
        assert!(file.diagnostics[0].message.contains("and in 1 other lists"), "{scale}: {:?}", file.diagnostics);
    }
    let decimal = parse(&link("<visual><origin xyz=\"0,5 0 0\"/></visual>")).unwrap_err().to_string();
    assert!(decimal.contains("use a decimal point and spaces"), "{decimal}");
    let file = read(inertial("<mass value=\"1\"/><inertia ixx=\"1\" iyy=\"2\" izz=\"3\"/>"));
    assert_eq!(file.robot.links[0].inertial.inertia.iyy, 2.0);
    let file = read(link(&visual(&format!("{red}{}", red.replace("1 0 0", "0 0 1")))));
    assert_eq!(
        file.robot.links[0].visual[0].material.as_ref().unwrap().color.as_ref().unwrap().rgba.0,
        [1., 0., 0., 1.]
    );
    let empty = "<visual><geometry><box size=\"1 0 1\"/></geometry></visual>";
    let file = read(link(&format!("{empty}{}{empty}", visual(red))));
    assert_eq!((file.robot.links[0].visual.len(), file.links[0].visuals.len()), (1, 1));
    let file = read(revolute(&format!("{LIMIT}<axis xyz=\"0 0 1\"/><axis xyz=\"1 0 0\"/><axis xyz=\"0 1 0\"/>")));
    assert_eq!((file.robot.joints[0].axis.xyz.0, file.diagnostics.len()), ([0., 0., 1.], 2));
    let file = read(inertial("<origin xyz=\"1 2 3\"/><density value=\"7800\"/>"));
    let partial = file.links[0].partial_inertial.as_ref().unwrap();
    assert!(file.links[0].inertial.is_none() && partial.mass.is_none() && partial.inertia.is_none());
    assert_eq!((partial.density, partial.link_from_com.unwrap().translation.vector.z), (Some(7800.0), 3.0));
    // The repair of a text does not move the places of later elements; an error in a repaired line names its column.
    let text =
        "<!-- c -->\n<?xml version=\"1.0\"?><robot drake:a=\"b\">\n<link name=\"l\"><b:c/><collision/></link></robot>";
    let error = parse(text).unwrap_err().to_string();
    assert!(error.starts_with("robot.urdf:3: link \"l\": <collision> has no <geometry>"), "{error}");
    assert!(
        parse("<robot a:b=\"c\"><link name=\"l\"></robot>")
            .unwrap_err()
            .to_string()
            .starts_with("robot.urdf:1: column")
    );
    // Several XML declarations, with multi-byte characters.
    let file =
        read("\n<?xml é?>\n<!-- ü --><?xml üü?>\n<?xml é?><robot a:b=\"c\"><link name=\"l\"/></robot>".to_owned());
    let places = |d: &kinetoscope::robot::diagnostic::Diagnostic| (d.kind, d.source.as_ref().unwrap().line);
    let expected =
        [(DeclarationMisplaced, 2), (DeclarationMisplaced, 3), (DeclarationMisplaced, 4), (NamespaceUnbound, 4)];
    assert_eq!(file.diagnostics.iter().map(places).collect::<Vec<_>>(), expected);
    // Controls: deviations without a clear meaning.
    let rows = [
        ("negative size", shape("<box size=\"0 -1 1\"/>"), "Value", "positive"),
        ("four scales", shape("<mesh filename=\"a\" scale=\"1 1 1 1\"/>"), "Number", "there are four"),
        (
            "two origins",
            link("<visual><origin/><origin/><geometry><sphere radius=\"1\"/></geometry></visual>"),
            "ElementRepeated",
            "<origin>",
        ),
        (
            "xacro at the top",
            "<robot>\n<xacro:include filename=\"a\"/><link name=\"a\"/></robot>".to_owned(),
            "Xacro",
            "robot.urdf:2",
        ),
        ("axis of a hinge", revolute(&format!("{LIMIT}<axis/>")), "AttributeMissing", "xyz"),
        ("no density", inertial("<density value=\"0\"/>"), "Value", "kg/m³"),
        ("many prefixes", link(&(0..40).map(|i| format!("<p{i}:a/>")).collect::<String>()), "Xml", "robot.urdf:2"),
    ];
    assert_errors(rows.map(|(what, text, kind, needle)| (what, parse(&text), kind, [needle, "robot.urdf"])));
}

#[test]
fn absent_or_zero() {
    let file = parse(&revolute("<limit lower=\"0\" effort=\"0\"/>")).unwrap();
    let limit = file.joints[0].limit.as_ref().unwrap();
    assert!(limit.lower && !limit.upper && limit.effort && !limit.velocity);
    assert!(file.links.iter().all(|l| l.inertial.is_none()));
    assert!(file.joints[0].mimic.is_none() && !file.joints[0].damping);
    let file = parse(&link("\n<inertial><mass value=\"0\"/><inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/></inertial>")).unwrap();
    assert_eq!(file.links[0].inertial.as_ref().unwrap().line, 3);
}

#[test]
fn namespaces_comments_capsules() {
    let text = "<?xml version=\"1.0\"?>\n<!-- c --><robot name=\"r &amp; s\" xmlns=\"http://ros.org\" xmlns:xacro=\"http://xacro\" \
                xmlns:g=\"http://g\" version=\"1.1\"><g:link/><link name=\"a&lt;'&quot;\"><!-- c --><visual>\
                <origin quat_xyzw=\"0 0 1 1\"/><geometry><capsule radius=\".5\" length=\"+1.\"/></geometry></visual></link></robot>";
    let file = parse(text).unwrap();
    assert_eq!((file.robot.name.as_str(), file.robot.links[0].name.as_str()), ("r & s", "a<'\""));
    assert!((file.robot.links[0].visual[0].origin.rpy[2] - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
    assert!(file.diagnostics.is_empty());
}

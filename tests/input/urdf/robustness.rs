//! Hostile files: huge, deeply nested, truncated or damaged. The result is always a robot or an error, in bounded time,
//! and never a panic.

use kinetoscope::robot::description::JointId;
use kinetoscope::robot::urdf::{UrdfCfg, UrdfError, assemble, parse_file, parse_str, write_urdf};
use kinetoscope_testkit::urdf::TempFiles;
use std::fmt::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

const SMALL: &str = r#"<?xml version="1.0"?>
<robot name="small">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <mujoco><compiler meshdir="meshes"/></mujoco>
  <link name="base">
    <inertial><origin xyz="0 0 0.1"/><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <visual><geometry><mesh filename="package://p/base%20one.stl" scale="1 1 1"/></geometry><material name="grey"/></visual>
    <collision><origin rpy="0 1.5 0"/><geometry><cylinder radius="0.1" length="0.2"/></geometry></collision>
  </link>
  <link name="tip é"/>
  <joint name="j" type="revolute">
    <parent link="base"/><child link="tip é"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="10" velocity="2"/><dynamics damping="0.1" friction="0"/>
  </joint>
  <transmission name="t"><joint name="j"/></transmission>
</robot>
"#;

fn parse_bytes(bytes: &[u8], files: &TempFiles) -> bool {
    match std::str::from_utf8(bytes) {
        Ok(text) => parse_str(text, Path::new("robot.urdf")).is_ok(),
        Err(_) => {
            let error = parse_file(files.write("robot.urdf", bytes)).unwrap_err();
            assert!(matches!(error, UrdfError::Encoding { .. }), "{error}");
            false
        }
    }
}

#[test]
fn prefixes() {
    let files = TempFiles::default();
    let whole = SMALL.trim_end().len();
    for end in 0..SMALL.len() {
        assert_eq!(parse_bytes(&SMALL.as_bytes()[..end], &files), end >= whole, "prefix of {end} bytes");
    }
}

#[test]
fn damaged_bytes() {
    let files = TempFiles::default();
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = move |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % below as u64) as usize
    };
    let interesting = b"<>\"'&;/=- \n0.e9\x00\xff\xc3xn#";
    let mut readable = 0;
    for _ in 0..6000 {
        let mut bytes = SMALL.as_bytes().to_vec();
        for _ in 0..=random(3) {
            let at = random(bytes.len());
            match random(4) {
                0 => bytes[at] ^= 1 << random(8),
                1 => bytes[at] = interesting[random(interesting.len())],
                2 => drop(bytes.remove(at)),
                _ => bytes.insert(at, interesting[random(interesting.len())]),
            }
        }
        readable += usize::from(parse_bytes(&bytes, &files));
    }
    assert!(readable > 100, "only {readable} of the damaged files could be read: the damage is too coarse");
}

#[test]
fn long_chain() {
    let n = 200_000;
    let mut text = String::from("<robot name=\"chain\">\n<link name=\"l0\"/>\n");
    for i in 1..n {
        let (before, mimic) = (i - 1, if i > 1 { format!("<mimic joint=\"j{}\"/>", i - 1) } else { String::new() });
        let _ = writeln!(
            text,
            "<link name=\"l{i}\"/>\n<joint name=\"j{i}\" type=\"revolute\"><parent link=\"l{before}\"/>\
             <child link=\"l{i}\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/>{mimic}</joint>"
        );
    }
    text.push_str("</robot>");
    let files = TempFiles::default();
    let path = files.write("chain.urdf", &text);
    let start = Instant::now();
    let robot = assemble(&UrdfCfg::single(&path)).unwrap().description;
    assert_eq!((robot.links.len(), robot.joints[n - 2].source.line), (n, 2 * n as u32));
    assert_eq!(robot.mimic_driver(JointId(n - 2)).0, JointId(0));
    assert!(write_urdf(&robot).len() > text.len());
    assert!(start.elapsed() < Duration::from_secs(60), "{:?}", start.elapsed());

    // The same chain closed to a cycle: the cycle search must not recurse either.
    let circle = text.replace(
        "<link name=\"l0\"/>",
        "<link name=\"l0\"/><joint name=\"back\" type=\"fixed\"><parent link=\"l199999\"/><child link=\"l0\"/></joint>",
    );
    let start = Instant::now();
    let error = parse_str(&circle, Path::new("robot.urdf")).unwrap_err();
    assert!(matches!(error, UrdfError::Cycle { .. }) && error.to_string().len() < 400, "{error}");
    let circle = text.replace("<child link=\"l1\"/>", "<child link=\"l1\"/><mimic joint=\"j199999\"/>");
    assert!(matches!(parse_str(&circle, Path::new("r")), Err(UrdfError::MimicCycle { .. })));
    assert!(start.elapsed() < Duration::from_secs(60), "{:?}", start.elapsed());
}

#[test]
fn deep_nesting() {
    let n = 100_000;
    for (open, close) in [("<link name=\"a\">", "</link>"), ("<gazebo>", "</gazebo>"), ("<x>", "</x>")] {
        let text = format!("<robot name=\"r\"><link name=\"base\"/>{}{}</robot>", open.repeat(n), close.repeat(n));
        let result = parse_str(&text, Path::new("robot.urdf"));
        assert!(result.is_ok() || matches!(result, Err(UrdfError::MultipleRoots { .. })), "{:?}", result.err());
        let unclosed = format!("<robot name=\"r\">{}", open.repeat(n));
        assert!(matches!(parse_str(&unclosed, Path::new("robot.urdf")), Err(UrdfError::Xml { .. })));
    }
}

#[test]
fn large_elements() {
    let start = Instant::now();
    let shapes = "<visual><geometry><box size=\"1 1 1\"/></geometry></visual>\n".repeat(50_000);
    let file = parse_str(&format!("<robot><link name=\"l\">{shapes}</link></robot>"), Path::new("r")).unwrap();
    assert_eq!((file.links[0].visuals.len(), file.links[0].visuals[49_999].source.line), (50_000, 50_000));
    let long = "1 ".repeat(1_000_000);
    let text = format!("<robot><link name=\"l\"><visual><origin xyz=\"{long}\"/></visual></link></robot>");
    let error = parse_str(&text, Path::new("r")).unwrap_err().to_string();
    assert!(error.len() < 300 && error.contains("there are 1000000"), "{error}");
    let name = "n".repeat(1_000_000);
    let text = format!(
        "<robot><link name=\"a\"/><joint name=\"j\" type=\"fixed\"><parent link=\"{name}\"/><child link=\"a\"/></joint></robot>"
    );
    assert!(matches!(parse_str(&text, Path::new("r")), Err(UrdfError::LinkUnknown { .. })));
    assert!(start.elapsed() < Duration::from_secs(60), "{:?}", start.elapsed());
}

//! Files that are no robots: typed errors that name what is wrong and where, and nothing was added.

use super::{empty, robot};
use kinetoscope::prelude::*;
use kinetoscope::sim::mjcf::robot_file::RobotFileError;

/// The error of adding a robot.
fn refused(cfg: RobotCfg) -> Error {
    let mut sim = empty(1);
    let before = sim.mjcf().to_string();
    let error = sim.add_robot(cfg).unwrap_err();
    assert_eq!(sim.mjcf(), before, "nothing was added");
    error
}

/// What is wrong with a text.
fn reason(text: &str) -> (RobotFileError, String) {
    let error = refused(robot("r", text));
    let said = error.to_string();
    // The line first, where there is one.
    let lined = said.strip_prefix("text:").and_then(|rest| rest.split_once(": robot \"r\": "));
    let is_lined = lined.is_some_and(|(line, _)| line.parse::<usize>().is_ok());
    assert!(is_lined || said.starts_with("robot \"r\": text: "), "{said}");
    let Error::RobotFile { error, .. } = error else { panic!("{said}") };
    (*error, said)
}

#[test]
fn files_that_cannot_be_read() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| RobotCfg { mjcf: Some(MjcfFile::new(dir.path().join(name))), ..Default::default() };
    let error = refused(at("none.xml"));
    assert!(matches!(error, Error::File { .. }) && error.to_string().contains("none.xml"), "{error}");
    std::fs::write(
        dir.path().join("bad.xml"),
        "<mujoco>\n<worldbody>\n<body>\n<geom sise=\"1\"/></body></worldbody></mujoco>",
    )
    .unwrap();
    let said = refused(at("bad.xml")).to_string();
    assert!(["robot \"robot\"", "bad.xml", "sise", "line 4"].iter().all(|word| said.contains(word)), "{said}");
    std::fs::write(dir.path().join("torn.xml"), "<mujoco><worldbody><body>").unwrap();
    assert!(matches!(refused(at("torn.xml")), Error::RobotFile { .. }));
    std::fs::write(dir.path().join("bytes.xml"), [0xff, 0xfe, 0x00]).unwrap();
    assert!(matches!(refused(at("bytes.xml")), Error::File { .. }));
    for text in ["", "no xml", "<mujoco><worldbody/><nothing/></mujoco>"] {
        assert!(matches!(reason(text).0, RobotFileError::Compile(_)));
    }
    let both = RobotCfg { urdf: UrdfCfg::single("a.urdf"), ..robot("r", "<mujoco/>") };
    let error = refused(both);
    assert!(matches!(error, Error::Config { field: "mjcf", .. }), "{error}");
}

#[test]
fn trees_that_are_no_robots() {
    let body = |inside: &str| format!("<mujoco><worldbody>{inside}</worldbody></mujoco>");
    let (error, said) = reason(&body("<geom size='1'/>"));
    assert!(matches!(error, RobotFileError::NoBody), "{said}");
    let (error, said) = reason(&body(
        "<body name='a'><geom size='1'/></body><body name='b'><joint/><geom size='1'/></body><body><geom size='1'/></body>",
    ));
    assert!(matches!(error, RobotFileError::SeveralRoots { .. }), "{said}");
    assert!(said.contains("3 bodies in its world (\"a\", \"b\", \"body3\")"), "{said}");
    for inside in ["<body><geom size='1'/></body>", "<body><freejoint/><geom size='1'/></body>"] {
        let (error, said) = reason(&body(inside));
        assert!(matches!(error, RobotFileError::NoJoint) && said.contains("add_mjcf"), "{said}");
    }
    let (error, said) = reason(&body("<body mocap='true' name='m'><body><joint/><geom size='1'/></body></body>"));
    assert!(matches!(error, RobotFileError::MocapBody { .. }) && said.contains("\"m\""), "{said}");
}

/// Joints and actuators that no drive stands for are named with their line, in the file that includes them and in those it
/// includes.
#[test]
fn elements_that_no_robot_has_are_named_with_their_line() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    let tree = "<worldbody>\n<body name='a'><geom size='1'/>\n<body name='b'><joint name='j' axis='0 0 1'/><geom size='1'/>\n\
                <site name='s'/>%</body></body><site name='w'/></worldbody>";
    let said = |inside: &str, after: &str| {
        let included = format!("<mujocoinclude>\n{}</mujocoinclude>", tree.replace('%', inside));
        write("tree.xml", &included);
        write("robot.xml", &format!("<mujoco><include file='tree.xml'/>\n\n{after}</mujoco>"));
        let error = refused(RobotCfg { mjcf: Some(MjcfFile::new(dir.path().join("robot.xml"))), ..Default::default() });
        assert!(matches!(error, Error::RobotFile { .. }), "{error}");
        error.to_string()
    };
    let text = said("<body><joint name='ball' type='ball'/><geom size='1'/></body>", "");
    assert!(text.contains("tree.xml:5: joint \"ball\" is a ball"), "{text}");
    for (actuator, target) in [
        ("<motor name='m' site='s'/>", "a site"),
        ("<motor name='m' tendon='t'/>", "the spatial tendon \"t\""),
        ("<general name='m' cranksite='s' slidersite='s2' cranklength='1'/>", "a cranksite"),
    ] {
        let after = format!(
            "<tendon><spatial name='t'><site site='s'/><site site='s2'/></spatial></tendon>\n<actuator>{actuator}</actuator>"
        );
        let text = said("<body><site name='s2' pos='0 0 1'/></body>", &after);
        assert!(
            text.contains("robot.xml:4: robot \"robot\": actuator \"m\" acts on ") && text.contains(target),
            "{text}"
        );
        assert!(text.contains("add_mjcf"), "{text}");
    }
    let string = "<tendon><spatial name='t'><site site='s'/><site site='w'/></spatial></tendon>";
    let text = said("", string);
    assert!(text.contains("robot.xml:3: robot \"robot\": tendon \"t\" needs \"w\" in the file's world"), "{text}");
}

/// What stands in the file's world is left out, and said.
#[test]
fn the_world_of_the_file_is_left_out() {
    let text = r#"<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/><light name="sun" pos="0 0 3"/>
        <site name="mark"/><body name="a"><geom name="g" size="0.1" mass="1"/>
        <body name="b"><joint name="j" axis="0 0 1"/><geom name="h" size="0.1" mass="1"/></body></body></worldbody>
        <contact><pair geom1="floor" geom2="g"/></contact>
        <sensor><framepos name="seen" objtype="body" objname="b" reftype="site" refname="mark"/>
          <jointpos name="angle" joint="j"/></sensor></mujoco>"#;
    let mut sim = empty(1);
    sim.add_robot(robot("r", text)).unwrap();
    assert_eq!((sim.batch().model().ngeom(), sim.batch().model().npair()), (2, 0));
    let said: Vec<String> = sim.diagnostics().iter().map(ToString::to_string).collect();
    for words in [
        "robot \"r\": what stands in the file's world is no part of it: geom \"floor\", site \"mark\", light \"sun\"",
        "sensor \"seen\": site \"mark\", which a robot leaves out",
    ] {
        assert_eq!(said.iter().filter(|d| d.contains(words)).count(), 1, "{words}: {said:#?}");
    }
}

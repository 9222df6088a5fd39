//! Files that are not valid robots: typed errors that name the mistake and its place, with the scene unchanged; parts
//! of a file that a robot leaves out; and files that only MuJoCo 4.x reads.

use super::*;
use kinetoscope::mujoco::{BUILD_VERSION, SupportedVersion};
use kinetoscope::sim::{DriveModel, Error, RobotFileError};
use kinetoscope_testkit::error_tables::assert_errors;
use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::worlds::count_diagnostics;
use std::path::PathBuf;

/// The error of adding a robot.
fn refused(cfg: RobotCfg) -> Error {
    let mut sim = empty(1);
    let before = sim.scene().mjcf().to_string();
    let error = sim.add_robot(cfg).unwrap_err();
    assert_eq!(sim.scene().mjcf(), before, "nothing was added");
    error
}

fn of_file(path: impl AsRef<std::path::Path>) -> RobotCfg {
    RobotCfg { mjcf: Some(MjcfFile::new(path.as_ref())), ..Default::default() }
}

/// The reason for refusing a text; asserts that the message begins with the line if there is one.
fn refusal_reason(text: &str) -> (RobotFileError, String) {
    let error = refused(robot("r", text));
    let said = error.to_string();
    let starts_with_line = said.strip_prefix("text:").and_then(|rest| rest.split_once(": robot \"r\": "));
    let is_lined = starts_with_line.is_some_and(|(line, _)| line.parse::<usize>().is_ok());
    assert!(is_lined || said.starts_with("robot \"r\": text: "), "{said}");
    let Error::RobotFile { error, .. } = error else { panic!("{said}") };
    (*error, said)
}

#[test]
fn unreadable_files() {
    let files = TempFiles::default();
    let bad = "<mujoco>\n<worldbody>\n<body>\n<geom sise=\"1\"/></body></worldbody></mujoco>";
    let rows = [
        (files.folder().join("none.xml"), "File {", &["none.xml"][..]),
        (files.write("bad.xml", bad), "", &["robot \"robot\"", "bad.xml", "sise", "line 4"]),
        (files.write("torn.xml", "<mujoco><worldbody><body>"), "RobotFile {", &[]),
        (files.write("bytes.xml", [0xff, 0xfe, 0x00]), "File {", &[]),
    ];
    let refused_file = |path: PathBuf| Err::<(), _>(refused(of_file(path)));
    assert_errors(rows.map(|(path, variant, parts)| (path.display().to_string(), refused_file(path), variant, parts)));
    for text in ["", "no xml", "<mujoco><worldbody/><nothing/></mujoco>"] {
        assert!(matches!(refusal_reason(text).0, RobotFileError::Compile(_)));
    }
    let both = RobotCfg { urdf: UrdfCfg::single("a.urdf"), ..robot("r", "<mujoco/>") };
    assert!(matches!(refused(both), Error::Config { field: "mjcf", .. }));
}

#[test]
fn no_robots() {
    let several = "<body name='a'><geom size='1'/></body><body name='b'><joint/><geom size='1'/></body><body><geom size='1'/></body>";
    for (inside, kind, says) in [
        ("<geom size='1'/>", "NoBody", ""),
        (several, "MultipleRoots", "3 top-level bodies (\"a\", \"b\", \"body3\")"),
        ("<body><geom size='1'/></body>", "NoJoint", "add the file with add_mjcf (entity type mjcf) instead"),
        (
            "<body><freejoint/><geom size='1'/></body>",
            "NoJoint",
            "add the file with add_mjcf (entity type mjcf) instead",
        ),
        ("<body mocap='true' name='m'><body><joint/><geom size='1'/></body></body>", "MocapBody", "\"m\""),
    ] {
        let (error, said) = refusal_reason(&format!("<mujoco><worldbody>{inside}</worldbody></mujoco>"));
        assert!(format!("{error:?}").starts_with(kind) && said.contains(says), "{error:?}: {said}");
    }
}

/// Joints and actuators without an equivalent drive are named with their line, in the main file and in included files.
#[test]
fn named_elements() {
    let files = TempFiles::default();
    let tree = "<worldbody>\n<body name='a'><geom size='1'/>\n<body name='b'><joint name='j' axis='0 0 1'/><geom size='1'/>\n\
                <site name='s'/>%</body></body><site name='w'/></worldbody>";
    let string = |to: &str| format!("<tendon><spatial name='t'><site site='s'/><site site='{to}'/></spatial></tendon>");
    let site = "<body><site name='s2' pos='0 0 1'/></body>";
    let acts = [
        "robot.xml:4: robot \"robot\": actuator \"m\" acts on ",
        "add the file with add_mjcf (entity type mjcf) instead",
    ];
    let actuator = |of: &str| format!("{}\n<actuator>{of}</actuator>", string("s2"));
    let rows = [
        (
            "<body><joint name='ball' type='ball'/><geom size='1'/></body>",
            String::new(),
            &["tree.xml:5: joint \"ball\" is a ball joint"][..],
            "",
        ),
        (site, actuator("<motor name='m' site='s'/>"), &acts, "a site"),
        (site, actuator("<motor name='m' tendon='t'/>"), &acts, "the spatial tendon \"t\""),
        (site, actuator("<general name='m' cranksite='s' slidersite='s2' cranklength='1'/>"), &acts, "a cranksite"),
        ("", string("w"), &["robot.xml:3: robot \"robot\": tendon \"t\" refers to \"w\" of <worldbody>"], ""),
    ];
    assert_errors(rows.map(|(inside, after, parts, target)| {
        files.write("tree.xml", format!("<mujocoinclude>\n{}</mujocoinclude>", tree.replace('%', inside)));
        let path = files.write("robot.xml", format!("<mujoco><include file='tree.xml'/>\n\n{after}</mujoco>"));
        (after, Err::<(), _>(refused(of_file(path))), "RobotFile {", [parts, &[target]].concat())
    }));
}

/// Elements of the file's world are left out with a diagnostic.
#[test]
fn world_of_the_file() {
    let text = r#"<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/><light name="sun" pos="0 0 3"/>
        <site name="mark"/><body name="a"><geom name="g" size="0.1" mass="1"/>
        <body name="b"><joint name="j" axis="0 0 1"/><geom name="h" size="0.1" mass="1"/></body></body></worldbody>
        <contact><pair geom1="floor" geom2="g"/></contact>
        <sensor><framepos name="seen" objtype="body" objname="b" reftype="site" refname="mark"/>
          <jointpos name="angle" joint="j"/></sensor></mujoco>"#;
    let (sim, _) = with(1, robot("r", text));
    assert_eq!((sim.batch().model().ngeom(), sim.batch().model().npair()), (2, 0));
    for words in [
        "robot \"r\": elements directly in <worldbody> are not imported: geom \"floor\", site \"mark\", light \"sun\"",
        "sensor \"seen\": site \"mark\", which a robot does not import",
    ] {
        assert_eq!(count_diagnostics(&sim, &[words]), 1, "{words}: {:#?}", sim.diagnostics());
    }
}

const NO_BITS: &str = r#"contype="0" conaffinity="0""#;

/// The scene's world replaces the file's. A ball of 0.1 m rests on the scene's ground for any collision bits in the
/// file. Pairs with the file's own floor and exclusions of its world are ignored with a diagnostic. A ball without
/// collisions falls 20 m.
#[test]
fn ground() {
    let (pair, exclude) = (r#"<pair geom1="foot" geom2="floor"/>"#, r#"<exclude body1="world" body2="b"/>"#);
    let paired = ["\"foot\"", "\"floor\"", "contact pairs with geoms of <worldbody> are not imported"];
    let floor = r#"<geom name="floor" type="plane" size="1 1 1"/>"#;
    for (bits, floor, contact, stands, words, said) in [
        (NO_BITS, floor, pair, true, &paired[..], 1),
        (NO_BITS, floor, "", false, &["contact pairs with"], 0),
        (NO_BITS, "", "", false, &["contact pairs with"], 0),
        ("", floor, exclude, true, &["body \"b\" collides with the scene"], 1),
        ("", "", "", true, &["collides with the scene"], 0),
        (r#"contype="0" conaffinity="1""#, "", "", true, &["collides with the scene"], 0),
        (r#"contype="8" conaffinity="16""#, "", "", true, &["collides with the scene"], 0),
    ] {
        let text = format!(
            r#"<mujoco><worldbody>{floor}<body name="b" pos="0 0 0.3"><freejoint/><geom name="foot" size="0.1" mass="1" {bits}/>
            <body><joint name="j"/><geom size="0.01" pos="0 0 0.05" mass="0.01" {NO_BITS}/></body></body></worldbody>
            <contact>{contact}</contact></mujoco>"#
        );
        let mut sim = SimulationManager::new(SimulationManagerCfg::default()).unwrap();
        let id = sim.add_robot(RobotCfg { fix_base: false, ..robot("r", &text) }).unwrap();
        sim.update(200);
        let height = sim.robot(id).root_pose()[(0, 2)];
        let right = if stands { (height - 0.1).abs() < 2e-3 } else { height < -1.0 };
        assert!(right, "{bits} {contact}: {height}");
        assert_eq!(count_diagnostics(&sim, words), said, "{bits} {contact}: {:?}", sim.diagnostics());
    }
    // Pairs within a robot give a diagnostic if self-collision is off.
    let text = r#"<mujoco><worldbody><body name="a"><geom name="g" size="0.1" mass="1"/><body name="b" pos="1 0 0">
        <joint name="j" axis="0 0 1"/><geom name="h" size="0.1" mass="1"/></body></body></worldbody>
        <contact><pair geom1="g" geom2="h"/></contact></mujoco>"#;
    for self_collision in [false, true] {
        let (sim, _) = with(1, RobotCfg { self_collision, ..robot("r", text) });
        let named = count_diagnostics(&sim, &["\"g\" and \"h\""]);
        assert_eq!((named, sim.batch().model().npair()), (usize::from(!self_collision), usize::from(self_collision)));
    }
}

/// A pendulum with these attributes of its body and of its joint; `after` follows the bodies.
fn pendulum(body: &str, joint: &str, after: &str) -> String {
    format!(
        r#"<mujoco><compiler angle="radian"/><worldbody><body name="base"><geom size="0.01" mass="1"/>
        <body name="arm" {body}><joint name="j" axis="0 1 0" {joint}/><geom size="0.02" pos="0.3 0 0" mass="1"/></body>
        </body></worldbody>{after}</mujoco>"#
    )
}

/// Adds a robot; `None` if this MuJoCo version does not support an attribute of the file, which must then be an error.
fn newer(cfg: RobotCfg) -> Option<(SimulationManager, RobotId)> {
    let mut sim = empty(1);
    match sim.add_robot(cfg) {
        Ok(id) => {
            assert_eq!(BUILD_VERSION, SupportedVersion::V4);
            Some((sim, id))
        }
        Err(error) => {
            assert!(BUILD_VERSION == SupportedVersion::V2 && matches!(error, Error::RobotFile { .. }), "{error}");
            assert!(error.to_string().contains("XML"), "{error}");
            None
        }
    }
}

/// A body with half gravity compensation in MuJoCo gets the other half, and no more.
#[test]
fn newer_gravity_compensation() {
    let Some((mut sim, id)) = newer(passive(robot("r", &pendulum(r#"gravcomp="0.5""#, "", "")))) else { return };
    let start = sim.robot(id).qpos();
    let mut moved = |compensated, steps| {
        sim.robot_mut(id).set_gravity_compensation(compensated, None, None).unwrap();
        sim.update(steps);
        (sim.robot(id).qpos() - &start)[(0, 0)]
    };
    let off = moved(true, 500);
    assert!(off.abs() < 1e-9, "{off}");
    // Half of g at 0.3 m: 16.35 rad/s² times (0.1 s)² / 2, near the horizontal.
    let fallen = moved(false, 50);
    assert!((fallen - 0.0817).abs() < 4e-3, "{fallen}");
}

/// The file's limit of actuator forces is that of the drive; the configuration may raise it.
#[test]
fn newer_force_limit() {
    let text = pendulum("", r#"actuatorfrcrange="-5 5""#, r#"<actuator><position joint="j" kp="100"/></actuator>"#);
    for model in [DriveModel::Implicit, DriveModel::Actuator] {
        let add = |max_effort: Option<f64>| {
            let drive = DriveCfg { model, max_effort: max_effort.map(Into::into), ..Default::default() };
            newer(RobotCfg { drive, ..robot("r", &text) })
        };
        let Some((sim, id)) = add(None) else { return };
        assert_eq!(sim.robot(id).qf_limits()[(0, 0)], 5.0);
        let Some((mut sim, id)) = add(Some(20.0)) else { return };
        assert_eq!((sim.robot(id).qf_limits()[(0, 0)], sim.batch().model().joint_actuator_force(0)), (20.0, None));
        sim.robot_mut(id).set_qpos_target(&row([1.0]), None, None).unwrap();
        sim.update(1);
        let effort = sim.robot(id).qf()[(0, 0)];
        assert!((effort.abs() - 20.0).abs() < 1e-6, "{model:?}: {effort}");
    }
}

/// Sensors of actuator forces are left out by name.
#[test]
fn newer_sensors() {
    let after = r#"<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>
        <sensor><jointactuatorfrc name="felt" joint="j"/><tendonactuatorfrc name="pulled" tendon="t"/>
        <jointpos name="angle" joint="j"/></sensor>"#;
    let Some((sim, _)) = newer(robot("r", &pendulum("", "", after))) else { return };
    assert_eq!(sim.batch().model().nsensor(), 1);
    for name in ["felt", "pulled"] {
        let said = count_diagnostics(&sim, &[&format!("sensor {name:?}")]);
        assert_eq!(said, 1, "{name}: {:?}", sim.diagnostics());
    }
}

//! Files that cannot be parts, and settings that are not taken over: what is said of them.

use super::{empty, machine};
use kinetoscope::prelude::*;
use kinetoscope::sim::{DiagnosticKind, mj};

fn refused(cfg: MjcfCfg) -> String {
    let mut sim = empty(1);
    let before = sim.mjcf().to_string();
    let error = sim.add_mjcf(cfg).unwrap_err().to_string();
    assert_eq!(sim.mjcf(), before, "nothing was added");
    error
}

#[test]
fn a_bad_file_is_named_with_element_and_line() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let text = refused(MjcfCfg::file("part", dir.path().join("none.xml")));
    assert!(text.contains("none.xml"), "{text}");
    let path = write("bad.xml", "<mujoco>\n<worldbody>\n<body>\n<geom sise=\"1\"/>\n</body></worldbody></mujoco>");
    let text = refused(MjcfCfg::file("part", &path));
    assert!(text.contains("part \"part\"") && text.contains("bad.xml") && text.contains("sise"), "{text}");
    assert!(text.contains("geom") && text.contains("line 4"), "{text}");
    let path =
        write("mass.xml", "<mujoco>\n<worldbody>\n<body name=\"light\"><freejoint/></body></worldbody></mujoco>");
    let text = refused(MjcfCfg::file("part", &path));
    assert!(text.contains("mass.xml") && text.contains("light"), "{text}");
    for text in ["", "no xml", "<mujoco><asset><mesh file=\"none.obj\"/></asset></mujoco>"] {
        let said = refused(MjcfCfg::text("part", text));
        assert!(said.contains("part \"part\": text: MuJoCo refuses"), "{said}");
    }
}

/// Root cause: the first sensor that cannot be written refused the whole file, of which everything else could be used.
/// Sensors move nothing: those that a part cannot have are left out and named with their line, the others measure on, with
/// their own numbers: in the scene, other columns stand before theirs.
#[test]
fn sensors_that_no_part_can_have_are_left_out_alone() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("odd.xml");
    let text = r#"<mujoco><worldbody><site name="s"/><geom size="1" contype="0" conaffinity="0"/>
    <body name="b"><joint name="j" axis="0 1 0"/><geom size="0.1" pos="0.3 0 0"/><site name="t"/></body></worldbody>
    <sensor>
        <framepos name="seen" objtype="site" objname="t"/>
        <subtreecom name="all" body="world"/>
        <jointvel name="speed" joint="j"/>
        <user name="u" objtype="site" objname="t" datatype="real" needstage="pos" dim="3"/>
        <force site="s"/>
        <jointpos name="angle" joint="j"/>
    </sensor></mujoco>"#;
    std::fs::write(&path, text).unwrap();
    let mut sim = empty(2);
    let uids = ["first", "second"];
    let parts = uids.map(|uid| sim.add_mjcf(MjcfCfg::file(uid, &path)).unwrap());
    let said: Vec<String> = sim.diagnostics().iter().map(ToString::to_string).collect();
    for uid in uids {
        for (line, name, what) in [
            (5, "all", "subtreecom of the world, which holds the whole scene"),
            (7, "u", "the type user"),
            (8, "sensor4", "force of the world"),
        ] {
            let words = [&format!("odd.xml:{line}: part {uid:?}: sensor {name:?}: {what}"), "[element-ignored]"];
            assert_eq!(said.iter().filter(|d| words.iter().all(|w| d.contains(w))).count(), 1, "{name}: {said:#?}");
        }
    }
    assert_eq!(said.iter().filter(|d| d.contains("sensor ")).count(), 6, "and no other: {said:#?}");
    assert_eq!(sim.mjcf_part(parts[1]).sensor_names(), ["seen", "speed", "angle"]);
    let id = sim.add_sensor("own", MujocoSensorCfg::default()).unwrap();
    let start = kinetoscope::ndarray::array![[0.1], [0.2]];
    sim.mjcf_part_mut(parts[1]).write_qpos(&start, None).unwrap();
    sim.update(50);
    for (part, uid) in parts.into_iter().zip(uids) {
        let part = sim.mjcf_part(part);
        let sensor = sim.sensor(id).unwrap();
        assert_eq!(sensor.value(&format!("{uid}/angle")).unwrap(), part.get_qpos());
        assert_eq!(sensor.value(&format!("{uid}/speed")).unwrap(), part.get_qvel());
        assert_eq!(sensor.value(&format!("{uid}/seen")).unwrap(), kinetoscope::ndarray::Array2::<f64>::zeros((2, 3)));
    }
    let sensor = sim.sensor(id).unwrap();
    assert_ne!(sensor.value("first/angle").unwrap(), sensor.value("second/angle").unwrap(), "the control");
    let named = MujocoSensorCfg { sensors: Some(vec!["first/all".into()]), ..Default::default() };
    let error = sim.add_sensor("none", named).unwrap_err().to_string();
    assert!(error.contains("no MuJoCo sensor \"first/all\"; known are \"first/"), "{error}");
}

#[test]
fn names_are_unique_in_the_scene() {
    let mut sim = empty(1);
    sim.add_mjcf(MjcfCfg::text("m", machine())).unwrap();
    for uid in ["m", "world", "ground"] {
        let error = sim.add_mjcf(MjcfCfg::text(uid, machine())).unwrap_err();
        assert!(matches!(error, Error::DuplicateUid(_)), "{error}");
    }
    assert!(matches!(sim.add_mjcf(MjcfCfg::text("a/b", machine())).unwrap_err(), Error::InvalidUid(_)));
    let object = RigidObjectCfg { uid: "m".into(), ..Default::default() };
    assert!(matches!(sim.add_rigid_object(object).unwrap_err(), Error::DuplicateUid(_)));
    let error = sim.mjcf_id("n").unwrap_err().to_string();
    assert!(error.contains("known are \"m\""), "{error}");
}

/// What only 4.x has and nobody writes back is refused by name, never left out; sensors are left out.
#[test]
fn what_cannot_be_written_back_is_refused() {
    let part = |inside: &str, after: &str| {
        let text = format!(
            "<mujoco><worldbody><body name=\"b\"><joint name=\"j\" {inside}/><geom name=\"g\" size=\"1\"/><site name=\"s\"/></body>\
             </worldbody>{after}</mujoco>"
        );
        let mut sim = empty(1);
        sim.add_mjcf(MjcfCfg::text("part", text)).map(|_| sim.diagnostics().to_vec())
    };
    assert_eq!(part("stiffness=\"1\"", "").unwrap(), []);
    if mj::TARGET == mj::Target::V2 {
        return;
    }
    let delayed = "<actuator><motor name=\"a\" joint=\"j\" delay=\"0.01\" nsample=\"3\"/></actuator>";
    let cloth = "<worldbody><body name=\"c\" pos=\"0 0 3\"><flexcomp name=\"f\" type=\"grid\" count=\"3 3 1\" spacing=\"0.1 0.1 0.1\" \
                 dim=\"2\" mass=\"1\" radius=\"0.01\"/></body></worldbody>";
    for (inside, after, parts) in [
        ("", cloth, ["flex \"0\"", "deforms"]),
        ("stiffness=\"1 2 3\"", "", ["joint \"j\"", "stiffness of higher order"]),
        ("damping=\"1 -2 0\"", "", ["joint \"j\"", "damping of higher order"]),
        ("", delayed, ["actuator \"a\"", "delay"]),
    ] {
        let error = part(inside, after).unwrap_err();
        assert!(matches!(error, Error::MjcfPart { .. }), "{error}");
        let text = error.to_string();
        assert!(parts.iter().all(|part| text.contains(part)), "{text}");
    }
    for (sensor, what) in [
        ("<contact name=\"x\" geom1=\"g\"/>", "the type contact"),
        ("<jointpos name=\"x\" joint=\"j\" delay=\"0.01\" nsample=\"3\"/>", "delay"),
        ("<rangefinder name=\"x\" site=\"s\" data=\"dist dir\"/>", "rangefinder data other than a distance"),
    ] {
        let said = part("", &format!("<sensor>{sensor}</sensor>")).unwrap();
        assert!(said.len() == 1 && said[0].to_string().contains(&format!("sensor \"x\": {what}")), "{said:#?}");
    }
}

/// Settings of the whole model are the scene's: each that differs is said, with both values and where it was stated.
#[test]
fn settings_that_are_not_taken_over_are_said() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("set.xml");
    let text = "<mujoco>\n<include file=\"more.xml\"/>\n<option timestep=\"0.004\" gravity=\"0 0 -1.62\"\n integrator=\"RK4\">\n\
                <flag contact=\"disable\"/></option>\n<visual/>\n<worldbody><body><joint/><geom size=\"0.1\"/></body></worldbody>\n\
                <keyframe><key qpos=\"1\"/></keyframe></mujoco>";
    std::fs::write(&path, text).unwrap();
    std::fs::write(dir.path().join("more.xml"), "<mujoco>\n\n<option cone=\"elliptic\"/></mujoco>").unwrap();
    let mut sim = empty(1);
    sim.add_mjcf(MjcfCfg::file("set", &path)).unwrap();
    let said: Vec<String> = sim.diagnostics().iter().map(ToString::to_string).collect();
    let says = |parts: &[&str]| said.iter().any(|text| parts.iter().all(|part| text.contains(part)));
    assert!(says(&["set.xml:3", "timestep is 0.004", "0.002 holds", "[setting-ignored]"]), "{said:#?}");
    assert!(says(&["set.xml:3", "gravity is 0 0 -1.62", "0 0 -9.81 holds"]), "{said:#?}");
    assert!(says(&["set.xml:3", "integrator is RK4", "Euler holds"]), "{said:#?}");
    assert!(says(&["set.xml:3", "flag contact is disable", "enable holds"]), "{said:#?}");
    assert!(says(&["more.xml:3", "cone is elliptic", "pyramidal holds"]), "{said:#?}");
    assert!(says(&["set.xml:6", "<visual> is left out"]) && says(&["1 keyframe(s) are left out"]), "{said:#?}");
    let settings = sim.diagnostics().iter().filter(|d| d.kind == DiagnosticKind::SettingIgnored).count();
    assert_eq!(settings, 5, "{said:#?}");
    // What a file leaves to MuJoCo and the scene has otherwise is said too.
    let mut other = SimulationManager::new(SimulationManagerCfg { ground: None, ..Default::default() }).unwrap();
    other.add_mjcf(MjcfCfg::text("plain", "<mujoco><worldbody><geom size=\"1\"/></worldbody></mujoco>")).unwrap();
    let said: Vec<String> = other.diagnostics().iter().map(ToString::to_string).collect();
    assert_eq!(said.len(), 1, "{said:#?}");
    assert!(said[0].contains("timestep is 0.002, MuJoCo's default; the scene's 0.01 holds"), "{said:#?}");
}

#[test]
fn a_scene_file_declares_parts() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("machine.xml"), machine()).unwrap();
    let file = dir.path().join("scene.toml");
    let text = "[entities.m]\ntype = \"mjcf\"\npath = \"machine.xml\"\ninit_pose = [0, 0, 1, 1, 0, 0, 0]\n\
                [entities.own]\ntype = \"mujoco_sensor\"\nsensors = [\"m/acc\"]\n";
    std::fs::write(&file, text).unwrap();
    let mut scene = InteractiveScene::from_file(&file).unwrap();
    scene.update(3);
    assert_eq!(scene.mjcf_part("m").unwrap().actuator_names().len(), 3);
    assert_eq!(scene.sensor::<MujocoSensor>("own").unwrap().values().dim(), (1, 3));
    scene.mjcf_part_mut("m").unwrap().set_ctrl(&kinetoscope::ndarray::array![[0.1, 0.2, 0.3]], None, None).unwrap();
    assert_eq!(scene.robot("m").unwrap_err().to_string(), "\"m\" is a MJCF part, not a robot");
    // Written and read again it is the same.
    let cfg = SceneCfg::from_file(&file).unwrap();
    let again = SceneCfg::from_toml(&cfg.to_toml(&EntityTypes::default()).unwrap(), "x.toml", &EntityTypes::default());
    let (EntityCfg::Mjcf(a), EntityCfg::Mjcf(b)) = (&cfg.entities[0].1, &again.unwrap().entities[0].1) else {
        panic!("{cfg:?}");
    };
    assert_eq!(a, b);
    assert_eq!(a.path, dir.path().join("machine.xml"));

    std::fs::write(dir.path().join("machine.xml"), "<mujoco>\n<option timestp=\"1\"/></mujoco>").unwrap();
    let error = InteractiveScene::from_file(&file).unwrap_err().to_string();
    for part in ["scene.toml:1", "entity \"m\"", "machine.xml", "timestp", "line 2"] {
        assert!(error.contains(part), "{part} in {error}");
    }
    let unknown = SceneCfg::from_toml("[entities.m]\ntype = \"mjcf\"\nfile = \"a\"", "s.toml", &EntityTypes::default());
    let error = unknown.unwrap_err().to_string();
    assert!(error.contains("s.toml:3") && error.contains("`path`"), "{error}");
}

/// What is no XML is told with its line, as what is no MJCF is: of an element that is not closed, the line where it begins.
#[test]
fn text_that_is_no_xml_names_its_line() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("broken.xml");
    for (what, text, line) in [
        ("a body that is not closed", "<mujoco>\n <worldbody>\n  <body>\n </worldbody>\n</mujoco>\n", 3),
        ("a sign that is missing", "<mujoco>\n <worldbody>\n  <geom size=\"1\"\n </worldbody>\n</mujoco>\n", 3),
        ("a value without quotes", "<mujoco>\n <worldbody>\n  <geom size=1/>\n </worldbody>\n</mujoco>\n", 3),
        ("an end of nothing", "<mujoco>\n <worldbody/>\n </body>\n</mujoco>\n", 1),
    ] {
        std::fs::write(&path, text).unwrap();
        let message = refused(MjcfCfg::file("part", &path));
        assert!(message.starts_with(&format!("{}:{line}: ", path.display())), "{what}: {message}");
    }
}

//! Files that are refused, settings that are ignored, scene files, and exported files.

use super::*;
use kinetoscope::mujoco::{BUILD_VERSION, SupportedVersion, compile_file};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::robot::diagnostic::DiagnosticKind;
use kinetoscope::sensors::{MujocoSensor, MujocoSensorCfg};
use kinetoscope::sim::EntityTypes;
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::worlds::count_diagnostics;

/// The error of a refused part; asserts that the scene is unchanged.
fn refused(cfg: MjcfPartCfg) -> String {
    let mut sim = empty(1);
    let before = sim.scene().mjcf().to_string();
    let error = sim.add_mjcf(cfg).unwrap_err().to_string();
    assert_eq!(sim.scene().mjcf(), before, "nothing was added");
    error
}

/// Files refused by MuJoCo are named with element and line; invalid XML with the line of the faulty element.
#[test]
fn bad_files() {
    let files = TempFiles::default();
    let text = refused(MjcfPartCfg::file("part", files.folder().join("none.xml")));
    assert!(text.contains("none.xml"), "{text}");
    for (file, text, parts) in [
        (
            "bad.xml",
            "<mujoco>\n<worldbody>\n<body>\n<geom sise=\"1\"/>\n</body></worldbody></mujoco>",
            &["MJCF part \"part\"", "bad.xml", "sise", "geom", "line 4"][..],
        ),
        (
            "mass.xml",
            "<mujoco>\n<worldbody>\n<body name=\"light\"><freejoint/></body></worldbody></mujoco>",
            &["mass.xml", "light"],
        ),
        // An unclosed body, a missing bracket, an unquoted value, a closing tag without an opening one.
        ("open.xml", "<mujoco>\n <worldbody>\n  <body>\n </worldbody>\n</mujoco>\n", &["^3: "]),
        ("sign.xml", "<mujoco>\n <worldbody>\n  <geom size=\"1\"\n </worldbody>\n</mujoco>\n", &["^3: "]),
        ("quotes.xml", "<mujoco>\n <worldbody>\n  <geom size=1/>\n </worldbody>\n</mujoco>\n", &["^3: "]),
        ("end.xml", "<mujoco>\n <worldbody/>\n </body>\n</mujoco>\n", &["^1: "]),
    ] {
        let path = files.write(file, text);
        let text = refused(MjcfPartCfg::file("part", &path));
        for part in parts {
            match part.strip_prefix('^') {
                Some(line) => assert!(text.starts_with(&format!("{}:{line}", path.display())), "{file}: {text}"),
                None => assert!(text.contains(part), "{file}: {text}"),
            }
        }
    }
    for text in ["", "no xml", "<mujoco><asset><mesh file=\"none.obj\"/></asset></mujoco>"] {
        let reported = refused(MjcfPartCfg::text("part", text));
        assert!(reported.contains("part \"part\": text: MuJoCo rejected the model"), "{reported}");
    }
}

/// Regression: the first unsupported sensor refused the whole file, although everything else was usable. Unsupported
/// sensors are left out and named with their line. The other sensors keep their own values, although other columns
/// precede theirs in the scene.
#[test]
fn left_out_sensors() {
    let files = TempFiles::default();
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
    let path = files.write("odd.xml", text);
    let mut sim = empty(2);
    let uids = ["first", "second"];
    let parts = uids.map(|uid| sim.add_mjcf(MjcfPartCfg::file(uid, &path)).unwrap());
    for uid in uids {
        for (line, name, what) in [
            (5, "all", "subtreecom of the world body, which contains the whole scene"),
            (7, "u", "the type user"),
            (8, "sensor4", "force of the world body, which contains the whole scene"),
        ] {
            let text = format!("odd.xml:{line}: MJCF part {uid:?}: sensor {name:?}: {what}");
            assert_eq!(count_diagnostics(&sim, &[&text, "[element-ignored]"]), 1, "{text}: {:#?}", sim.diagnostics());
        }
    }
    assert_eq!(count_diagnostics(&sim, &["sensor "]), 6, "and no other: {:#?}", sim.diagnostics());
    assert_eq!(sim.mjcf_part(parts[1]).sensor_names(), ["seen", "speed", "angle"]);
    let id = sim.add_sensor("own", MujocoSensorCfg::default()).unwrap();
    sim.mjcf_part_mut(parts[1]).write_qpos(&array![[0.1], [0.2]], None).unwrap();
    sim.update(50);
    let sensor = sim.sensor(id).unwrap();
    for (part, uid) in parts.into_iter().zip(uids) {
        let (part, value) = (sim.mjcf_part(part), |name: &str| sensor.value(&format!("{uid}/{name}")).unwrap());
        assert_eq!((value("angle"), value("speed")), (part.qpos().view(), part.qvel().view()));
        assert_eq!(value("seen"), Array2::<f64>::zeros((2, 3)));
    }
    assert_ne!(sensor.value("first/angle").unwrap(), sensor.value("second/angle").unwrap(), "the control");
    let named = MujocoSensorCfg { sensors: Some(vec!["first/all".into()]), ..Default::default() };
    assert_error(sim.add_sensor("none", named), "", &["unknown MuJoCo sensor \"first/all\"; known names: \"first/"]);
}

#[test]
fn unique_names() {
    let (mut sim, _) = with(1, MACHINE);
    for (uid, kind) in
        [("m", "DuplicateUid"), ("world", "DuplicateUid"), ("ground", "DuplicateUid"), ("a/b", "InvalidUid")]
    {
        assert_error(sim.add_mjcf(MjcfPartCfg::text(uid, MACHINE)), kind, &[]);
    }
    let object = RigidObjectCfg { uid: "m".into(), ..Default::default() };
    assert_error(sim.add_rigid_object(object), "DuplicateUid", &[]);
    assert_error(sim.entities().mjcf_id("n"), "", &["known names: \"m\""]);
}

/// Elements of 4.x that cannot be written back are refused by name, never left out; unsupported sensors are left out.
#[test]
fn newer_elements() {
    let part = |inside: &str, after: &str| {
        let text = format!(
            "<mujoco><worldbody><body name=\"b\"><joint name=\"j\" {inside}/><geom name=\"g\" size=\"1\"/><site name=\"s\"/></body>\
             </worldbody>{after}</mujoco>"
        );
        let mut sim = empty(1);
        sim.add_mjcf(MjcfPartCfg::text("part", text)).map(|_| sim.diagnostics().to_vec())
    };
    assert_eq!(part("stiffness=\"1\"", "").unwrap(), []);
    if BUILD_VERSION == SupportedVersion::V2 {
        return;
    }
    let delayed = "<actuator><motor name=\"a\" joint=\"j\" delay=\"0.01\" nsample=\"3\"/></actuator>";
    let cloth = "<worldbody><body name=\"c\" pos=\"0 0 3\"><flexcomp name=\"f\" type=\"grid\" count=\"3 3 1\" spacing=\"0.1 0.1 0.1\" \
                 dim=\"2\" mass=\"1\" radius=\"0.01\"/></body></worldbody>";
    for (inside, after, parts) in [
        ("", cloth, ["flex \"0\"", "a deformable (flex) body"]),
        ("stiffness=\"1 2 3\"", "", ["joint \"j\"", "nonlinear (polynomial) stiffness"]),
        ("damping=\"1 -2 0\"", "", ["joint \"j\"", "nonlinear (polynomial) damping"]),
        ("", delayed, ["actuator \"a\"", "delay"]),
    ] {
        assert_error(part(inside, after), "MjcfAttach", &parts);
    }
    // Regression: behind a free joint, whose six degrees of freedom come first, the wrong joint was named.
    let behind = "<mujoco><worldbody><body><freejoint/><geom size=\"0.1\"/></body><body pos=\"1 0 0\">\
                  <joint name=\"hinge\" damping=\"1 -2 0\"/><geom size=\"0.1\"/></body></worldbody></mujoco>";
    assert_error(empty(1).add_mjcf(MjcfPartCfg::text("part", behind)).map(drop), "MjcfAttach", &["joint \"hinge\""]);
    for (sensor, what) in [
        ("<contact name=\"x\" geom1=\"g\"/>", "the type contact"),
        ("<jointpos name=\"x\" joint=\"j\" delay=\"0.01\" nsample=\"3\"/>", "delay"),
        ("<rangefinder name=\"x\" site=\"s\" data=\"dist dir\"/>", "rangefinder output other than the distance"),
    ] {
        let said = part("", &format!("<sensor>{sensor}</sensor>")).unwrap();
        assert!(said.len() == 1 && said[0].to_string().contains(&format!("sensor \"x\": {what}")), "{said:#?}");
    }
}

/// Settings of the whole model are those of the scene. Each difference is reported with both values and its source
/// line.
#[test]
fn ignored_settings() {
    let files = TempFiles::default();
    let text = "<mujoco>\n<include file=\"more.xml\"/>\n<option timestep=\"0.004\" gravity=\"0 0 -1.62\"\n integrator=\"RK4\">\n\
                <flag contact=\"disable\"/></option>\n<visual/>\n<worldbody><body><joint/><geom size=\"0.1\"/></body></worldbody>\n\
                <keyframe><key qpos=\"1\"/></keyframe></mujoco>";
    files.write("more.xml", "<mujoco>\n\n<option cone=\"elliptic\"/></mujoco>");
    let mut sim = empty(1);
    sim.add_mjcf(MjcfPartCfg::file("set", files.write("set.xml", text))).unwrap();
    for words in [
        &["set.xml:3", "timestep is 0.004", "0.002 is used", "[setting-ignored]"][..],
        &["set.xml:3", "gravity is 0 0 -1.62", "0 0 -9.81 is used"],
        &["set.xml:3", "integrator is RK4", "Euler is used"],
        &["set.xml:3", "flag contact is disable", "enable is used"],
        &["more.xml:3", "cone is elliptic", "pyramidal is used"],
        &["set.xml:6", "<visual> is ignored"],
        &["1 keyframe(s) are ignored"],
    ] {
        assert!(count_diagnostics(&sim, words) > 0, "{words:?}: {:#?}", sim.diagnostics());
    }
    let settings = sim.diagnostics().iter().filter(|d| d.kind == DiagnosticKind::SettingIgnored).count();
    assert_eq!(settings, 5, "{:#?}", sim.diagnostics());
    // Regression: the settings of signed distance fields and of sleeping were not compared.
    if BUILD_VERSION == SupportedVersion::V4 {
        let text = "<mujoco><option sdf_iterations=\"50\" sleep_tolerance=\"0.1\"/><worldbody><geom size=\"1\"/></worldbody></mujoco>";
        let mut sim = empty(1);
        sim.add_mjcf(MjcfPartCfg::text("sdf", text)).unwrap();
        for words in [["sdf_iterations is 50", "is used"], ["sleep_tolerance is 0.1", "is used"]] {
            assert_eq!(count_diagnostics(&sim, &words), 1, "{words:?}: {:#?}", sim.diagnostics());
        }
    }
    // A setting that the file leaves at MuJoCo's default, and that differs in the scene, is reported too.
    let mut other = SimulationManager::new(SimulationManagerCfg { ground: None, ..Default::default() }).unwrap();
    other.add_mjcf(MjcfPartCfg::text("plain", "<mujoco><worldbody><geom size=\"1\"/></worldbody></mujoco>")).unwrap();
    let said = count_diagnostics(&other, &["timestep is 0.002, MuJoCo's default; the scene's value 0.01 is used"]);
    assert_eq!((said, other.diagnostics().len()), (1, 1), "{:#?}", other.diagnostics());
}

#[test]
fn scene_files() {
    let files = TempFiles::default();
    let machine_file = files.write("machine.xml", MACHINE);
    let text = "[entities.m]\ntype = \"mjcf\"\npath = \"machine.xml\"\ninit_pose = [0, 0, 1, 1, 0, 0, 0]\n\
                [entities.own]\ntype = \"mujoco_sensor\"\nsensors = [\"m/acc\"]\n";
    let file = files.write("scene.toml", text);
    let mut scene = InteractiveScene::from_file(&file).unwrap();
    scene.update(3);
    assert_eq!(scene.mjcf_part("m").unwrap().actuator_names().len(), 3);
    assert_eq!(scene.sensor::<MujocoSensor>("own").unwrap().values().dim(), (1, 3));
    scene.mjcf_part_mut("m").unwrap().set_ctrl(&array![[0.1, 0.2, 0.3]], None, None).unwrap();
    assert_eq!(scene.robot("m").unwrap_err().to_string(), "\"m\" is an MJCF part, not a robot");
    // A scene file is unchanged by writing and reading it again.
    let cfg = SceneCfg::from_file(&file).unwrap();
    let again = SceneCfg::from_toml(&cfg.to_toml(&EntityTypes::default()).unwrap(), "x.toml", &EntityTypes::default());
    let (EntityCfg::Mjcf(a), EntityCfg::Mjcf(b)) = (&cfg.entities[0].1, &again.unwrap().entities[0].1) else {
        panic!("{cfg:?}");
    };
    assert_eq!((a, &a.path), (b, &machine_file));

    files.write("machine.xml", "<mujoco>\n<option timestp=\"1\"/></mujoco>");
    let parts = ["scene.toml:1", "entity \"m\"", "machine.xml", "timestp", "line 2"];
    assert_error(InteractiveScene::from_file(&file), "", &parts);
    let unknown = SceneCfg::from_toml("[entities.m]\ntype = \"mjcf\"\nfile = \"a\"", "s.toml", &EntityTypes::default());
    assert_error(unknown, "", &["s.toml:3", "`path`"]);
}

/// The exported model equals the running model.
#[test]
fn exported() {
    let (mut sim, _) = with(1, MACHINE);
    let textured = r#"<mujoco><asset><texture name="t" type="2d" builtin="flat" rgb1="1 0 0" width="2" height="2"/>
        <material name="t" texture="t"/><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset>
        <worldbody><geom type="box" size="1 1 1" material="t"/><geom type="hfield" hfield="h"/></worldbody></mujoco>"#;
    sim.add_mjcf(MjcfPartCfg::text("looks", textured)).unwrap();
    let files = TempFiles::default();
    assert_eq!(sim.dump(files.folder()).unwrap(), []);
    let ours = sim.batch().model();
    for file in
        [if BUILD_VERSION == SupportedVersion::V2 { "robot.mjcf2.xml" } else { "robot.mjcf4.xml" }, "run.mjcf.xml"]
    {
        let model = compile_file(files.folder().join(file)).unwrap().into_model();
        assert_eq!((model.nq(), model.nu(), model.nsensor()), (ours.nq(), ours.nu(), ours.nsensor()), "{file}");
        assert_eq!(model.body_mass(), ours.body_mass(), "{file}");
        assert_eq!((model.ntex(), model.nhfield()), (1, 1), "{file}");
    }
}

/// One of every element that 4.x supports and 2.2.2 does not.
const NEWER: &str = include_str!("../../data/mjcf/newer.xml");

/// Regression: the writer used the version that compiled the file instead of the version that reads it, so that the
/// file for 2.2.2 had attributes that 2.2.2 refuses. These attributes are left out, each with a diagnostic, and nothing
/// else is left out.
#[test]
fn exported_for_2_2_2() {
    let files = TempFiles::default();
    let read = |file: &str| std::fs::read_to_string(files.folder().join(file)).unwrap();
    let mut sim = empty(1);
    if BUILD_VERSION == SupportedVersion::V2 {
        // Reference for the list below: 2.2.2 supports none of them.
        assert_error(sim.add_mjcf(MjcfPartCfg::text("new", NEWER)), "", &["metallic"]);
        return;
    }
    sim.add_mjcf(MjcfPartCfg::text("new", NEWER)).unwrap();
    let left_out = sim.dump(files.folder()).unwrap();
    let mut said: Vec<&str> = left_out.iter().map(|d| d.message.as_str()).collect();
    for what in [
        "material \"steel\": metallic 0.5",
        "material \"steel\": roughness 0.25",
        "body \"arm\": gravcomp 1",
        "joint \"hinge\": actuatorfrcrange [-3.0, 3.0]",
        "equality \"hold\": the whole weld, because it connects sites",
        "light \"bulb\": type point",
        "tendon \"string\": upper end 0.4 of springlength",
        "tendon \"string\": armature 0.2",
        "tendon \"string\": actuatorfrcrange [-2.0, 2.0]",
        "actuator \"late\": dyntype filterexact (replaced by filter)",
        "sensor \"effort\": the type jointactuatorfrc",
        "sensor \"energy\": the type e_kinetic",
        "sensor \"tension\": the type tendonactuatorfrc",
        "sensor \"height\": the type e_potential",
    ] {
        let message =
            format!("MJCF part \"new\": {what}: left out of robot.mjcf2.xml, because MuJoCo 2.2.2 does not support it");
        let at =
            said.iter().position(|m| *m == message).unwrap_or_else(|| panic!("not reported: {message}: {said:#?}"));
        said.swap_remove(at);
        assert!(read("robot.mjcf2.xml").contains(&format!("<!-- {message} -->")), "a comment, too");
        assert!(read("diagnostics.txt").contains(&message));
    }
    assert_eq!(said, [""; 0], "and nothing else");
    assert!(left_out.iter().all(|d| d.kind == DiagnosticKind::ExportReduced));
    // Outside of comments, none of these words is in the file for 2.2.2, and each is in the file for 4.x.
    let old: String = read("robot.mjcf2.xml").lines().filter(|l| !l.trim_start().starts_with("<!--")).collect();
    let new = read("robot.mjcf4.xml");
    let words =
        ["gravcomp", "actuatorfrc", "<weld", "site1", "filterexact", "jointactuatorfrc", "e_kinetic", "e_potential"];
    assert!(words.iter().all(|word| !old.contains(word) && new.contains(word)), "{old}\n{new}");
    assert_eq!((old.matches("armature=\"0.2\"").count(), new.matches("armature=\"0.2\"").count()), (0, 1));
    // The rest of the file is kept.
    for word in ["dyntype=\"filter\"", "name=\"new/follow\"", "<jointpos name=\"new/angle\"", "name=\"new/pull\""] {
        assert!(old.contains(word), "{word}");
    }
    let model = compile_file(files.folder().join("robot.mjcf4.xml")).unwrap().into_model();
    assert_eq!((model.neq(), model.nsensor()), (2, 5));
}

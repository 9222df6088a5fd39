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

/// The world holds the whole scene: what a file measures of its own world would be something else here.
#[test]
fn sensors_of_the_whole_world_are_no_part() {
    for (sensor, what) in
        [("<subtreecom name=\"all\" body=\"world\"/>", "subtreecom"), ("<force name=\"all\" site=\"s\"/>", "force")]
    {
        let text = format!(
            "<mujoco><worldbody><site name=\"s\"/><geom size=\"1\"/></worldbody><sensor>{sensor}</sensor></mujoco>"
        );
        let said = refused(MjcfCfg::text("part", text));
        assert!(said.contains("sensor \"all\" has") && said.contains(what), "{said}");
    }
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

/// What only 4.x has and nobody writes back is refused by name, never left out.
#[test]
fn what_cannot_be_written_back_is_refused() {
    let part = |inside: &str, after: &str| {
        let text = format!(
            "<mujoco><worldbody><body name=\"b\"><joint name=\"j\" {inside}/><geom name=\"g\" size=\"1\"/><site name=\"s\"/></body>\
             </worldbody>{after}</mujoco>"
        );
        let mut sim = empty(1);
        sim.add_mjcf(MjcfCfg::text("part", text)).map(|_| ())
    };
    part("stiffness=\"1\"", "").unwrap();
    let own = "<sensor><user name=\"u\" objtype=\"site\" objname=\"s\" datatype=\"real\" needstage=\"pos\" dim=\"1\"/></sensor>";
    let mut cases = vec![("", own, ["sensor \"u\"", "user"])];
    if mj::TARGET == mj::Target::V4 {
        let delayed = "<actuator><motor name=\"a\" joint=\"j\" delay=\"0.01\" nsample=\"3\"/></actuator>";
        let contact = "<sensor><contact name=\"c\" geom1=\"g\"/></sensor>";
        let cloth = "<worldbody><body name=\"c\" pos=\"0 0 3\"><flexcomp name=\"f\" type=\"grid\" count=\"3 3 1\" spacing=\"0.1 0.1 0.1\" \
                     dim=\"2\" mass=\"1\" radius=\"0.01\"/></body></worldbody>";
        cases.push(("", cloth, ["flex \"0\"", "deforms"]));
        cases.push(("stiffness=\"1 2 3\"", "", ["joint \"j\"", "stiffness of higher order"]));
        cases.push(("damping=\"1 -2 0\"", "", ["joint \"j\"", "damping of higher order"]));
        cases.push(("", delayed, ["actuator \"a\"", "delay"]));
        cases.push(("", contact, ["sensor \"c\"", "contact"]));
    }
    for (inside, after, parts) in cases {
        let error = part(inside, after).unwrap_err();
        assert!(matches!(error, Error::MjcfPart { .. }), "{error}");
        let text = error.to_string();
        assert!(parts.iter().all(|part| text.contains(part)), "{text}");
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

//! The example `inspect_robot`: its reports agree with closed forms and with MuJoCo; its exit codes.

use super::support::TETRAHEDRON;
use kinetoscope::mujoco::{Data, ObjectKind, compile};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::sim::inspect::{InspectCfg, inspect};
use kinetoscope_testkit::tolerance::{Tolerance, assert_close};
use kinetoscope_testkit::urdf;
use kinetoscope_testkit::urdf::TempFiles;
use serde_json::{Value, json};
use std::ffi::OsString;
use std::fs;
use std::path::Path;

#[allow(dead_code, reason = "main is what cargo runs")]
#[path = "../../examples/inspect_robot.rs"]
mod example;

/// Exit code and output of the program.
struct Run {
    code: u8,
    out: String,
    err: String,
}

fn run(args: &[&str]) -> Run {
    let (mut out, mut err) = (Vec::new(), Vec::new());
    let args = ["inspect_robot"].iter().chain(args).map(OsString::from);
    let code = example::run(args, &mut out, &mut err);
    Run { code, out: String::from_utf8(out).unwrap(), err: String::from_utf8(err).unwrap() }
}

/// Exit code and report.
fn report(args: &[&str]) -> (u8, Value) {
    let run = run(&[args, &["--json", "-"]].concat());
    assert_eq!(run.err, "");
    (run.code, serde_json::from_str(&run.out).unwrap())
}

struct Folder(TempFiles);

impl Folder {
    fn new() -> Self {
        Self(TempFiles::default())
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) -> String {
        self.0.write(name, content).to_str().unwrap().to_owned()
    }

    /// Writes a robot with these elements, the first of them in line 2.
    fn urdf(&self, elements: &[&str]) -> String {
        self.write("robot.urdf", urdf::robot("r", &elements.join("\n")))
    }

    fn pendulum(&self, more: &[&str]) -> String {
        let link = link("arm", M, [L, 0.0, 0.0], I);
        self.urdf(
            &[&["<link name=\"base\"/>", &link, &joint("swing", "revolute", "base", "arm", LIMIT)], more].concat(),
        )
    }
}

fn link(name: &str, mass: f64, com: [f64; 3], moment: f64) -> String {
    urdf::link(name, mass, moment, com, "").trim_end().to_owned()
}

fn joint(name: &str, kind: &str, parent: &str, child: &str, more: &str) -> String {
    urdf::joint(name, kind, [parent, child], [0.0; 3], "0 1 0", more).trim_end().to_owned()
}

const LIMIT: &str = "<limit lower=\"-1\" upper=\"2\" effort=\"5\" velocity=\"3\"/>";
/// Mass \[kg\], distance \[m\], moment of inertia \[kg m²\] and angle \[rad\] of a pendulum.
const M: f64 = 2.0;
const L: f64 = 0.5;
const I: f64 = 0.1;
const Q: f64 = 0.7;
/// For numbers of size 1; multiplied by ten for torques of 10 N m.
const ROUNDING: Tolerance = Tolerance::absolute(1e-15, "rounding of a handful of operations on numbers of size 1");
const MUJOCO: Tolerance =
    Tolerance::absolute(1e-12, "the same sums in MuJoCo's order, a thousand times their rounding");

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn names(value: &Value) -> Vec<&str> {
    value.as_array().unwrap().iter().map(|v| v.as_str().unwrap()).collect()
}

/// `file:line: kind` of every warning, with the file name without its folder.
fn warnings(report: &Value) -> Vec<String> {
    let name = |file: &Value| Path::new(file.as_str().unwrap()).file_name().unwrap().to_str().unwrap().to_owned();
    let of = |w: &Value| format!("{}:{}: {}", name(&w["file"]), w["line"], w["kind"].as_str().unwrap());
    report["warnings"].as_array().unwrap().iter().map(of).collect()
}

const SR5: &str = "sr5/SR5.urdf";
const HAND: &str = "revo1_left/revo1_left.urdf";
const ANYMAL: &str = "anymal_c_simple_description/urdf/anymal.urdf";

/// A point mass m at distance l from a horizontal axis, at angle q below the horizontal after a rotation by q about +y:
/// M = I + m l², g = -m 9.81 l cos q (the height of the mass is -l sin q).
#[test]
fn pendulum() {
    let folder = Folder::new();
    // A fixed massless link, whose origin is 1 m from the axis.
    let weld = urdf::joint("weld", "fixed", ["arm", "tool"], [1.0, 0.0, 0.0], "0 1 0", "");
    let file = folder.pendulum(&["<link name=\"tool\"/>", &weld]);
    let (code, json) = report(&[&file, "--qpos", &format!("swing={Q}")]);
    assert_eq!(code, 0, "{:?}", warnings(&json));
    assert_close("mass matrix", numbers(&json["mass_matrix"][0]), [I + M * L * L], ROUNDING);
    assert_close("gravity torque", numbers(&json["gravity_torque"]), [-M * 9.81 * L * Q.cos()], ROUNDING * 10.0);
    assert_close("center of mass", numbers(&json["com"]), [L * Q.cos(), 0.0, -L * Q.sin()], ROUNDING);
    let tool = &json["links"][2];
    assert_eq!((tool["name"].as_str(), tool["parent"].as_str()), (Some("tool"), Some("arm")));
    assert_eq!((&tool["mass"], &tool["com"], &tool["inertia"]), (&Value::from(0.0), &Value::Null, &Value::Null));
    let half = Q / 2.0;
    assert_close(
        "pose of the tool",
        numbers(&tool["pose"]),
        [Q.cos(), 0.0, -Q.sin(), half.cos(), 0.0, half.sin(), 0.0],
        ROUNDING,
    );
    assert_eq!(numbers(&json["links"][1]["inertia"][2]), [0.0, 0.0, I]);
    assert_eq!(json["links"][0]["parent"], Value::Null);
    let (_, still) = report(&[&file]);
    assert_ne!(still["gravity_torque"], json["gravity_torque"], "the position matters");
}

/// The report of the library, with and without its warnings section.
#[test]
fn library() {
    let folder = Folder::new();
    let urdf = UrdfCfg::single(folder.pendulum(&["<gizmo/>"]));
    let report = inspect(&InspectCfg { urdf, ..Default::default() }).unwrap();
    let kinds: Vec<(&str, Option<u32>)> = report.warnings.iter().map(|w| (w.kind, w.line)).collect();
    assert_eq!(kinds, [("element-ignored", Some(5))]);
    let (with, without) = (report.to_string(), report.without_warnings().to_string());
    let rest = with.strip_prefix(&without).unwrap();
    assert!(rest.starts_with("\n1 warning\n") && rest.contains("element-ignored") && rest.contains("gizmo"), "{rest}");
    assert!(without.contains("total mass 2 kg") && !without.contains("element-ignored"), "{without}");
}

#[test]
fn joints() {
    let folder = Folder::new();
    let links: String = ["a", "b", "c", "d"].map(|name| link(name, 1.0, [0.0; 3], 1.0)).concat();
    let follow = "<limit lower=\"-9\" upper=\"9\" effort=\"5\" velocity=\"3\"/>\
                  <mimic joint=\"lead\" multiplier=\"-2\" offset=\"0.5\"/>";
    let file = folder.urdf(&[
        &format!("<link name=\"base\"/>{links}"),
        &joint("lead", "revolute", "base", "a", LIMIT),
        &joint("turn", "continuous", "base", "b", ""),
        &joint("slide", "prismatic", "base", "c", "<limit upper=\"0.5\" effort=\"0\" velocity=\"1\"/>"),
        &joint("follow", "revolute", "base", "d", follow),
    ]);
    let (code, json) = report(&[&file, "--qpos", "lead=0.25, slide=0.1"]);
    assert_eq!((code, warnings(&json)), (1, [4, 5].map(|n| format!("robot.urdf:{n}: effort-unlimited")).to_vec()));
    assert_eq!(names(&json["joint_names"]), ["lead", "turn", "slide", "follow"]);
    assert_eq!(json["columns"], json["joint_names"]);
    assert_eq!(numbers(&json["qpos"]), [0.25, 0.0, 0.1, 0.0], "mimic joints follow");
    let joints = json["joints"].as_array().unwrap();
    let keys = ["type", "lower", "upper", "effort", "velocity"];
    let of = |i: usize| Value::Array(keys.map(|key| joints[i][key].clone()).into());
    assert_eq!(of(0), json!(["revolute", -1.0, 2.0, 5.0, 3.0]));
    assert_eq!(of(1), json!(["continuous", null, null, null, null]));
    assert_eq!(of(2), json!(["prismatic", 0.0, 0.5, 0.0, 1.0]));
    assert_eq!(joints[0]["mimic"], Value::Null);
    assert_eq!(joints[3]["mimic"], json!({"joint": "lead", "multiplier": -2.0, "offset": 0.5}));
    assert_eq!(numbers(&joints[0]["axis"]), [0.0, 1.0, 0.0]);

    let agreeing = report(&[&file, "--qpos", "lead=0.25,follow=0"]).1;
    assert_eq!(agreeing["warnings"].as_array().unwrap().len(), 2, "a position that the driver implies is right");
    let (code, other) = report(&[&file, "--qpos", "lead=0.25,follow=1"]);
    assert_eq!((code, &other["qpos"][3]), (1, &Value::from(0.0)));
    assert!(warnings(&other).contains(&"robot.urdf:6: mimic-position-ignored".to_owned()), "{:?}", warnings(&other));
}

/// Each file is attached to the tip of the one before it.
#[test]
fn several_files() {
    let folder = Folder::new();
    let part = |name: &str| {
        let [a, b] = ["a", "b"].map(|end| format!("{name}_{end}"));
        let links = [&a, &b].map(|link_name| link(link_name, 1.0, [0.0; 3], 1.0)).concat();
        folder.write(&format!("{name}.urdf"), urdf::robot(name, &(links + &joint(name, "revolute", &a, &b, LIMIT))))
    };
    let (code, json) = report(&[&part("x"), &part("y"), &part("z")]);
    assert_eq!((code, names(&json["joint_names"])), (0, vec!["x", "y", "z"]));
    let parents: Vec<&Value> = json["links"].as_array().unwrap().iter().map(|l| &l["parent"]).collect();
    assert_eq!(parents, [&Value::Null, &"x_a".into(), &"x_b".into(), &"y_a".into(), &"y_b".into(), &"z_a".into()]);
}

/// Compares mass matrix and gravity torque of the report with MuJoCo's, computed from the exported MJCF at the same
/// position. Entries are compared in units of the two coordinates that they couple; the MJCF is written with all
/// digits.
fn compare_with_mujoco(files: &[&str], urdf: UrdfCfg, floating: bool) {
    let mut sim = SimulationManager::new(SimulationManagerCfg { ground: None, ..Default::default() }).unwrap();
    let robot = sim.add_robot(RobotCfg { urdf, fix_base: !floating, ..Default::default() }).unwrap();
    // A different position for each joint, inside of all limits; mimic joints follow their drivers.
    let view = sim.robot(robot);
    let (limits, drivers) = (view.qpos_limits(), view.mimic_drivers());
    let own: Vec<f64> = (0..view.dof())
        .map(|j| {
            let [low, high] = [limits[(0, j, 0)].max(-2.0), limits[(0, j, 1)].min(2.0)];
            low + (high - low) * (0.2 + 0.6 * (0.37 * j as f64).fract())
        })
        .collect();
    let qpos: Vec<f64> = drivers.iter().map(|&(driver, ratio, offset)| ratio * own[driver.0] + offset).collect();
    let row = Array2::from_shape_vec((1, qpos.len()), qpos.clone()).unwrap();
    sim.robot_mut(robot).write_qpos(&row, None, None).unwrap();
    assert_eq!(sim.robot(robot).qpos(), row, "inside of all limits");

    let positions = sim.robot(robot).joint_names().iter().zip(&qpos).map(|(n, q)| format!("{n}={q:?}"));
    let positions = positions.collect::<Vec<_>>().join(",");
    let flags: &[&str] = if floating { &["--qpos", &positions, "--floating-base"] } else { &["--qpos", &positions] };
    let (_, json) = report(&[files, flags].concat());
    assert_eq!(names(&json["joint_names"]), sim.robot(robot).joint_names());
    let of_base: &[&str] = &["base.vx", "base.vy", "base.vz", "base.wx", "base.wy", "base.wz"];
    let of_base = if floating { of_base } else { &[] };
    assert_eq!(names(&json["columns"]), [of_base, &names(&json["joint_names"])].concat());

    let model = sim.batch().model().clone();
    let base = if floating { 6 } else { 0 };
    let mut dofs: Vec<usize> = (0..base).collect();
    for name in names(&json["joint_names"]) {
        let joint = model.id(ObjectKind::Joint, &format!("robot/{name}")).unwrap();
        dofs.push(model.jnt_dofadr()[joint] as usize);
    }
    assert_eq!(dofs.len(), model.nv());
    let (m, g) = sim.batch().read(0, |env| (env.data().mass_matrix().unwrap(), env.data().qfrc_bias().to_vec()));
    let unit = |i: usize| m[dofs[i] * (model.nv() + 1)].sqrt();
    let mut largest = [0.0f64; 2];
    let ours: Vec<Vec<f64>> = json["mass_matrix"].as_array().unwrap().iter().map(numbers).collect();
    let torque = numbers(&json["gravity_torque"]);
    for (i, &row) in dofs.iter().enumerate() {
        for (j, &column) in dofs.iter().enumerate() {
            let rotor = if i == j { model.dof_armature()[row] } else { 0.0 };
            let error = (m[row * model.nv() + column] - rotor - ours[i][j]).abs() / (unit(i) * unit(j));
            largest[0] = largest[0].max(error);
        }
        largest[1] = largest[1].max((g[row] - torque[i]).abs() / unit(i));
    }
    assert!(largest[0] < 1e-9 && largest[1] < 1e-9, "{files:?}: {largest:?}");
    assert!(torque.iter().any(|t| t.abs() > 1e-3), "the comparison sees gravity");
}

fn components(files: &[&str]) -> UrdfCfg {
    let found = |file: &str| if Path::new(file).is_file() { file.into() } else { assets::path(file).unwrap() };
    let named = ["arm", "hand"].iter().zip(files).map(|(name, file)| ComponentCfg::new(*name, found(file)));
    let components = named.collect();
    if let [file] = *files { UrdfCfg::single(found(file)) } else { UrdfCfg { components, ..Default::default() } }
}

#[test]
fn dynamics() {
    compare_with_mujoco(&[SR5, HAND], components(&[SR5, HAND]), false);
    compare_with_mujoco(&[HAND], components(&[HAND]), true);
}

/// The invalid inertias of ANYmal become valid once its links are fused.
#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn dynamics_of_anymal() {
    let anymal = kinetoscope_testkit::test_resources::robot(ANYMAL);
    let anymal = anymal.to_str().unwrap();
    compare_with_mujoco(&[anymal], components(&[anymal]), true);
}

#[test]
fn warnings_of_the_simulation() {
    let folder = Folder::new();
    let file = folder.urdf(&[
        "<link name=\"base\"/>",
        &link("bad", 1.0, [0.0; 3], 1.0).replace("ixx=\"1\"", "ixx=\"9\""),
        "<link name=\"empty\"/>",
        &link("light", 1.0, [0.0; 3], 0.0),
        &joint("j1", "revolute", "base", "bad", LIMIT),
        &joint("j2", "revolute", "bad", "empty", LIMIT),
        &joint("j3", "revolute", "bad", "light", "<limit lower=\"2\" upper=\"1\" effort=\"5\" velocity=\"3\"/>"),
        "<gizmo/>",
    ]);
    let (code, json) = report(&[&file]);
    assert_eq!(code, 1);
    assert_eq!(
        warnings(&json),
        [
            "robot.urdf:3: inertia-repaired",
            "robot.urdf:4: massless-link",
            "robot.urdf:5: inertia-repaired",
            "robot.urdf:8: limit-ignored",
            "robot.urdf:9: element-ignored"
        ]
    );
    assert_eq!(json["links"][1]["inertia"][0][0], 9.0, "the inertia is reported unchanged");
    assert_eq!(json["total_mass"], 2.0);

    let mut sim = SimulationManager::new(SimulationManagerCfg::default()).unwrap();
    sim.add_robot(kinetoscope_testkit::worlds::urdf_robot("robot", &file)).unwrap();
    let mut simulated: Vec<&str> = sim.diagnostics().iter().map(|d| d.message.as_str()).collect();
    let found = json["warnings"].as_array().unwrap();
    let mut reported: Vec<&str> = found.iter().map(|w| w["message"].as_str().unwrap()).collect();
    simulated.sort_unstable();
    reported.sort_unstable();
    assert_eq!(simulated, reported);

    let still = folder.urdf(&["<link name=\"base\"/>"]);
    assert_eq!(run(&[&still]).code, 0, "a fixed link needs no mass");
    assert_eq!(warnings(&report(&[&still, "--floating_base"]).1), ["robot.urdf:2: massless-link"]);
}

#[test]
fn broken_meshes() {
    let folder = Folder::new();
    folder.write("good.stl", TETRAHEDRON);
    folder.write("torn.stl", &TETRAHEDRON[..100]);
    folder.write("empty.stl", "");
    folder.write("no_triangles.stl", [0; 84]);
    folder.write("what.xyz", "hello");
    let mesh = |role: &str, file: &str| {
        let geometry = format!("<geometry><mesh filename=\"{file}\"/></geometry>");
        folder.urdf(&["<link name=\"base\">", &format!("<{role}>{geometry}</{role}></link>")])
    };
    for role in ["visual", "collision"] {
        assert_eq!(run(&[&mesh(role, "good.stl")]).code, 0, "{role}");
    }
    for (file, kind) in [
        ("nowhere.stl", "visual-mesh-missing"),
        ("torn.stl", "visual-mesh-invalid"),
        ("empty.stl", "visual-mesh-invalid"),
        ("no_triangles.stl", "visual-mesh-invalid"),
        ("what.xyz", "visual-mesh-invalid"),
    ] {
        let (code, json) = report(&[&mesh("visual", file)]);
        assert_eq!((code, warnings(&json)), (1, vec![format!("robot.urdf:3: {kind}")]), "{file}");
        let message = json["warnings"][0]["message"].as_str().unwrap();
        assert!(message.contains("\"base\"") && message.contains(file), "{message}");
        let refused = run(&[&mesh("collision", file)]);
        assert_eq!((refused.code, refused.out.as_str()), (2, ""), "{file}");
        assert!(refused.err.contains("robot.urdf:3: ") && refused.err.contains(file), "{}", refused.err);
    }
}

#[test]
fn packages() {
    let folder = Folder::new();
    folder.write("elsewhere/a.stl", TETRAHEDRON);
    let mesh = urdf::collision("<mesh filename=\"package://pkg/a.stl\"/>", [0.0; 3]);
    let file = folder.urdf(&[&format!("<link name=\"base\">{mesh}</link>")]);
    let elsewhere = folder.0.folder().join("elsewhere");
    assert_eq!(run(&[&file]).code, 2);
    assert_eq!(run(&[&file, "--package", &format!("pkg={}", elsewhere.display())]).code, 0);
    let wrong = run(&[&file, "--package", "pkg=no_such_folder"]);
    assert!(wrong.code == 2 && wrong.err.contains("no_such_folder is not a folder"), "{}", wrong.err);
}

#[test]
fn refusals() {
    let folder = Folder::new();
    let torn = folder.write("torn.urdf", "<robot name=\"torn\">\n  <link name=\"base\">\n");
    let two_roots = folder.write("roots.urdf", "<robot name=\"r\">\n<link name=\"a\"/>\n<link name=\"b\"/>\n</robot>");
    for (args, says) in [
        (vec![torn.as_str()], "torn.urdf:2: "),
        (vec![&two_roots], "roots.urdf:2"),
        (vec!["no_such_file.urdf"], "no_such_file.urdf: there is no such file"),
        (vec![], "FILE.urdf"),
        (vec![SR5, "--no-such-flag"], "--no-such-flag"),
        (vec![SR5, "--package", "x"], "NAME=DIR"),
        (vec![SR5, "--qpos", "JOINT1"], "NAME=VALUE"),
        (vec![SR5, "--qpos", "JOINT1=one"], "\"one\" is not a number (rad or m)"),
        (vec![SR5, "--qpos", "JOINT1=nan"], "not finite"),
        (vec![SR5, "--qpos", "JOINT1=1,JOINT1=2"], "two positions"),
        (vec![SR5, "--qpos", "joint2=1"], "unknown joint \"joint2\"; candidates: \"JOINT2\""),
        (vec![SR5, "--qpos", "EE_FIXED=1"], "is fixed"),
        (vec![SR5, "--json", "no/such/folder/report.json"], "no/such/folder/report.json"),
    ] {
        let run = run(&args);
        assert_eq!(run.code, 2, "{args:?}");
        assert!(run.err.contains(says) && run.out.is_empty(), "{args:?}: {}{}", run.out, run.err);
    }
    let help = run(&["--help"]);
    assert!(help.code == 0 && help.out.contains("--floating-base") && help.out.contains("Exit code"), "{}", help.out);
}

#[test]
fn text() {
    let folder = Folder::new();
    let json = folder.0.folder().join("report.json");
    let run = run(&[SR5, HAND, "--json", json.to_str().unwrap()]);
    assert_eq!(run.code, 0, "{}", run.err);
    assert_eq!([SR5, HAND].map(|file| self::run(&[file]).code), [0, 0]);
    for part in ["14.005 kg", "├─left_thumb_meta", "JOINT6", "LEFT_THUMB_DIP  = 1.05 * LEFT_HAND_THUMB1", "No warnings"]
    {
        assert!(run.out.contains(part), "{part}: {}", run.out);
    }
    assert!(run.out.lines().skip(1).all(|l| l.chars().count() <= 120), "{}", run.out);
    let written: Value = serde_json::from_str(&fs::read_to_string(json).unwrap()).unwrap();
    assert_eq!(written["robot"], "SR5_revo1_left");
}

/// Two joints in one body, a pendulum without spring that starts at 30 degrees, one follower by a linear and one by a
/// quadratic polynomial.
const MJCF: &str = r#"<mujoco><compiler angle="degree" autolimits="true"/><worldbody><body name="base"><geom size="0.1" mass="2"/>
  <body name="bar" pos="0 0 1"><joint name="turn" axis="0 0 1" armature="0.02"/>
    <joint name="swing" axis="0 1 0" ref="30" range="-90 90" armature="0.3"/>
    <inertial pos="0.5 0 0" mass="3" diaginertia="0.01 0.02 0.02"/></body>
  <body name="line"><joint name="line" axis="0 0 1"/><inertial pos="0 0 0" mass="0.5" diaginertia="0.01 0.01 0.01"/></body>
  <body name="curve"><joint name="curve" axis="0 0 1"/><inertial pos="0 0 0" mass="0.5" diaginertia="0.01 0.01 0.01"/></body>
  </body></worldbody><equality><joint joint1="line" joint2="turn" polycoef="0.1 2 0 0 0"/>
  <joint joint1="curve" joint2="turn" polycoef="0.1 0 3 0 0"/></equality></mujoco>"#;

/// Reference: MuJoCo with the file alone, its matrix of `mj_fullM`, which includes rotor inertias, and `qfrc_bias` at
/// rest.
#[test]
fn mjcf_file() {
    let folder = Folder::new();
    let file = folder.write("robot.xml", MJCF);
    let (code, json) = report(&[&file, "--qpos", "turn=0.4"]);
    assert_eq!(code, 1, "the unsupported equality is reported");
    assert_eq!(names(&json["joint_names"]), ["turn", "swing", "line", "curve"]);
    let qpos = [0.4, 30f64.to_radians(), 0.1 + 2.0 * 0.4, 0.1 + 3.0 * 0.16];
    assert_close("positions", numbers(&json["qpos"]), qpos, MUJOCO);
    assert!(json["files"][0].as_str().unwrap().ends_with("robot.xml"));
    let mut data = Data::new(&compile(MJCF, &[]).unwrap().into_model()).unwrap();
    data.qpos_mut().copy_from_slice(&qpos);
    data.forward().unwrap();
    let matrix = data.mass_matrix().unwrap();
    for (row, theirs) in json["mass_matrix"].as_array().unwrap().iter().zip(matrix.chunks(4)) {
        assert_close("row of the mass matrix", numbers(row), theirs, MUJOCO);
    }
    assert_close("gravity torque", numbers(&json["gravity_torque"]), data.qfrc_bias(), MUJOCO);
    assert!(data.qfrc_bias()[1].abs() > 10.0 && json["total_mass"].as_f64().unwrap() == 6.0);
    // Control: the rotor of the joint "swing" is about as heavy as its load, 0.02 + 3 · 0.5².
    assert!((matrix[5] - (0.3 + 0.02 + 0.75)).abs() < 1e-12, "{matrix:?}");
    // Positions of followers cannot be set.
    let (_, json) = report(&[&file, "--qpos", "turn=0.4,curve=0.2"]);
    assert_close("positions", numbers(&json["qpos"]), qpos, MUJOCO);
    assert!(warnings(&json).iter().any(|w| w.ends_with("mimic-position-ignored")), "{:?}", warnings(&json));
    // The bundled quadruped with a floating base, and invalid arguments.
    let (_, json) = report(&["quadruped/quadruped.xml", "--floating-base"]);
    assert!((json["total_mass"].as_f64().unwrap() - 52.135).abs() < 1e-3);
    assert_eq!(json["columns"].as_array().unwrap().len(), 6 + 12);
    for (args, says) in [
        (vec![file.as_str(), SR5], "an MJCF file cannot be combined with other files"),
        (vec!["no_such_file.xml"], "no_such_file.xml"),
        (vec![file.as_str(), "--package", "mine=."], "--package mine"),
        (vec![&folder.write("torn.xml", "<mujoco><worldbody>"), "--floating-base"], "torn.xml"),
    ] {
        let run = run(&args);
        assert!(run.code == 2 && run.err.contains(says) && run.out.is_empty(), "{args:?}: {}{}", run.out, run.err);
    }
}

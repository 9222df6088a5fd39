//! `add_robot` says what is wrong, and the simulation goes on as if it had not been asked.

use super::support::{INERTIAL, TETRAHEDRON, bits, cfg, hinge, hinge_with, robot};
use kinetoscope::prelude::*;
use std::fmt::Write as _;
use std::path::Path;

/// What is wrong, a robot that has it, and what the message says.
type Row = (&'static str, Box<dyn Fn(&Path) -> RobotCfg>, &'static [&'static str]);

fn change(change: fn(&mut RobotCfg)) -> Box<dyn Fn(&Path) -> RobotCfg> {
    Box::new(move |dir| {
        let mut cfg = robot(dir, "new", &hinge());
        change(&mut cfg);
        cfg
    })
}

fn text(urdf: String) -> Box<dyn Fn(&Path) -> RobotCfg> {
    Box::new(move |dir| robot(dir, "new", &urdf))
}

/// A link that collides by a mesh of this content.
fn mesh(file: &'static str, content: Vec<u8>) -> Box<dyn Fn(&Path) -> RobotCfg> {
    Box::new(move |dir| {
        std::fs::write(dir.join(file), &content).unwrap();
        let collision = format!("{INERTIAL}<collision><geometry><mesh filename=\"{file}\"/></geometry></collision>");
        robot(dir, "new", &hinge_with(&collision, "<limit effort=\"1\" velocity=\"1\"/>"))
    })
}

fn line() -> Vec<u8> {
    TETRAHEDRON.replace("vertex 0 0 0.1", "vertex 0.2 0 0").replace("vertex 0 0.1 0", "vertex 0.3 0 0").into_bytes()
}

fn stl_of_4_billion() -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend(u32::MAX.to_le_bytes());
    bytes.extend([0; 200]);
    bytes
}

fn chain(links: usize) -> String {
    let mut urdf = format!("<robot name=\"chain\"><link name=\"l0\">{INERTIAL}</link>");
    for i in 1..links {
        let _ = write!(
            urdf,
            "\n<link name=\"l{i}\">{INERTIAL}</link><joint name=\"j{i}\" type=\"continuous\"><parent link=\"l{}\"/>\
             <child link=\"l{i}\"/><axis xyz=\"0 1 0\"/></joint>",
            i - 1
        );
    }
    urdf + "</robot>"
}

fn drive(cfg: &mut RobotCfg, change: fn(&mut DriveCfg)) {
    change(&mut cfg.drive);
}

fn rows() -> Vec<Row> {
    let mut rows: Vec<Row> = vec![
        ("uid empty", change(|c| c.uid.clear()), &["uid \"\"", "1 to 64 characters"]),
        ("uid with slash", change(|c| c.uid = "a/b".into()), &["uid \"a/b\"", "no slash"]),
        ("uid with control character", change(|c| c.uid = "a\nb".into()), &["uid \"a\\nb\""]),
        ("uid too long", change(|c| c.uid = "x".repeat(65)), &["1 to 64"]),
        ("uid used", change(|c| c.uid = "first".into()), &["\"first\" is taken", "uid of its own"]),
        ("no file", change(|c| c.urdf = UrdfCfg::single("/no/such.urdf")), &["/no/such.urdf", "no such file"]),
        ("no component", change(|c| c.urdf.components.clear()), &["no component", "UrdfCfg::single"]),
        ("a folder", change(|c| c.urdf = UrdfCfg::single("/")), &["is a folder"]),
        ("base pose NaN", change(|c| c.init_pose.translation.x = f64::NAN), &["init_pose", "finite"]),
        ("base pose infinite", change(|c| c.init_pose.translation.z = f64::INFINITY), &["init_pose", "finite"]),
        (
            "base turned by nothing",
            change(|c| c.init_pose.rotation = nalgebra::Unit::new_unchecked(nalgebra::Quaternion::new(0., 0., 0., 0.))),
            &["init_pose", "unit quaternion"],
        ),
        (
            "control part matches nothing",
            change(|c| c.control_parts = vec![("arm".into(), vec!["HINGE".into()])]),
            &["control part \"arm\"", "\"HINGE\" matches no joint", "\"hinge\""],
        ),
        (
            "control part matches twice",
            change(|c| c.control_parts = vec![("arm".into(), vec!["hinge".into(), "h.*".into()])]),
            &["\"hinge\" is matched by both", "\"h.*\"", "disjoint"],
        ),
        (
            "look-around",
            change(|c| c.control_parts = vec![("arm".into(), vec!["(?=h).*".into()])]),
            &["look-around", "list the names"],
        ),
        (
            "back-reference",
            change(|c| c.control_parts = vec![("arm".into(), vec![r"(h)\1".into()])]),
            &["back-references"],
        ),
        ("no pattern", change(|c| c.control_parts = vec![("arm".into(), vec!["h(".into()])]), &["\"h(\"", "not a regular"]),
        (
            "huge pattern",
            change(|c| c.control_parts = vec![("arm".into(), vec!["(h{1000}){1000}{1000}".into()])]),
            &["pattern", "size"],
        ),
        (
            "two parts of one name",
            change(|c| {
                c.control_parts = vec![("arm".into(), vec!["hinge".into()]), ("arm".into(), vec!["h.*".into()])];
            }),
            &["control part \"arm\" is given twice"],
        ),
        (
            "init_qpos matches nothing",
            change(|c| c.init_qpos = vec![("joint1".into(), 0.0)]),
            &["init_qpos", "\"joint1\" matches no joint", "hinge"],
        ),
        (
            "init_qpos matches twice",
            change(|c| c.init_qpos = vec![("hinge".into(), 0.0), (".*".into(), 0.1)]),
            &["init_qpos", "matched by both"],
        ),
        ("init_qpos NaN", change(|c| c.init_qpos = vec![("hinge".into(), f64::NAN)]), &["init_qpos", "\"hinge\"", "NaN"]),
        ("init_qpos infinite", change(|c| c.init_qpos = vec![(".*".into(), f64::INFINITY)]), &["init_qpos", "inf"]),
        ("stiffness < 0", change(|c| drive(c, |d| d.stiffness = (-1.0).into())), &["stiffness", "-1", "\"new\""]),
        ("stiffness NaN", change(|c| drive(c, |d| d.stiffness = f64::NAN.into())), &["stiffness", "NaN"]),
        ("damping < 0", change(|c| drive(c, |d| d.damping = (-1e-300).into())), &["damping", "-0.000"]),
        ("damping infinite", change(|c| drive(c, |d| d.damping = f64::INFINITY.into())), &["damping", "inf"]),
        ("effort < 0", change(|c| drive(c, |d| d.max_effort = Some((-2.0).into()))), &["max_effort", "-2"]),
        ("effort NaN", change(|c| drive(c, |d| d.max_effort = Some(f64::NAN.into()))), &["max_effort", "NaN"]),
        ("friction < 0", change(|c| drive(c, |d| d.friction = Some((-2.0).into()))), &["friction", "-2"]),
        ("armature NaN", change(|c| drive(c, |d| d.armature = f64::NAN.into())), &["armature", "NaN"]),
        (
            "drive pattern matches nothing",
            change(|c| drive(c, |d| d.stiffness = [("J[1-6]", 1.0)].into())),
            &["drive property stiffness", "\"J[1-6]\" matches no joint", "hinge"],
        ),
        (
            "collision mesh missing",
            text(hinge_with(
                &format!("{INERTIAL}<collision><geometry><mesh filename=\"no/such.stl\"/></geometry></collision>"),
                "<limit effort=\"1\" velocity=\"1\"/>",
            )),
            &["robot.urdf:3", "link \"arm\"", "no/such.stl", "does not exist", "looked at"],
        ),
        ("collision mesh empty", mesh("m.stl", Vec::new()), &["robot.urdf:3", "\"arm\"", "m.stl"]),
        ("collision mesh truncated", mesh("m.stl", stl_of_4_billion()[..100].to_vec()), &["m.stl", "ends early"]),
        ("4 billion triangles", mesh("m.stl", stl_of_4_billion()), &["m.stl", "robot.urdf:3"]),
        ("collision mesh a line", mesh("m.stl", line()), &["m.stl", "no convex hull", "on a line"]),
        ("collision mesh a point", mesh("m.stl", TETRAHEDRON.replace("0.1", "0").into_bytes()), &["m.stl", "1 points; a hull needs at least 4"]),
        ("collision mesh of nonsense", mesh("m.obj", b"v 1 2\nf 1 2 3\n".to_vec()), &["m.obj", "line 1"]),
        ("mesh of no known kind", mesh("m.xyz", b"?".to_vec()), &["m.xyz", "unknown mesh format"]),
        (
            "sphere of nothing",
            text(hinge_with(
                &format!("{INERTIAL}<collision><geometry><sphere radius=\"0\"/></geometry></collision>"),
                "<limit effort=\"1\" velocity=\"1\"/>",
            )),
            &["robot.urdf:3", "link \"arm\"", "radius"],
        ),
        (
            "box of nothing",
            text(hinge_with(
                &format!("{INERTIAL}<collision><geometry><box size=\"1 0 1\"/></geometry></collision>"),
                "<limit effort=\"1\" velocity=\"1\"/>",
            )),
            &["robot.urdf:3", "link \"arm\"", "size"],
        ),
        ("chain too deep", text(chain(600)), &["robot.urdf:", "moving bodies below the root", "fixed joints"]),
        ("name of joint used twice", text(hinge().replace("</robot>", "<joint name=\"hinge\" type=\"fixed\"><parent link=\"arm\"/><child link=\"x\"/></joint><link name=\"x\"/></robot>")), &["second joint named \"hinge\""]),
    ];
    for kind in ["stiffness", "damping", "max_effort", "friction", "armature"] {
        rows.push((
            kind,
            Box::new(move |dir| {
                let twice: PerJoint = [("hinge", 1.0), ("h.*", 2.0)].into();
                let mut cfg = robot(dir, "new", &hinge());
                match kind {
                    "stiffness" => cfg.drive.stiffness = twice,
                    "damping" => cfg.drive.damping = twice,
                    "max_effort" => cfg.drive.max_effort = Some(twice),
                    "friction" => cfg.drive.friction = Some(twice),
                    _ => cfg.drive.armature = twice,
                }
                cfg
            }),
            &["drive property", "\"hinge\" is matched by both", "\"h.*\""],
        ));
    }
    rows
}

fn moving(dir: &Path) -> SimulationManager {
    let mut sim = SimulationManager::new(cfg(2)).unwrap();
    let first = sim.add_robot(robot(dir, "first", &hinge())).unwrap();
    sim.robot_mut(first).set_qpos(&kinetoscope::ndarray::array![[0.8], [-0.5]], None, None).unwrap();
    sim.update(4);
    sim
}

#[test]
fn a_refused_robot_leaves_the_simulation_as_it_was() {
    let base = tempfile::tempdir().unwrap();
    let (mut sim, mut calm) = (moving(base.path()), moving(base.path()));
    let mut wrong = Vec::new();
    for (what, build, expected) in rows() {
        let dir = tempfile::tempdir().unwrap();
        let robot = build(dir.path());
        let before = (bits(&sim), sim.mjcf().to_owned(), sim.diagnostics().len(), sim.warning_counts());
        match sim.add_robot(robot) {
            Ok(_) => {
                wrong.push(format!("{what}: was accepted"));
                sim = moving(base.path());
                calm = moving(base.path());
                continue;
            }
            Err(error) => {
                let message = error.to_string();
                for part in expected {
                    if !message.contains(part) {
                        wrong.push(format!("{what}: {part:?} is not in {message:?}"));
                    }
                }
                assert!(message.len() < 4000, "{what}: {} characters", message.len());
            }
        }
        assert_eq!(
            before,
            (bits(&sim), sim.mjcf().to_owned(), sim.diagnostics().len(), sim.warning_counts()),
            "{what}"
        );
        sim.update(2);
        calm.update(2);
        assert_eq!(bits(&sim), bits(&calm), "{what}: the simulation goes on");
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn thirty_robots_are_the_most() {
    let dir = tempfile::tempdir().unwrap();
    let ball = format!(
        "<robot name=\"b\"><link name=\"b\">{INERTIAL}<collision><geometry><sphere radius=\"0.1\"/></geometry></collision>\
         </link></robot>"
    );
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    let mut refused = 0;
    for i in 0..100 {
        let mut cfg = robot(dir.path(), &format!("r{i}"), &ball);
        cfg.fix_base = false;
        // In pairs, one above the other: each robot collides with the ground and with others.
        cfg.init_pose = Pose::translation(f64::from(i / 2), 0.0, 0.1 + 0.2 * f64::from(i % 2));
        match sim.add_robot(cfg) {
            Ok(_) => assert!(i < 30),
            Err(error) => {
                assert!(i >= 30, "{error}");
                assert!(error.to_string().contains("30 robots and articulations are the most"), "{error}");
                refused += 1;
            }
        }
    }
    assert_eq!(refused, 70);
    sim.update(100);
    for i in 0..30 {
        let id = sim.robot_id(&format!("r{i}")).unwrap();
        let z = sim.robot(id).link_pose("b").unwrap()[(0, 2)];
        let rest = 0.1 + 0.2 * f64::from(i % 2);
        assert!((z - rest).abs() < 0.01, "robot {i} is at {z}");
    }
    assert!(sim.diverged().is_empty());
    let message = sim.robot_id("r99").unwrap_err().to_string();
    assert!(message.contains("no robot \"r99\"") && message.contains("\"r0\""), "{message}");
}

#[test]
fn a_chain_as_deep_as_allowed_works() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim =
        SimulationManager::new(SimulationManagerCfg { gravity: nalgebra::Vector3::zeros(), ..cfg(1) }).unwrap();
    let id = sim.add_robot(robot(dir.path(), "chain", &chain(kinetoscope::sim::mjcf::MAX_BODY_DEPTH))).unwrap();
    sim.update(2);
    assert_eq!(sim.robot(id).dof(), kinetoscope::sim::mjcf::MAX_BODY_DEPTH - 1);
    assert!(sim.diverged().is_empty(), "{:?}", sim.diverged());
    // Fixed links count nothing.
    let fixed = chain(3000).replace("continuous", "fixed");
    sim.add_robot(robot(dir.path(), "rigid", &fixed)).unwrap();
    sim.update(1);
}

//! `add_robot` reports mistakes and leaves the simulation unchanged.

use super::support::{INERTIAL, TETRAHEDRON, ball, bits, cfg, chain, hinge, hinge_with, robot, sim};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::sim::PerJoint;
use kinetoscope::sim::mjcf::MAX_BODY_DEPTH;
use std::path::Path;

type Make = Box<dyn Fn(&Path) -> RobotCfg>;

/// A mistake, a robot with it, and parts of the message.
type Row = (&'static str, Make, &'static [&'static str]);

fn change(change: fn(&mut RobotCfg)) -> Make {
    Box::new(move |dir| {
        let mut cfg = robot(dir, "new", &hinge());
        change(&mut cfg);
        cfg
    })
}

fn twice() -> PerJoint {
    [("hinge", 1.0), ("h.*", 2.0)].into()
}

fn drive(change: fn(&mut DriveCfg)) -> Make {
    Box::new(move |dir| {
        let mut cfg = robot(dir, "new", &hinge());
        change(&mut cfg.drive);
        cfg
    })
}

fn parts(parts: &'static [(&'static str, &'static [&'static str])]) -> Make {
    Box::new(move |dir| {
        let part = |&(name, patterns): &(&str, &[&str])| (name.into(), patterns.iter().map(|p| (*p).into()).collect());
        RobotCfg { control_parts: parts.iter().map(part).collect(), ..robot(dir, "new", &hinge()) }
    })
}

fn init(qpos: &'static [(&'static str, f64)]) -> Make {
    Box::new(move |dir| {
        let init_qpos = qpos.iter().map(|&(name, q)| (name.into(), q)).collect();
        RobotCfg { init_qpos, ..robot(dir, "new", &hinge()) }
    })
}

fn text(urdf: String) -> Make {
    Box::new(move |dir| robot(dir, "new", &urdf))
}

/// A link with this collision geometry, in line 3.
fn collides(geometry: &str) -> Make {
    let link = format!("{INERTIAL}<collision><geometry>{geometry}</geometry></collision>");
    text(hinge_with(&link, "<limit effort=\"1\" velocity=\"1\"/>"))
}

/// A link with a collision mesh of this content.
fn mesh(file: &'static str, content: impl Into<Vec<u8>>) -> Make {
    let (content, made) = (content.into(), collides(&format!("<mesh filename=\"{file}\"/>")));
    Box::new(move |dir| {
        std::fs::write(dir.join(file), &content).unwrap();
        made(dir)
    })
}

fn rows() -> Vec<Row> {
    let line = TETRAHEDRON.replace("vertex 0 0 0.1", "vertex 0.2 0 0").replace("vertex 0 0.1 0", "vertex 0.3 0 0");
    let point = TETRAHEDRON.replace("0.1", "0");
    let billions = [&[0; 80][..], &u32::MAX.to_le_bytes(), &[0; 200]].concat();
    let again =
        "<joint name=\"hinge\" type=\"fixed\"><parent link=\"arm\"/><child link=\"x\"/></joint><link name=\"x\"/>";
    let again = hinge().replace("</robot>", &format!("{again}</robot>"));
    let no_turn = |c: &mut RobotCfg| {
        c.init_pose.rotation = nalgebra::Unit::new_unchecked(nalgebra::Quaternion::new(0., 0., 0., 0.));
    };
    const TWICE: &[&str] = &["drive property", "\"hinge\" is matched by both", "\"h.*\""];
    vec![
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
        ("base turned by nothing", change(no_turn), &["init_pose", "unit quaternion"]),
        (
            "control part matches nothing",
            parts(&[("arm", &["HINGE"])]),
            &["control part \"arm\"", "\"HINGE\" matches no joint", "\"hinge\""],
        ),
        (
            "control part matches twice",
            parts(&[("arm", &["hinge", "h.*"])]),
            &["\"hinge\" is matched by both", "\"h.*\"", "disjoint"],
        ),
        ("look-around", parts(&[("arm", &["(?=h).*"])]), &["look-around", "list the names"]),
        ("back-reference", parts(&[("arm", &[r"(h)\1"])]), &["back-references"]),
        ("no pattern", parts(&[("arm", &["h("])]), &["\"h(\"", "not a regular"]),
        ("huge pattern", parts(&[("arm", &["(h{1000}){1000}{1000}"])]), &["pattern", "size"]),
        (
            "two parts of a name",
            parts(&[("arm", &["hinge"]), ("arm", &["h.*"])]),
            &["control part \"arm\" is given twice"],
        ),
        ("qpos matches nothing", init(&[("joint1", 0.0)]), &["init_qpos", "\"joint1\" matches no joint", "hinge"]),
        ("qpos matches twice", init(&[("hinge", 0.0), (".*", 0.1)]), &["init_qpos", "matched by both"]),
        ("qpos NaN", init(&[("hinge", f64::NAN)]), &["init_qpos", "\"hinge\"", "NaN"]),
        ("qpos infinite", init(&[(".*", f64::INFINITY)]), &["init_qpos", "inf"]),
        ("stiffness < 0", drive(|d| d.stiffness = (-1.0).into()), &["stiffness", "-1", "\"new\""]),
        ("stiffness NaN", drive(|d| d.stiffness = f64::NAN.into()), &["stiffness", "NaN"]),
        ("damping < 0", drive(|d| d.damping = (-1e-300).into()), &["damping", "-0.000"]),
        ("damping infinite", drive(|d| d.damping = f64::INFINITY.into()), &["damping", "inf"]),
        ("effort < 0", drive(|d| d.max_effort = Some((-2.0).into())), &["max_effort", "-2"]),
        ("effort NaN", drive(|d| d.max_effort = Some(f64::NAN.into())), &["max_effort", "NaN"]),
        ("friction < 0", drive(|d| d.friction = Some((-2.0).into())), &["friction", "-2"]),
        ("armature NaN", drive(|d| d.armature = f64::NAN.into()), &["armature", "NaN"]),
        (
            "drive pattern matches nothing",
            drive(|d| d.stiffness = [("J[1-6]", 1.0)].into()),
            &["drive property stiffness", "\"J[1-6]\" matches no joint", "hinge"],
        ),
        ("stiffness twice", drive(|d| d.stiffness = twice()), TWICE),
        ("damping twice", drive(|d| d.damping = twice()), TWICE),
        ("max_effort twice", drive(|d| d.max_effort = Some(twice())), TWICE),
        ("friction twice", drive(|d| d.friction = Some(twice())), TWICE),
        ("armature twice", drive(|d| d.armature = twice()), TWICE),
        (
            "mesh missing",
            collides("<mesh filename=\"no/such.stl\"/>"),
            &["robot.urdf:3", "link \"arm\"", "no/such.stl", "does not exist", "searched"],
        ),
        ("mesh empty", mesh("m.stl", ""), &["robot.urdf:3", "\"arm\"", "m.stl"]),
        ("mesh truncated", mesh("m.stl", &billions[..100]), &["m.stl", "ends early"]),
        ("4 billion triangles", mesh("m.stl", billions), &["m.stl", "robot.urdf:3"]),
        ("mesh a line", mesh("m.stl", line), &["m.stl", "no convex hull", "the points are collinear"]),
        ("mesh a point", mesh("m.stl", point), &["m.stl", "1 points; a hull needs at least 4"]),
        ("mesh of nonsense", mesh("m.obj", "v 1 2\nf 1 2 3\n"), &["m.obj", "line 1"]),
        ("mesh of no known kind", mesh("m.xyz", "?"), &["m.xyz", "unknown mesh format"]),
        ("sphere of negative size", collides("<sphere radius=\"-1\"/>"), &["robot.urdf:3", "link \"arm\"", "radius"]),
        ("box of negative size", collides("<box size=\"1 -1 1\"/>"), &["robot.urdf:3", "link \"arm\"", "size"]),
        (
            "too deep",
            text(chain(600, "continuous", "")),
            &["robot.urdf:", "moving bodies below the root", "fixed joints"],
        ),
        ("name of joint used twice", text(again), &["second joint named \"hinge\""]),
    ]
}

fn moving(dir: &Path) -> SimulationManager {
    let mut sim = sim(2);
    let first = sim.add_robot(robot(dir, "first", &hinge())).unwrap();
    sim.robot_mut(first).set_qpos_target(&array![[0.8], [-0.5]], None, None).unwrap();
    sim.update(4);
    sim
}

#[test]
fn robots() {
    let dir = tempfile::tempdir().unwrap();
    let (mut sim, mut calm) = (moving(dir.path()), moving(dir.path()));
    let mut wrong = Vec::new();
    let state = |sim: &SimulationManager| {
        (bits(sim), sim.scene().mjcf().to_owned(), sim.diagnostics().len(), sim.warnings().counts())
    };
    for (what, make, expected) in rows() {
        let dir = tempfile::tempdir().unwrap();
        let before = state(&sim);
        let Err(error) = sim.add_robot(make(dir.path())) else { panic!("{what}: accepted") };
        let message = error.to_string();
        wrong.extend(
            expected.iter().filter(|part| !message.contains(**part)).map(|part| (what, *part, message.clone())),
        );
        assert!(message.len() < 4000, "{what}: {} characters", message.len());
        assert_eq!(before, state(&sim), "{what}");
        sim.update(2);
        calm.update(2);
        assert_eq!(bits(&sim), bits(&calm), "{what}: the simulation continues");
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn more_than_thirty_robots() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = sim(1);
    for i in 0..100 {
        // In pairs, one above the other: each robot collides with the ground and with others.
        let init_pose = Pose::translation(f64::from(i / 2), 0.0, 0.1 + 0.2 * f64::from(i % 2));
        let cfg = RobotCfg { fix_base: false, init_pose, ..robot(dir.path(), &format!("r{i}"), &ball()) };
        let added = sim.add_robot(cfg);
        assert_eq!(added.is_ok(), i < 30, "{i}");
        if let Err(error) = added {
            assert!(error.to_string().contains("at most 30 robots and articulations"), "{error}");
        }
    }
    sim.update(100);
    for i in 0..30 {
        let id = sim.entities().robot_id(&format!("r{i}")).unwrap();
        let z = sim.robot(id).link_pose("ball").unwrap()[(0, 2)];
        let rest = 0.1 + 0.2 * f64::from(i % 2);
        assert!((z - rest).abs() < 0.01, "robot {i} is at {z}");
    }
    assert!(sim.diverged().is_empty());
    let message = sim.entities().robot_id("r99").unwrap_err().to_string();
    assert!(message.contains("unknown robot \"r99\"") && message.contains("\"r0\""), "{message}");
}

#[test]
fn deepest_chain() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim =
        kinetoscope_testkit::worlds::sim(SimulationManagerCfg { gravity: nalgebra::Vector3::zeros(), ..cfg(1) });
    let id = sim.add_robot(robot(dir.path(), "chain", &chain(MAX_BODY_DEPTH, "continuous", ""))).unwrap();
    sim.update(2);
    assert_eq!(sim.robot(id).dof(), MAX_BODY_DEPTH - 1);
    assert!(sim.diverged().is_empty(), "{:?}", sim.diverged());
    // Fixed links do not count.
    sim.add_robot(robot(dir.path(), "rigid", &chain(3000, "fixed", ""))).unwrap();
    sim.update(1);
}

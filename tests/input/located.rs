//! An error of MuJoCo's compiler names the place in the user's file that produced the line of the MJCF.

use super::support::{INERTIAL, TETRAHEDRON, hinge_with, robot, sim};
use kinetoscope::mujoco::{BUILD_VERSION, LoadError, compile};
use kinetoscope::prelude::*;
use kinetoscope::scene::source_location::SourceLocation;
use kinetoscope::sim::Integrator;
use kinetoscope::sim::mjcf::document::{
    Body, FrictionCone, Geom, GeomRole, Inertial, Joint, JointType, Mjcf, PhysicsOption, Shape,
};
use kinetoscope::sim::mjcf::write::write;
use nalgebra::{UnitQuaternion, Vector3};

/// A body with a hinge and a sphere; each element has its own source line.
fn document() -> Mjcf {
    let at = |line| Some(SourceLocation::new("robot.urdf", line));
    let option = PhysicsOption {
        timestep: 0.01,
        gravity: Vector3::zeros(),
        integrator: Integrator::Euler,
        cone: FrictionCone::Pyramidal,
        impratio: 1.0,
        iterations: 10,
        friction: [1.0, 0.0, 0.0],
    };
    let inertial = Inertial {
        mass: 1.0,
        com: Vector3::zeros(),
        axes: UnitQuaternion::identity(),
        moments: Vector3::repeat(1.0),
        source: at(21),
    };
    let joint = Joint {
        name: "r/joint".into(),
        kind: JointType::Hinge,
        axis: Vector3::z(),
        range: Some([-1.0, 1.0]),
        damping: 0.0,
        frictionloss: 0.0,
        armature: 0.0,
        source: at(22),
    };
    let geom = Geom {
        name: Some("r/geom".into()),
        shape: Shape::Sphere(0.1),
        pose: Pose::identity(),
        role: GeomRole::Visual,
        friction: None,
        surface: None,
        rgba: None,
        material: None,
        source: at(23),
    };
    let mut mjcf = Mjcf::new("test", option);
    mjcf.bodies.push(Body {
        name: "r/link".into(),
        parent: 0,
        pose: Pose::identity(),
        inertial: Some(inertial),
        joints: vec![joint],
        mocap: false,
        geoms: vec![geom],
        sites: Vec::new(),
        source: at(20),
    });
    mjcf
}

type Row = (&'static str, fn(&mut Body), u32);

const ROWS: &[Row] = &[
    ("sphere of no radius", |b| b.geoms[0].shape = Shape::Sphere(0.0), 23),
    ("box of negative size", |b| b.geoms[0].shape = Shape::Box([1.0, -1.0, 1.0]), 23),
    ("mesh that is not there", |b| b.geoms[0].shape = Shape::Mesh("none".into()), 23),
    ("material that is not there", |b| b.geoms[0].material = Some("none".into()), 23),
    ("range in the wrong order", |b| b.joints[0].range = Some([1.0, -1.0]), 22),
    ("axis of nothing", |b| b.joints[0].axis = Vector3::zeros(), 22),
    ("second joint is free", |b| b.joints.push(Joint { kind: JointType::Free, ..b.joints[0].clone() }), 22),
    ("moments of no body", |b| b.inertial.as_mut().unwrap().moments = Vector3::new(1.0, 1.0, 5.0), 20),
];

#[test]
fn elements() {
    assert!(compile(&write(&document(), BUILD_VERSION).xml, &[]).is_ok());
    for (what, change, line) in ROWS {
        let mut mjcf = document();
        change(&mut mjcf.bodies[1]);
        let text = write(&mjcf, BUILD_VERSION);
        let Err(LoadError::Compile(error)) = compile(&text.xml, &[]) else { panic!("{what}: accepted") };
        let message = text.locate(error).to_string();
        let expected = format!("robot.urdf:{line}: MuJoCo rejected the model: ");
        // Depending on its version, MuJoCo reads the mass properties with the body or with the inertial element.
        let near = *line == 20 && message.starts_with("robot.urdf:21: ");
        assert!(near || message.starts_with(&expected), "{what}: {message}");
    }
}

/// MuJoCo may refuse robots that pass our checks: the message names the file and the line.
#[test]
fn whole_robots() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("t.stl"), TETRAHEDRON).unwrap();
    let mesh = |scale: &str| format!("<geometry><mesh filename=\"t.stl\" scale=\"{scale}\"/></geometry>");
    for collision in [
        mesh("1e9 1e9 1e9"),
        mesh("1e15 1e15 1e15"),
        mesh("1e-12 1e-12 1e-12"),
        mesh("1e18 1e-18 1"),
        "<geometry><sphere radius=\"1e308\"/></geometry>".into(),
        "<geometry><box size=\"1e-320 1e-320 1e-320\"/></geometry>".into(),
        "<origin xyz=\"1e308 0 0\"/><geometry><box size=\"1 1 1\"/></geometry>".into(),
    ] {
        let link = format!("{INERTIAL}\n<collision>{collision}</collision>");
        let urdf = hinge_with(&link, "<limit effort=\"1\" velocity=\"1\"/>");
        let mut sim = sim(1);
        match sim.add_robot(robot(dir.path(), "r", &urdf)) {
            Ok(_) => sim.update(3),
            Err(error) => assert!(error.to_string().contains("robot.urdf:4"), "{collision}: {error}"),
        }
    }
}

//! Where MuJoCo refuses a model, the message names the place in the user's file that caused the line of the MJCF.

use kinetoscope::prelude::*;
use kinetoscope::sim::mj::{LoadError, TARGET, compile};
use kinetoscope::sim::mjcf::document::{
    Body, Cone, Geom, GeomRole, Inertial, Joint, JointType, Mjcf, PhysicsOption, Shape,
};
use kinetoscope::sim::mjcf::write::write;
use kinetoscope::sim::source::Source;
use nalgebra::{UnitQuaternion, Vector3};

fn at(line: u32) -> Option<Source> {
    Some(Source::new("robot.urdf", line))
}

/// A body with a hinge and a sphere; each element has a line of its own.
fn document() -> Mjcf {
    let option = PhysicsOption {
        timestep: 0.01,
        gravity: Vector3::zeros(),
        integrator: Integrator::Euler,
        cone: Cone::Pyramidal,
        impratio: 1.0,
        iterations: 10,
        friction: [1.0, 0.0, 0.0],
    };
    let mut mjcf = Mjcf::new("test", option);
    mjcf.bodies.push(Body {
        name: "r/link".into(),
        parent: 0,
        pose: Pose::identity(),
        inertial: Some(Inertial {
            mass: 1.0,
            com: Vector3::zeros(),
            axes: UnitQuaternion::identity(),
            moments: Vector3::new(1.0, 1.0, 1.0),
            source: at(21),
        }),
        joints: vec![Joint {
            name: "r/joint".into(),
            kind: JointType::Hinge,
            axis: Vector3::z(),
            range: Some([-1.0, 1.0]),
            damping: 0.0,
            frictionloss: 0.0,
            armature: 0.0,
            source: at(22),
        }],
        mocap: false,
        geoms: vec![Geom {
            name: Some("r/geom".into()),
            shape: Shape::Sphere(0.1),
            pose: Pose::identity(),
            role: GeomRole::Visual,
            friction: None,
            surface: None,
            rgba: None,
            material: None,
            source: at(23),
        }],
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
    (
        "free joint in a body that has one",
        |b| b.joints.push(Joint { kind: JointType::Free, ..b.joints[0].clone() }),
        22,
    ),
    ("moments of no body", |b| b.inertial.as_mut().unwrap().moments = Vector3::new(1.0, 1.0, 5.0), 20),
];

#[test]
fn mujocos_refusals_name_the_line_of_the_urdf() {
    assert!(compile(&write(&document(), TARGET).xml, &[]).is_ok());
    let mut wrong = Vec::new();
    for (what, change, line) in ROWS {
        let mut mjcf = document();
        change(&mut mjcf.bodies[1]);
        let text = write(&mjcf, TARGET);
        let Err(LoadError::Compile(error)) = compile(&text.xml, &[]) else {
            wrong.push(format!("{what}: accepted"));
            continue;
        };
        let located = text.locate(error);
        let message = located.to_string();
        let expected = format!("robot.urdf:{line}: MuJoCo refuses the model: ");
        // The mass properties of a body are read with the body or with the element, depending on the version.
        let near = *line == 20 && message.starts_with("robot.urdf:21: ");
        if !message.starts_with(&expected) && !near {
            wrong.push(format!("{what}: {message}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Robots that pass our checks and MuJoCo refuses: if there are any, they name the file and the line.
#[test]
fn refusals_of_whole_robots_name_the_line() {
    let dir = tempfile::tempdir().unwrap();
    let mut refused = 0;
    for link in [
        "<collision><geometry><mesh filename=\"t.stl\" scale=\"1e9 1e9 1e9\"/></geometry></collision>",
        "<collision><geometry><mesh filename=\"t.stl\" scale=\"1e15 1e15 1e15\"/></geometry></collision>",
        "<collision><geometry><mesh filename=\"t.stl\" scale=\"1e-12 1e-12 1e-12\"/></geometry></collision>",
        "<collision><geometry><mesh filename=\"t.stl\" scale=\"1e18 1e-18 1\"/></geometry></collision>",
        "<collision><geometry><sphere radius=\"1e308\"/></geometry></collision>",
        "<collision><geometry><box size=\"1e-320 1e-320 1e-320\"/></geometry></collision>",
        "<collision><origin xyz=\"1e308 0 0\"/><geometry><box size=\"1 1 1\"/></geometry></collision>",
    ] {
        std::fs::write(dir.path().join("t.stl"), super::support::TETRAHEDRON).unwrap();
        let link = format!("{}\n{link}", super::support::INERTIAL);
        let urdf = super::support::hinge_with(&link, "<limit effort=\"1\" velocity=\"1\"/>");
        let mut sim = SimulationManager::new(super::support::cfg(1)).unwrap();
        match sim.add_robot(super::support::robot(dir.path(), "r", &urdf)) {
            Ok(_) => sim.update(3),
            Err(error) => {
                refused += 1;
                let message = error.to_string();
                assert!(message.contains("robot.urdf:4"), "{link}: {message}");
            }
        }
    }
    println!("{refused} refused");
}

//! Refused configurations, mesh files and writes: the error names them, and nothing changes. Mistakes common to all
//! writers are in `tests/input/every_writer.rs`.

use super::*;
use kinetoscope::mujoco::ObjectKind;
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::scene::mesh::HullCfg;
use kinetoscope::sim::{Error, Result, WrenchFrame};
use kinetoscope_testkit::error_tables::{assert_error, assert_errors, assert_errors_unchanged};

#[test]
fn configurations() {
    let mut sim = empty(1);
    let cube = || object("o", ObjectShape::cube(0.1), [0.0; 3]);
    let (nan, infinite) = (f64::NAN, f64::INFINITY);
    let rows = [
        ("shape", RigidObjectCfg { shape: ObjectShape::Cone { radius: 0.0, height: 1.0 }, ..cube() }),
        ("shape", RigidObjectCfg { shape: ObjectShape::Cone { radius: 1.0, height: nan }, ..cube() }),
        ("center_of_mass", RigidObjectCfg { center_of_mass: Some([0.0, infinite, 0.0]), ..cube() }),
        ("inertia", RigidObjectCfg { inertia: Some([1.0, 1.0, 3.0]), ..cube() }),
        ("inertia", RigidObjectCfg { inertia: Some([1.0, 0.0, 1.0]), ..cube() }),
        ("inertia", RigidObjectCfg { inertia: Some([1.0, nan, 1.0]), ..cube() }),
        // Decided by the last bit: 0.237 + 0.694 is below 0.931 in double precision, while twice 0.931 is not above the
        // sum.
        ("inertia", RigidObjectCfg { inertia: Some([0.237, 0.694, 0.931]), ..cube() }),
        ("mass", RigidObjectCfg { mass: Some(-1.0), ..cube() }),
        ("mass", RigidObjectCfg { mass: Some(0.0), ..cube() }),
        ("mass", fixed(RigidObjectCfg { mass: Some(nan), ..cube() })),
        ("mass", kinematic(RigidObjectCfg { mass: Some(-1.0), ..cube() })),
        ("linear_damping", RigidObjectCfg { linear_damping: -1.0, ..cube() }),
        ("angular_damping", RigidObjectCfg { angular_damping: infinite, ..cube() }),
        ("linear_damping", kinematic(RigidObjectCfg { linear_damping: 1.0, ..cube() })),
        ("restitution", RigidObjectCfg { restitution: Some(0.1), ..cube() }),
        ("restitution", RigidObjectCfg { restitution: Some(1.1), ..cube() }),
        ("restitution", RigidObjectCfg { restitution: Some(nan), ..cube() }),
        ("contact_margin", RigidObjectCfg { contact_margin: -1e-3, ..cube() }),
        ("shape", RigidObjectCfg { shape: ObjectShape::cube(0.0), ..cube() }),
        ("shape", RigidObjectCfg { shape: ObjectShape::Sphere { radius: nan }, ..cube() }),
        ("density", RigidObjectCfg { density: 0.0, ..cube() }),
        ("friction", RigidObjectCfg { friction: Some([-1.0, 0.0, 0.0]), ..cube() }),
        ("rgba", RigidObjectCfg { rgba: [2.0, 0.0, 0.0, 1.0], ..cube() }),
    ];
    let variant = |field| format!("Config {{ field: {field:?}");
    assert_errors(rows.map(|(field, cfg)| (field, sim.add_rigid_object(cfg), variant(field), [])));
    for uid in ["world", "a/b"] {
        assert!(sim.add_rigid_object(object(uid, ObjectShape::cube(0.1), [0.0; 3])).is_err(), "{uid}");
    }
    // Control: the unmodified configuration is valid.
    sim.add_rigid_object(cube()).unwrap();
}

#[test]
fn mesh_files() {
    let files = TempFiles::default();
    let good = obj(&files, "b.obj", &brick([0.5, 0.5, 0.5], [0.0; 3]));
    let (text, absent) = (files.write("t.obj", "v 0 0 0\nf 1 2 3\n"), files.folder().join("none.stl"));
    let few = HullCfg { max_vertices: 3, ..Default::default() };
    let mut sim = empty(1);
    let mut add = |path: &std::path::Path, scale, hull: HullCfg| {
        let shape = ObjectShape::Mesh { path: path.into(), scale, hull };
        sim.add_rigid_object(object("o", shape, [0.0; 3]))
    };
    let (mesh, hull) = ("ObjectMesh { object: \"o\"", HullCfg::default());
    assert_errors([
        ("absent", add(&absent, [1.0; 3], hull), mesh, &["none.stl"][..]),
        ("no index", add(&text, [1.0; 3], hull), mesh, &["t.obj"]),
        ("no solid", add(&good, [1.0; 3], few), mesh, &["max_vertices"]),
        ("flat", add(&good, [1.0, 0.0, 1.0], hull), "Config { field: \"shape\"", &[]),
        ("NaN", add(&good, [1.0, f64::NAN, 1.0], hull), "Config { field: \"shape\"", &[]),
    ]);
    add(&good, [1.0; 3], hull).unwrap();
}

#[test]
fn writes() {
    let mut sim = empty(3);
    let cube = |uid| object(uid, ObjectShape::cube(0.1), [0.0; 3]);
    let [free, hand, stands] =
        [cube("free"), kinematic(cube("hand")), fixed(cube("fixed"))].map(|cfg| sim.add_rigid_object(cfg).unwrap());
    let (velocity, zeros) = (array![[1.0; 6]], array![[0.0; 3]]);
    let wrench = sim.rigid_object_mut(hand).set_external_wrench(&zeros, &zeros, WrenchFrame::World, None);
    let results = [
        ("write_velocity", sim.rigid_object_mut(hand).write_velocity(&velocity, None)),
        ("set_mass", sim.rigid_object_mut(hand).set_mass(&array![1.0], None)),
        ("set_inertia", sim.rigid_object_mut(stands).set_inertia(&array![[1.0; 3]], None)),
        ("set_center_of_mass", sim.rigid_object_mut(stands).set_center_of_mass(&array![[1.0; 3]], None)),
        ("set_external_wrench", wrench),
    ];
    let variant = |argument| format!("NotDynamic {{ argument: {argument:?}");
    assert_errors(results.map(|(argument, result)| (argument, result, variant(argument), [])));
    assert_error(sim.rigid_object_mut(stands).write_velocity(&velocity, None), "FixedBody(\"fixed\")", &[]);
    // Poses of objects of every type; the wrench error names one of its two tables.
    let twice = Some(&[EnvId(2), EnvId(0), EnvId(2)][..]);
    let rows = |columns| Array2::from_elem((3, columns), 1.0);
    let repeated = |result: Result<()>, called: &str| match result {
        Err(Error::RepeatedItem { argument, item, first: 0, second: 2 }) => {
            assert_eq!((argument, item.as_str()), (called, "environment 2"));
        }
        other => panic!("{called}: {other:?}"),
    };
    for id in [free, hand, stands] {
        let mut object = sim.rigid_object_mut(id);
        repeated(object.write_pose(&rows(7), twice), "write_pose");
        assert_error(object.write_pose(&array![[0.0; 7]], None), "Config { field: \"write_pose\"", &[]);
    }
    let mut object = sim.rigid_object_mut(free);
    let wrench = object.set_external_wrench(&rows(3), &rows(3), WrenchFrame::World, twice);
    repeated(wrench, "set_external_wrench (forces)");
    // The row of the last environment is invalid: no environment has changed.
    let results = [
        ("one mass", object.set_mass(&array![2.0, 2.0, -1.0], None)),
        ("all masses", object.set_mass(&array![0.0], None)),
        ("inertia", object.set_inertia(&array![[1.0, 1.0, 3.0]], None)),
        ("sliding", object.set_friction(&array![[-0.1, 0.0, 0.0]], None)),
        ("rolling", object.set_friction(&array![[0.1, 0.0, -1.0]], None)),
    ];
    assert_errors(results.map(|(what, result)| (what, result, "Randomization(Value {", [])));
    let mass = object.read().nominal_mass();
    assert_eq!(object.read().mass().to_vec(), [mass; 3]);
    assert_eq!(object.read().friction().row(0).to_vec(), [1.0, 0.005, 0.0001]);
    for id in [free, hand, stands] {
        assert!(sim.rigid_object(id).pose().column(0).iter().all(|x| *x == 0.0));
    }
}

/// Poses per environment: only for static objects, finite, with unit quaternions.
#[test]
fn places() {
    let (mut sim, shelf, _) = moved::shelf(2, 0.5);
    let rows = [
        ("length", (Property::Rotation, "shelf", &[1.0, 1.0, 0.0, 0.0][..]), "", ["unit quaternion"]),
        ("infinite", (Property::Position, "shelf", &[f64::INFINITY, 0.0, 0.0]), "", ["finite"]),
        ("moves", (Property::Position, "ball", &[0.0; 3]), "", ["static object \"ball\""]),
    ];
    let pose = |sim: &SimulationManager| sim.rigid_object(shelf).pose();
    assert_errors_unchanged(&mut sim, pose, rows, |sim, (property, name, value)| {
        sim.properties_mut().randomize_with(None, |_, _, p| p.set(property, name, value))
    });
    let model = sim.batch().model();
    assert!(model.id(ObjectKind::Body, "shelf").is_some() && sim.properties().bytes(EnvId(0)).unwrap() == 0);
}

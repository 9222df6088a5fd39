//! What cannot be: named, with what would be right, and nothing changed.

use super::{Files, brick, empty, object};
use kinetoscope::ndarray::{Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::scene::mesh::HullCfg;

#[test]
fn configurations_that_cannot_be() {
    let mut sim = empty(1);
    let cube = || object("o", ObjectShape::cube(0.1), [0.0; 3]);
    let (nan, infinite) = (f64::NAN, f64::INFINITY);
    let bad = [
        ("shape", RigidObjectCfg { shape: ObjectShape::Cone { radius: 0.0, height: 1.0 }, ..cube() }),
        ("shape", RigidObjectCfg { shape: ObjectShape::Cone { radius: 1.0, height: nan }, ..cube() }),
        ("center_of_mass", RigidObjectCfg { center_of_mass: Some([0.0, infinite, 0.0]), ..cube() }),
        ("inertia", RigidObjectCfg { inertia: Some([1.0, 1.0, 3.0]), ..cube() }),
        ("inertia", RigidObjectCfg { inertia: Some([1.0, 0.0, 1.0]), ..cube() }),
        ("inertia", RigidObjectCfg { inertia: Some([1.0, nan, 1.0]), ..cube() }),
        // By the last bit: 0.237 + 0.694 is below 0.931 in double precision, while twice 0.931 is not above the sum.
        ("inertia", RigidObjectCfg { inertia: Some([0.237, 0.694, 0.931]), ..cube() }),
        ("mass", RigidObjectCfg { mass: Some(-1.0), ..cube() }),
        ("mass", RigidObjectCfg { mass: Some(0.0), ..cube() }),
        ("mass", RigidObjectCfg { mass: Some(nan), body_type: BodyType::Static, ..cube() }),
        ("mass", RigidObjectCfg { mass: Some(-1.0), body_type: BodyType::Kinematic, ..cube() }),
        ("linear_damping", RigidObjectCfg { linear_damping: -1.0, ..cube() }),
        ("angular_damping", RigidObjectCfg { angular_damping: infinite, ..cube() }),
        ("linear_damping", RigidObjectCfg { linear_damping: 1.0, body_type: BodyType::Kinematic, ..cube() }),
        ("restitution", RigidObjectCfg { restitution: Some(0.1), ..cube() }),
        ("restitution", RigidObjectCfg { restitution: Some(1.1), ..cube() }),
        ("restitution", RigidObjectCfg { restitution: Some(nan), ..cube() }),
        ("contact_margin", RigidObjectCfg { contact_margin: -1e-3, ..cube() }),
    ];
    for (expected, cfg) in bad {
        let shown = format!("{cfg:?}");
        match sim.add_rigid_object(cfg) {
            Err(Error::Config { field, .. }) => assert_eq!(field, expected, "{shown}"),
            other => panic!("{shown}: {other:?}"),
        }
    }
    // Control: what is left out of each is good.
    sim.add_rigid_object(cube()).unwrap();
}

#[test]
fn mesh_files_that_cannot_be() {
    let files = Files::new();
    let good = files.obj("b.obj", &brick([0.5, 0.5, 0.5], [0.0; 3]));
    let text = files.0.path().join("t.obj");
    std::fs::write(&text, "v 0 0 0\nf 1 2 3\n").unwrap();
    let mut sim = empty(1);
    let mesh = |path: &std::path::Path, scale, hull: HullCfg| ObjectShape::Mesh { path: path.into(), scale, hull };
    let few = HullCfg { max_vertices: 3, ..Default::default() };
    for (shape, says) in [
        (mesh(&files.0.path().join("none.stl"), [1.0; 3], HullCfg::default()), "none.stl"),
        (mesh(&text, [1.0; 3], HullCfg::default()), "t.obj"),
        (mesh(&good, [1.0; 3], few), "max_vertices"),
    ] {
        let error = sim.add_rigid_object(object("o", shape, [0.0; 3])).unwrap_err();
        assert!(matches!(&error, Error::ObjectMesh { object, .. } if object == "o"), "{error}");
        assert!(error.to_string().contains(says), "{error}");
    }
    for scale in [[1.0, 0.0, 1.0], [1.0, f64::NAN, 1.0]] {
        let error = sim.add_rigid_object(object("o", mesh(&good, scale, HullCfg::default()), [0.0; 3])).unwrap_err();
        assert!(matches!(error, Error::Config { field: "shape", .. }), "{error}");
    }
    sim.add_rigid_object(object("o", mesh(&good, [1.0; 3], HullCfg::default()), [0.0; 3])).unwrap();
}

#[test]
fn writers_that_cannot_write() {
    let mut sim = empty(3);
    let add = |sim: &mut SimulationManager, uid: &str, body_type| {
        let cfg = RigidObjectCfg { body_type, ..object(uid, ObjectShape::cube(0.1), [0.0; 3]) };
        sim.add_rigid_object(cfg).unwrap()
    };
    let free = add(&mut sim, "free", BodyType::Dynamic);
    let hand = add(&mut sim, "hand", BodyType::Kinematic);
    let fixed = add(&mut sim, "fixed", BodyType::Static);
    let velocity = array![[1.0; 6]];
    let not_dynamic = |result: Result<()>, argument: &str| match result {
        Err(Error::NotDynamic { argument: found, .. }) => assert_eq!(found, argument),
        other => panic!("{argument}: {other:?}"),
    };
    not_dynamic(sim.rigid_object_mut(hand).write_velocity(&velocity, None), "write_velocity");
    not_dynamic(sim.rigid_object_mut(hand).set_mass(&array![1.0], None), "set_mass");
    not_dynamic(sim.rigid_object_mut(fixed).set_inertia(&array![[1.0; 3]], None), "set_inertia");
    not_dynamic(sim.rigid_object_mut(fixed).set_center_of_mass(&array![[1.0; 3]], None), "set_center_of_mass");
    let zeros = array![[0.0; 3]];
    let wrench = sim.rigid_object_mut(hand).set_external_wrench(&zeros, &zeros, WrenchFrame::World, None);
    not_dynamic(wrench, "set_external_wrench");
    let result = sim.rigid_object_mut(fixed).write_velocity(&velocity, None);
    assert!(matches!(&result, Err(Error::FixedBody(uid)) if uid == "fixed"), "{result:?}");
    // An environment that is named twice: which row would hold?
    let twice = Some(&[EnvId(2), EnvId(0), EnvId(2)][..]);
    let rows = |columns| Array2::from_elem((3, columns), 1.0);
    let repeated = |result: Result<()>, called: &str| match result {
        Err(Error::Repeated { argument, of, first: 0, second: 2 }) => {
            assert_eq!((argument, of.as_str()), (called, "environment 2"));
        }
        other => panic!("{called}: {other:?}"),
    };
    for id in [free, hand, fixed] {
        repeated(sim.rigid_object_mut(id).write_pose(&rows(7), twice), "write_pose");
    }
    let mut object = sim.rigid_object_mut(free);
    repeated(object.write_velocity(&rows(6), twice), "write_velocity");
    repeated(object.set_mass(&array![1.0, 1.0, 1.0], twice), "set_mass");
    repeated(object.set_friction(&rows(3), twice), "set_friction");
    let wrench = object.set_external_wrench(&rows(3), &rows(3), WrenchFrame::World, twice);
    repeated(wrench, "set_external_wrench (forces)");
    // Shapes, environments, numbers.
    assert!(matches!(object.set_mass(&array![1.0, 1.0], None), Err(Error::Shape { argument: "set_mass", .. })));
    assert!(matches!(object.set_friction(&rows(2), None), Err(Error::Shape { argument: "set_friction", .. })));
    assert!(matches!(object.set_mass(&array![1.0], Some(&[EnvId(3)])), Err(Error::UnknownIndex { index: 3, .. })));
    assert!(matches!(object.set_mass(&array![f64::NAN], None), Err(Error::NotFinite { .. })));
    for result in [
        object.set_mass(&array![0.0], None),
        object.set_inertia(&array![[1.0, 1.0, 3.0]], None),
        object.set_friction(&array![[-0.1, 0.0, 0.0]], None),
        object.set_friction(&array![[0.1, 0.0, -1.0]], None),
    ] {
        assert!(matches!(&result, Err(Error::Randomization(RandomizationError::Value { .. }))), "{result:?}");
    }
    // The last environment's row is bad: none has changed.
    assert!(object.set_mass(&array![2.0, 2.0, -1.0], None).is_err());
    let mass = object.read().mass();
    assert_eq!(object.read().get_mass().to_vec(), [mass; 3]);
    assert_eq!(object.read().get_friction().row(0).to_vec(), [1.0, 0.005, 0.0001]);
    assert!(object.read().get_pose().column(0).iter().all(|x| *x == 0.0));
}

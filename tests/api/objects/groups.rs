//! Groups of objects: read and written together, each an object as any other.

use super::{empty, object};
use kinetoscope::ndarray::{Array3, Axis};
use kinetoscope::prelude::*;

fn blocks() -> RigidObjectGroupCfg {
    let at = |uid, x| object(uid, ObjectShape::cube(0.1), [x, 0.0, 0.0]);
    RigidObjectGroupCfg { uid: "blocks".into(), objects: vec![at("red", 0.0), at("green", 1.0), at("blue", 2.0)] }
}

fn names(sim: &SimulationManager, id: GroupId) -> Vec<ObjectId> {
    sim.rigid_object_group(id).names().iter().map(|name| sim.rigid_object_id(name).unwrap()).collect()
}

/// Rows are those of the objects in order, in every environment; what falls falls by g h² n (n + 1) / 2.
#[test]
fn poses_are_those_of_the_objects() {
    let mut sim = empty(2);
    sim.add_rigid_object(object("other", ObjectShape::cube(0.1), [9.0; 3])).unwrap();
    let id = sim.add_rigid_object_group(blocks()).unwrap();
    assert_eq!(sim.rigid_object_group(id).names(), ["blocks.red", "blocks.green", "blocks.blue"]);
    assert_eq!((sim.rigid_object_group(id).len(), sim.rigid_object_group(id).uid()), (3, "blocks"));
    assert!(!sim.rigid_object_group(id).is_empty());
    let there = Array3::from_shape_fn((2, 3, 7), |(e, k, c)| [e as f64, k as f64, 5.0, 0.0, 0.0, 2.0, 0.0][c]);
    sim.rigid_object_group_mut(id).write_pose(&there, None).unwrap();
    // One row of one environment, and then one for all.
    let mut pose = sim.rigid_object_group(id).get_pose();
    assert_eq!(pose[(1, 2, 5)], 1.0, "normalised");
    for (k, object) in names(&sim, id).into_iter().enumerate() {
        assert_eq!(sim.rigid_object(object).get_pose(), pose.index_axis(Axis(1), k));
    }
    sim.update(100);
    let fallen = 9.81e-6 * 100.0 * 101.0 / 2.0;
    let (now, velocity) = (sim.rigid_object_group(id).get_pose(), sim.rigid_object_group(id).get_velocity());
    assert_eq!((now.dim(), velocity.dim()), ((2, 3, 7), (2, 3, 6)));
    assert!(now.index_axis(Axis(2), 2).iter().all(|z| (z - 5.0 + fallen).abs() < 1e-12), "{now}");
    assert!(velocity.index_axis(Axis(2), 2).iter().all(|v| (v + 0.981).abs() < 1e-12), "{velocity}");
    pose.index_axis_mut(Axis(2), 0).fill(7.0);
    let one = pose.slice_axis(Axis(0), (0..1).into()).to_owned();
    sim.rigid_object_group_mut(id).write_pose(&one, Some(&[EnvId(1)])).unwrap();
    let after = sim.rigid_object_group(id).get_pose();
    assert_eq!((after[(1, 2, 0)], after[(1, 2, 2)], after[(0, 2, 0)]), (7.0, 5.0, 0.0));
    assert_eq!(sim.rigid_object_id("other").map(|id| sim.rigid_object(id).get_pose()[(1, 0)]).unwrap(), 9.0);
}

#[test]
fn groups_and_poses_that_cannot_be() {
    let mut sim = empty(2);
    assert!(matches!(
        sim.add_rigid_object_group(RigidObjectGroupCfg::default()),
        Err(Error::Config { field: "objects", .. })
    ));
    let mut twice = blocks();
    twice.objects[2].uid = "red".into();
    assert!(matches!(sim.add_rigid_object_group(twice), Err(Error::DuplicateUid(uid)) if uid == "blocks.red"));
    let mut bad = blocks();
    bad.objects[1].density = -1.0;
    assert!(matches!(sim.add_rigid_object_group(bad), Err(Error::Config { field: "density", .. })));
    // Nothing of these was left behind.
    assert!(sim.rigid_object_id("blocks.red").is_err());
    let mut cfg = blocks();
    cfg.objects[2].body_type = BodyType::Static;
    let id = sim.add_rigid_object_group(RigidObjectGroupCfg { uid: "mixed".into(), ..cfg }).unwrap();
    let good =
        Array3::from_shape_fn((2, 3, 7), |(_, _, c)| if c == 3 { 1.0 } else { 0.5 * f64::from(u8::from(c < 3)) });
    let mut group = sim.rigid_object_group_mut(id);
    group.write_pose(&good, None).unwrap();
    assert_eq!(group.read().get_pose(), good, "the one that stands, too");
    let id = sim.add_rigid_object_group(blocks()).unwrap();
    assert!(matches!(sim.add_rigid_object_group(blocks()), Err(Error::DuplicateUid(uid)) if uid == "blocks"));
    let mut group = sim.rigid_object_group_mut(id);
    let before = group.read().get_pose();
    let shape = group.write_pose(&good.slice_axis(Axis(1), (0..2).into()).to_owned(), None);
    assert!(matches!(shape, Err(Error::Shape { expected, .. }) if expected == [2, 3, 7]));
    let repeated = group.write_pose(&good, Some(&[EnvId(1), EnvId(1)]));
    assert!(matches!(repeated, Err(Error::Repeated { first: 0, second: 1, .. })));
    assert!(matches!(group.write_pose(&good, Some(&[EnvId(2)])), Err(Error::UnknownIndex { index: 2, .. })));
    let mut nan = good.clone();
    nan[(1, 2, 1)] = f64::NAN;
    assert!(matches!(group.write_pose(&nan, None), Err(Error::NotFinite { row: 1, column: 1, .. })));
    let mut flat = good.clone();
    flat[(1, 2, 3)] = 0.0;
    assert!(matches!(group.write_pose(&flat, None), Err(Error::Config { field: "write_pose", .. })));
    assert_eq!(group.read().get_pose(), before);
    group.write_pose(&good, None).unwrap();
    assert!(group.read().get_pose().index_axis(Axis(2), 0).iter().all(|x| *x == 0.5));
}

/// What flies without gravity goes on by v t and turns by w t; what is read is what was written, in world axes.
#[test]
fn velocities_are_those_of_the_objects() {
    let mut sim = super::weightless(2);
    let id = sim.add_rigid_object_group(blocks()).unwrap();
    // The cubes lie turned, so that world axes are not theirs.
    let turned = Array3::from_shape_fn((1, 3, 7), |(_, k, c)| [0.0, k as f64, 5.0, 0.6, 0.8, 0.0, 0.0][c]);
    sim.rigid_object_group_mut(id).write_pose(&turned, None).unwrap();
    // A cube has the same moment about every axis: it spins on as it is.
    let velocities = Array3::from_shape_fn((2, 3, 6), |(e, k, c)| {
        let linear = 0.1 * (e + 1) as f64 * (k as f64 - 1.0);
        [linear, -linear, 0.2, 0.0, 0.3 * e as f64, 0.5 * k as f64][c]
    });
    sim.rigid_object_group_mut(id).write_velocity(&velocities, None).unwrap();
    let near = |a: &Array3<f64>, b: &Array3<f64>| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
    assert!(near(&sim.rigid_object_group(id).get_velocity(), &velocities));
    for (k, object) in names(&sim, id).into_iter().enumerate() {
        assert_eq!(
            sim.rigid_object(object).get_velocity(),
            sim.rigid_object_group(id).get_velocity().index_axis(Axis(1), k)
        );
    }
    let before = sim.rigid_object_group(id).get_pose();
    sim.update(200);
    let after = sim.rigid_object_group(id).get_pose();
    for ((e, k, c), velocity) in velocities.indexed_iter().filter(|((.., c), _)| *c < 3) {
        let moved = after[(e, k, c)] - before[(e, k, c)];
        assert!((moved - 0.2 * velocity).abs() < 1e-12, "environment {e}, object {k}: {moved}");
    }
    // One row for one environment; the other flies on.
    let stop = Array3::zeros((1, 3, 6));
    sim.rigid_object_group_mut(id).write_velocity(&stop, Some(&[EnvId(1)])).unwrap();
    let velocity = sim.rigid_object_group(id).get_velocity();
    assert!(velocity.index_axis(Axis(0), 1).iter().all(|v| *v == 0.0));
    assert!((velocity[(0, 2, 0)] - 0.1).abs() < 1e-12);

    let before = sim.rigid_object_group(id).get_velocity();
    let mut group = sim.rigid_object_group_mut(id);
    let shape = group.write_velocity(&Array3::zeros((2, 3, 7)), None);
    assert!(matches!(shape, Err(Error::Shape { argument: "write_velocity", expected, .. }) if expected == [2, 3, 6]));
    let mut nan = velocities.clone();
    nan[(0, 1, 4)] = f64::NAN;
    assert!(matches!(group.write_velocity(&nan, None), Err(Error::NotFinite { row: 0, column: 4, .. })));
    let repeated = group.write_velocity(&velocities, Some(&[EnvId(0), EnvId(0)]));
    assert!(matches!(repeated, Err(Error::Repeated { .. })));
    assert_eq!(group.read().get_velocity(), before);
    let mut mixed = blocks();
    mixed.objects[1].body_type = BodyType::Kinematic;
    let mixed = sim.add_rigid_object_group(RigidObjectGroupCfg { uid: "mixed".into(), ..mixed }).unwrap();
    let refused = sim.rigid_object_group_mut(mixed).write_velocity(&velocities, None);
    assert!(matches!(refused, Err(Error::NotDynamic { object, .. }) if object == "mixed.green"));
    assert!(sim.rigid_object_group(mixed).get_velocity().iter().all(|v| *v == 0.0), "none of them was told");
}

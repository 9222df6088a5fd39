//! Groups of objects: read and written together, while each member remains a normal object.

use super::*;
use kinetoscope::ndarray::{Array3, Axis};
use kinetoscope::sim::{Error, RigidObjectGroupCfg, RigidObjectGroupId, RigidObjectId};
use kinetoscope_testkit::error_tables::assert_error;

fn blocks() -> RigidObjectGroupCfg {
    let at = |uid, x| object(uid, ObjectShape::cube(0.1), [x, 0.0, 0.0]);
    RigidObjectGroupCfg { uid: "blocks".into(), objects: vec![at("red", 0.0), at("green", 1.0), at("blue", 2.0)] }
}

fn objects(sim: &SimulationManager, id: RigidObjectGroupId) -> Vec<RigidObjectId> {
    sim.rigid_object_group(id).names().iter().map(|name| sim.entities().rigid_object_id(name).unwrap()).collect()
}

/// Rows are in the order of the objects, in every environment; a free object falls by g h² n (n + 1) / 2.
#[test]
fn poses() {
    let mut sim = empty(2);
    let other = sim.add_rigid_object(object("other", ObjectShape::cube(0.1), [9.0; 3])).unwrap();
    let id = sim.add_rigid_object_group(blocks()).unwrap();
    assert_eq!(sim.rigid_object_group(id).names(), ["blocks.red", "blocks.green", "blocks.blue"]);
    assert_eq!((sim.rigid_object_group(id).len(), sim.rigid_object_group(id).uid()), (3, "blocks"));
    assert!(!sim.rigid_object_group(id).is_empty());
    let there = Array3::from_shape_fn((2, 3, 7), |(e, k, c)| [e as f64, k as f64, 5.0, 0.0, 0.0, 2.0, 0.0][c]);
    sim.rigid_object_group_mut(id).write_pose(&there, None).unwrap();
    let mut pose = sim.rigid_object_group(id).pose();
    assert_eq!(pose[(1, 2, 5)], 1.0, "normalized");
    for (k, object) in objects(&sim, id).into_iter().enumerate() {
        assert_eq!(sim.rigid_object(object).pose(), pose.index_axis(Axis(1), k));
    }
    sim.update(100);
    let fallen = 9.81e-6 * 100.0 * 101.0 / 2.0;
    let (now, velocity) = (sim.rigid_object_group(id).pose(), sim.rigid_object_group(id).velocity());
    assert_eq!((now.dim(), velocity.dim()), ((2, 3, 7), (2, 3, 6)));
    assert!(now.index_axis(Axis(2), 2).iter().all(|z| (z - 5.0 + fallen).abs() < 1e-12), "{now}");
    assert!(velocity.index_axis(Axis(2), 2).iter().all(|v| (v + 0.981).abs() < 1e-12), "{velocity}");
    pose.index_axis_mut(Axis(2), 0).fill(7.0);
    let one = pose.slice_axis(Axis(0), (0..1).into()).to_owned();
    sim.rigid_object_group_mut(id).write_pose(&one, Some(SECOND)).unwrap();
    let after = sim.rigid_object_group(id).pose();
    assert_eq!((after[(1, 2, 0)], after[(1, 2, 2)], after[(0, 2, 0)]), (7.0, 5.0, 0.0));
    assert_eq!(sim.rigid_object(other).pose()[(1, 0)], 9.0);
}

/// Objects without gravity move by v t and rotate by w t; velocities are read as they were written, in world axes.
#[test]
fn velocities() {
    let mut sim = weightless(2);
    let id = sim.add_rigid_object_group(blocks()).unwrap();
    // The cubes are rotated, so that world axes differ from theirs. A cube has the same moment about every axis, so its
    // spin is constant.
    let turned = Array3::from_shape_fn((1, 3, 7), |(_, k, c)| [0.0, k as f64, 5.0, 0.6, 0.8, 0.0, 0.0][c]);
    sim.rigid_object_group_mut(id).write_pose(&turned, None).unwrap();
    let velocities = Array3::from_shape_fn((2, 3, 6), |(e, k, c)| {
        let linear = 0.1 * (e + 1) as f64 * (k as f64 - 1.0);
        [linear, -linear, 0.2, 0.0, 0.3 * e as f64, 0.5 * k as f64][c]
    });
    sim.rigid_object_group_mut(id).write_velocity(&velocities, None).unwrap();
    let read = sim.rigid_object_group(id).velocity();
    assert!((&read - &velocities).iter().all(|d| d.abs() < 1e-12));
    for (k, object) in objects(&sim, id).into_iter().enumerate() {
        assert_eq!(sim.rigid_object(object).velocity(), read.index_axis(Axis(1), k));
    }
    let before = sim.rigid_object_group(id).pose();
    sim.update(200);
    let after = sim.rigid_object_group(id).pose();
    for ((e, k, c), velocity) in velocities.indexed_iter().filter(|((.., c), _)| *c < 3) {
        let moved = after[(e, k, c)] - before[(e, k, c)];
        assert!((moved - 0.2 * velocity).abs() < 1e-12, "environment {e}, object {k}: {moved}");
    }
    // One row for one environment; the other continues.
    sim.rigid_object_group_mut(id).write_velocity(&Array3::zeros((1, 3, 6)), Some(SECOND)).unwrap();
    let velocity = sim.rigid_object_group(id).velocity();
    assert!(velocity.index_axis(Axis(0), 1).iter().all(|v| *v == 0.0));
    assert!((velocity[(0, 2, 0)] - 0.1).abs() < 1e-12);
}

#[test]
fn refusals() {
    let mut sim = empty(2);
    let with = |change: fn(&mut RigidObjectGroupCfg)| {
        let mut cfg = blocks();
        change(&mut cfg);
        cfg
    };
    for (cfg, kind) in [
        (RigidObjectGroupCfg::default(), "Config { field: \"objects\""),
        (with(|cfg| cfg.objects[2].uid = "red".into()), "DuplicateUid(\"blocks.red\")"),
        (with(|cfg| cfg.objects[1].density = -1.0), "Config { field: \"density\""),
    ] {
        assert_error(sim.add_rigid_object_group(cfg), kind, &[]);
    }
    assert!(sim.entities().rigid_object_id("blocks.red").is_err(), "nothing of these was left behind");
    let id = sim.add_rigid_object_group(blocks()).unwrap();
    assert_error(sim.add_rigid_object_group(blocks()), "DuplicateUid(\"blocks\")", &[]);

    let poses = Array3::from_shape_fn((2, 3, 7), |(_, _, c)| [0.5, 0.5, 0.5, 1.0, 0.0, 0.0, 0.0][c]);
    let velocities = Array3::from_elem((2, 3, 6), 0.1);
    let changed = |values: &Array3<f64>, at: (usize, usize, usize), value| {
        let mut values = values.clone();
        values[at] = value;
        values
    };
    let (nan, twice) = (f64::NAN, Some(&[EnvId(1), EnvId(1)][..]));
    let mut group = sim.rigid_object_group_mut(id);
    let before = (group.read().pose(), group.read().velocity());
    let narrow = poses.slice_axis(Axis(1), (0..2).into()).to_owned();
    assert!(matches!(group.write_pose(&narrow, None), Err(Error::Shape { expected, .. }) if expected == [2, 3, 7]));
    let wide = group.write_velocity(&Array3::zeros((2, 3, 7)), None);
    assert!(matches!(wide, Err(Error::Shape { argument: "write_velocity", expected, .. }) if expected == [2, 3, 6]));
    for (result, [kind, part]) in [
        (group.write_pose(&poses, twice), ["RepeatedItem {", "first: 0, second: 1"]),
        (group.write_velocity(&velocities, twice), ["RepeatedItem {", "first: 0, second: 1"]),
        (group.write_pose(&poses, Some(&[EnvId(2)])), ["UnknownIndex {", "index: 2"]),
        (group.write_pose(&changed(&poses, (1, 2, 1), nan), None), ["NotFinite {", "row: 1, column: 1"]),
        (group.write_velocity(&changed(&velocities, (0, 1, 4), nan), None), ["NotFinite {", "row: 0, column: 4"]),
        (group.write_pose(&changed(&poses, (1, 2, 3), 0.0), None), ["Config {", "field: \"write_pose\""]),
    ] {
        let shown = format!("{:?}", result.unwrap_err());
        assert!(shown.starts_with(kind) && shown.contains(part), "{shown} is not {kind} {part}");
    }
    assert_eq!((group.read().pose(), group.read().velocity()), before);
    group.write_pose(&poses, None).unwrap();
    assert_eq!(group.read().pose(), poses, "the control");
    // A static member is moved with the others. A kinematic member has no velocity, so writing velocities to its group
    // is refused.
    for (uid, body_type) in [("static", BodyType::Static), ("mixed", BodyType::Kinematic)] {
        let mut cfg = blocks();
        cfg.objects[1].body_type = body_type;
        let id = sim.add_rigid_object_group(RigidObjectGroupCfg { uid: uid.into(), ..cfg }).unwrap();
        let mut group = sim.rigid_object_group_mut(id);
        group.write_pose(&poses, None).unwrap();
        assert_eq!(group.read().pose(), poses);
        if body_type == BodyType::Kinematic {
            let refused = group.write_velocity(&velocities, None);
            assert!(matches!(refused, Err(Error::NotDynamic { object, .. }) if object == "mixed.green"));
            assert!(group.read().velocity().iter().all(|v| *v == 0.0));
        }
    }
}

//! Welds: what is held moves as one, in the environment where it is held, and snapshots know it.

use super::{object, weightless};
use kinetoscope::ndarray::{Array2, Array3, Axis, array};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_row;

const SECOND: &[EnvId] = &[EnvId(1)];

fn weld(first: &str, second: &str) -> WeldCfg {
    WeldCfg { uid: "weld".into(), first: first.into(), second: second.into() }
}

fn pose(rows: &Array2<f64>, env: usize) -> Pose {
    from_row(&std::array::from_fn(|k| rows[(env, k)]))
}

/// Two cubes of 1 and 3 kg half a metre apart, the second turned.
fn cubes(sim: &mut SimulationManager) -> [ObjectId; 2] {
    let cube = |uid, x, mass| RigidObjectCfg { mass: Some(mass), ..object(uid, ObjectShape::cube(0.1), [x, 0.0, 0.0]) };
    let first = sim.add_rigid_object(cube("first", 0.0, 1.0)).unwrap();
    let mut cfg = cube("second", 0.5, 3.0);
    cfg.init_pose = kinetoscope::scene::pose::from_xyz_rpy([0.5, 0.0, 0.0], [0.3, -0.4, 0.5]);
    [first, sim.add_rigid_object(cfg).unwrap()]
}

/// Pose of the second in the first.
fn relative(sim: &SimulationManager, [first, second]: [ObjectId; 2], env: usize) -> Pose {
    let [a, b] = [first, second].map(|id| pose(&sim.rigid_object(id).get_pose(), env));
    a.inverse() * b
}

fn apart(a: &Pose, b: &Pose) -> f64 {
    let difference = a.inverse() * b;
    difference.translation.vector.norm() + difference.rotation.angle()
}

fn push(sim: &mut SimulationManager, id: ObjectId, x: f64) {
    let (force, none) = (array![[x, 0.0, 0.0]], array![[0.0; 3]]);
    sim.rigid_object_mut(id).set_external_wrench(&force, &none, WrenchFrame::World, None).unwrap();
}

/// F t / (m1 + m2) where they are held, F t / m1 where not; after the release the second goes on as it was.
#[test]
fn what_is_held_moves_as_one() {
    let mut sim = weightless(2);
    let ids = cubes(&mut sim);
    let held = sim.add_weld(weld("first", "second")).unwrap();
    assert_eq!(sim.weld(held).is_attached().to_vec(), [false, false]);
    let before = relative(&sim, ids, 1);
    sim.weld_mut(held).attach(Some(SECOND)).unwrap();
    assert_eq!(sim.weld(held).is_attached().to_vec(), [false, true]);
    push(&mut sim, ids[0], 2.0);
    sim.update(500);
    let v = ids.map(|id| sim.rigid_object(id).get_velocity());
    // The weld gives way by 1e-4 of the acceleration that its load would cause, at first.
    assert!((v[0][(1, 0)] - 0.25).abs() < 1e-3 && (v[1][(1, 0)] - 0.25).abs() < 1e-3, "{v:?}");
    assert!((v[0][(1, 0)] + 3.0 * v[1][(1, 0)] - 1.0).abs() < 1e-9, "momentum is F t: {v:?}");
    assert!((v[0][(0, 0)] - 1.0).abs() < 1e-9 && v[1][(0, 0)] == 0.0, "{v:?}");
    assert!(apart(&relative(&sim, ids, 1), &before) < 1e-4, "{}", apart(&relative(&sim, ids, 1), &before));
    sim.weld_mut(held).release(None).unwrap();
    assert_eq!(sim.weld(held).is_attached().to_vec(), [false, false]);
    sim.update(500);
    let later = sim.rigid_object(ids[1]).get_velocity();
    assert!((later[(1, 0)] - v[1][(1, 0)]).abs() < 1e-12, "{later}");
    assert!((sim.rigid_object(ids[0]).get_velocity()[(1, 0)] - v[0][(1, 0)] - 1.0).abs() < 1e-9);
}

/// It holds how they lie at the moment, each time.
#[test]
fn attaching_again_holds_the_new_pose() {
    let mut sim = weightless(1);
    let ids = cubes(&mut sim);
    let held = sim.add_weld(weld("second", "first")).unwrap();
    sim.weld_mut(held).attach(None).unwrap();
    let there = array![[0.2, 0.7, -0.3, 0.5, 0.5, 0.5, 0.5]];
    sim.weld_mut(held).release(None).unwrap();
    sim.rigid_object_mut(ids[1]).write_pose(&there, None).unwrap();
    sim.weld_mut(held).attach(None).unwrap();
    let before = relative(&sim, ids, 0);
    push(&mut sim, ids[0], 1.0);
    sim.update(300);
    assert!(apart(&relative(&sim, ids, 0), &before) < 1e-3, "{}", apart(&relative(&sim, ids, 0), &before));
    assert!(sim.rigid_object(ids[0]).get_velocity().iter().any(|v| v.abs() > 0.01));
    // A reset lets go.
    sim.reset(None).unwrap();
    assert_eq!(sim.weld(held).is_attached().to_vec(), [false]);
    push(&mut sim, ids[0], 1.0);
    sim.update(100);
    assert_eq!(sim.rigid_object(ids[1]).get_velocity(), Array2::<f64>::zeros((1, 6)));
}

/// To a link of an arm that is driven, and to the world, against gravity.
#[test]
fn links_and_the_world_hold() {
    let cfg = SimulationManagerCfg { num_envs: 2, ground: None, physics_dt: 2e-3, ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    let arm = sim.add_robot(RobotCfg { uid: "arm".into(), urdf, ..Default::default() }).unwrap();
    let tip = sim.robot(arm).link_names().last().unwrap().to_string();
    let cube = |uid, x| RigidObjectCfg { mass: Some(0.3), ..object(uid, ObjectShape::cube(0.05), [x, 0.0, 1.0]) };
    let ids = [sim.add_rigid_object(cube("carried", 1.5)).unwrap(), sim.add_rigid_object(cube("hung", 3.0)).unwrap()];
    let at_link = sim.add_weld(weld(&format!("arm/{tip}"), "carried")).unwrap();
    let at_world = sim.add_weld(WeldCfg { uid: "nail".into(), ..weld("hung", "world") }).unwrap();
    for id in [at_link, at_world] {
        sim.weld_mut(id).attach(Some(SECOND)).unwrap();
    }
    let in_link = |sim: &SimulationManager| {
        pose(&sim.robot(arm).link_pose(&tip).unwrap(), 1).inverse() * pose(&sim.rigid_object(ids[0]).get_pose(), 1)
    };
    let before = in_link(&sim);
    let start = sim.robot(arm).link_pose(&tip).unwrap();
    let targets = Array2::from_elem((1, 6), 0.3);
    sim.robot_mut(arm).set_qpos(&targets, None, None).unwrap();
    sim.update(500);
    let moved = sim.robot(arm).link_pose(&tip).unwrap();
    assert!((&moved - &start).iter().any(|d| d.abs() > 0.1), "the arm moved: {moved}");
    // 0.3 kg on a lever of a metre: the weld is soft by 1e-4 of what that would accelerate.
    assert!(apart(&in_link(&sim), &before) < 2e-3, "{}", apart(&in_link(&sim), &before));
    let hung = sim.rigid_object(ids[1]).get_pose();
    assert!((hung[(1, 2)] - 1.0).abs() < 1e-5 && hung[(0, 2)] < -3.0, "{hung}");
}

/// A snapshot has which welds hold, and how: going on from it is bit-identical, in memory and from a file, in another
/// environment, and after the weld was released or held otherwise.
#[test]
fn snapshots_know_what_is_held() {
    let mut sim = weightless(3);
    let ids = cubes(&mut sim);
    let held = sim.add_weld(weld("first", "second")).unwrap();
    sim.weld_mut(held).attach(Some(SECOND)).unwrap();
    push(&mut sim, ids[0], 2.0);
    sim.update(50);
    let snapshot = sim.snapshot(None).unwrap();
    let file = tempfile::tempdir().unwrap();
    let path = file.path().join("state");
    snapshot.save(&path).unwrap();
    let run = |sim: &mut SimulationManager| {
        sim.update(70);
        ids.map(|id| (sim.rigid_object(id).get_pose(), sim.rigid_object(id).get_velocity()))
    };
    let expected = run(&mut sim);
    assert!(expected[1].1[(1, 0)] > 0.01 && expected[1].1[(0, 0)] == 0.0);
    // Otherwise in every environment.
    sim.weld_mut(held).release(Some(SECOND)).unwrap();
    sim.update(20);
    sim.weld_mut(held).attach(None).unwrap();
    sim.update(20);
    sim.restore(&snapshot, None).unwrap();
    assert_eq!(sim.weld(held).is_attached().to_vec(), [false, true, false]);
    assert_eq!(run(&mut sim), expected);
    sim.reset(None).unwrap();
    let read = Snapshot::load(&path).unwrap();
    sim.restore(&read, Some(&[EnvId(0), EnvId(2), EnvId(1)])).unwrap();
    assert_eq!(sim.weld(held).is_attached().to_vec(), [false, false, true]);
    let found = run(&mut sim);
    for (found, expected) in found.iter().zip(&expected) {
        assert_eq!((found.0.row(2), found.1.row(2)), (expected.0.row(1), expected.1.row(1)));
        assert_eq!((found.0.row(1), found.1.row(1)), (expected.0.row(2), expected.1.row(2)));
    }
}

/// Models of its own for other reasons, and scenes that grow, keep what is held.
#[test]
fn masses_and_additions_keep_what_is_held() {
    let mut sim = weightless(2);
    let ids = cubes(&mut sim);
    let held = sim.add_weld(weld("first", "second")).unwrap();
    sim.weld_mut(held).attach(Some(SECOND)).unwrap();
    let before = relative(&sim, ids, 1);
    sim.rigid_object_mut(ids[1]).set_mass(&array![7.0], Some(SECOND)).unwrap();
    sim.add_rigid_object(object("other", ObjectShape::cube(0.1), [0.0, 3.0, 0.0])).unwrap();
    assert_eq!(sim.weld(held).is_attached().to_vec(), [false, true]);
    push(&mut sim, ids[0], 4.0);
    sim.update(500);
    let v = ids.map(|id| sim.rigid_object(id).get_velocity()[(1, 0)]);
    assert!((v[0] - 0.25).abs() < 1e-3 && (v[1] - 0.25).abs() < 1e-3, "F t / 8 kg: {v:?}");
    assert!(apart(&relative(&sim, ids, 1), &before) < 1e-4);
    sim.reset_properties(None).unwrap();
    assert_eq!(sim.weld(held).is_attached().to_vec(), [false, true]);
    sim.update(100);
    assert!(apart(&relative(&sim, ids, 1), &before) < 1e-4);
}

/// Held to something that stands far away, as to the world: it hangs where it was, neither lower nor turned.
#[test]
fn what_is_far_and_fixed_holds() {
    for (body_type, turned) in [BodyType::Static, BodyType::Kinematic].iter().flat_map(|t| [(*t, false), (*t, true)]) {
        let cfg = SimulationManagerCfg { ground: None, physics_dt: 2e-3, ..Default::default() };
        let mut sim = SimulationManager::new(cfg).unwrap();
        let cube = |uid, x| RigidObjectCfg { mass: Some(0.3), ..object(uid, ObjectShape::cube(0.05), [x, 0.0, 1.0]) };
        sim.add_rigid_object(RigidObjectCfg { body_type, ..cube("wall", 1000.0) }).unwrap();
        let id = sim.add_rigid_object(cube("hung", 0.0)).unwrap();
        let pair = if turned { ["wall", "hung"] } else { ["hung", "wall"] };
        let held = sim.add_weld(weld(pair[0], pair[1])).unwrap();
        assert_eq!([sim.weld(held).cfg().first.as_str(), sim.weld(held).cfg().second.as_str()], pair);
        sim.weld_mut(held).attach(None).unwrap();
        // A quarter of a turn in the time, if nothing held it.
        sim.rigid_object_mut(id).write_velocity(&array![[0.0, 0.0, 0.0, 0.0, 0.0, 1.5]], None).unwrap();
        sim.update(500);
        let found = pose(&sim.rigid_object(id).get_pose(), 0);
        let off = (found.translation.vector - nalgebra::Vector3::new(0.0, 0.0, 1.0)).norm();
        // One step of 1.5 rad/s before it is stopped, twice over; 1e-4 of the weight.
        assert!(
            off < 1e-5 && found.rotation.angle() < 1e-2,
            "{body_type:?} {pair:?}: {off} {}",
            found.rotation.angle()
        );
    }
}

/// A snapshot knows between which bodies a weld is: of another scene where they are others.
#[test]
fn snapshots_know_between_whom() {
    let build = |second: &str| {
        let mut sim = weightless(1);
        cubes(&mut sim);
        sim.add_rigid_object(object("third", ObjectShape::cube(0.1), [0.0, 3.0, 0.0])).unwrap();
        let held = sim.add_weld(weld("first", second)).unwrap();
        sim.weld_mut(held).attach(None).unwrap();
        sim
    };
    let (mut sim, mut other) = (build("second"), build("third"));
    let snapshot = sim.snapshot(None).unwrap();
    let error = other.restore(&snapshot, None).unwrap_err().to_string();
    assert!(error.contains("\"second\"") && error.contains("\"third\""), "{error}");
    // Controls.
    sim.restore(&snapshot, None).unwrap();
    build("second").restore(&snapshot, None).unwrap();
}

/// A rollout starts with the welds of its start, whatever holds in the environment.
#[test]
fn rollouts_hold_what_their_start_holds() {
    let mut sim = weightless(2);
    let ids = cubes(&mut sim);
    let held = sim.add_weld(weld("first", "second")).unwrap();
    push(&mut sim, ids[0], 2.0);
    sim.update(5);
    let loose = sim.snapshot(Some(SECOND)).unwrap();
    sim.weld_mut(held).attach(Some(SECOND)).unwrap();
    sim.update(5);
    let tight = sim.snapshot(Some(SECOND)).unwrap();
    let controls = Array3::zeros((1, 40, 0));
    let rows = [EnvId(1); 3];
    for (here, start) in [(&tight, &loose), (&loose, &tight), (&tight, &tight), (&loose, &loose)] {
        sim.restore(here, Some(SECOND)).unwrap();
        let rollout = sim.rollout(&controls, Some(start), Some(&rows)).unwrap();
        sim.restore(start, Some(SECOND)).unwrap();
        for step in 0..40 {
            sim.update(1);
            let now: Vec<f64> = sim.batch().read(1, |env| [env.data().qpos(), env.data().qvel()].concat());
            for row in 0..3 {
                let found = rollout.states.index_axis(Axis(0), row);
                assert_eq!(found.row(step).to_vec(), now, "row {row}, step {step}");
            }
        }
        let expected = sim.weld(held).is_attached()[1];
        let moved = sim.rigid_object(ids[1]).get_velocity()[(1, 0)] != 0.0;
        assert!(moved == expected && expected == std::ptr::eq(start, &tight));
        sim.restore(&rollout.end, Some(&rows)).unwrap();
        assert_eq!(sim.weld(held).is_attached().to_vec(), [false, expected]);
    }
}

#[test]
fn welds_that_cannot_be() {
    let mut sim = weightless(2);
    cubes(&mut sim);
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    sim.add_robot(RobotCfg { uid: "arm".into(), urdf, ..Default::default() }).unwrap();
    let wall = RigidObjectCfg { body_type: BodyType::Static, ..object("wall", ObjectShape::cube(0.1), [9.0; 3]) };
    sim.add_rigid_object(wall).unwrap();
    let text = r#"<mujoco><worldbody><body name="trunk"><freejoint/><geom size="0.1"/>
        <body name="tail" pos="0.3 0 0"><geom size="0.1"/></body></body></worldbody></mujoco>"#;
    sim.add_mjcf(MjcfCfg::text("part", text)).unwrap();
    let error = sim.add_weld(weld("first", "secnd")).unwrap_err();
    assert!(matches!(&error, Error::UnknownName { candidates, .. } if candidates[0] == "second"), "{error}");
    for (first, second, says) in [
        ("first", "first", "different bodies"),
        ("part/trunk", "part/tail", "different bodies"),
        ("wall", "world", "must move"),
        ("first", "arm", "one of its links"),
    ] {
        let error = sim.add_weld(weld(first, second)).unwrap_err();
        assert!(matches!(error, Error::Config { field: "weld", .. }) && error.to_string().contains(says), "{error}");
    }
    let taken = WeldCfg { uid: "first".into(), ..weld("first", "second") };
    assert!(matches!(sim.add_weld(taken), Err(Error::DuplicateUid(uid)) if uid == "first"));
    let held = sim.add_weld(weld("first", "second")).unwrap();
    assert!(matches!(sim.add_weld(weld("first", "second")), Err(Error::DuplicateUid(_))));
    let far = sim.weld_mut(held).attach(Some(&[EnvId(1), EnvId(2)]));
    assert!(matches!(far, Err(Error::UnknownIndex { index: 2, .. })));
    let twice = sim.weld_mut(held).release(Some(&[EnvId(1), EnvId(1)]));
    assert!(matches!(twice, Err(Error::Repeated { argument: "release", .. })));
    assert_eq!(sim.weld(held).is_attached().to_vec(), [false, false]);
}

//! Welds: attached bodies move as one, in the environments where the weld is attached; snapshots include welds.

use super::*;
use kinetoscope::ndarray::{Array2, Array3, Axis, array};
use kinetoscope::sim::{Error, RigidObjectId, Snapshot, WeldCfg, WeldId};
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::worlds::{pose_error, pose_of_row, sr5};

fn weld(first: &str, second: &str) -> WeldCfg {
    WeldCfg { uid: "weld".into(), first: first.into(), second: second.into() }
}

fn small(uid: &str, x: f64) -> RigidObjectCfg {
    cube(uid, 0.05, 0.3, [x, 0.0, 1.0])
}

/// Two cubes of 1 and 3 kg half a meter apart, the second rotated, and a detached weld between them.
fn cubes(num_envs: usize) -> (SimulationManager, [RigidObjectId; 2], WeldId) {
    let mut sim = weightless(num_envs);
    let first = sim.add_rigid_object(cube("first", 0.1, 1.0, [0.0; 3])).unwrap();
    let init_pose = kinetoscope::scene::pose::from_xyz_rpy([0.5, 0.0, 0.0], [0.3, -0.4, 0.5]);
    let second = sim.add_rigid_object(RigidObjectCfg { init_pose, ..cube("second", 0.1, 3.0, [0.0; 3]) }).unwrap();
    let weld_id = sim.add_weld(weld("first", "second")).unwrap();
    (sim, [first, second], weld_id)
}

/// Pose of the second object in the frame of the first.
fn relative(sim: &SimulationManager, [first, second]: [RigidObjectId; 2], env: usize) -> Pose {
    let [a, b] = [first, second].map(|id| pose_of_row(&sim.rigid_object(id).pose(), env));
    a.inverse() * b
}

fn apart(a: &Pose, b: &Pose) -> f64 {
    let (far, turned) = pose_error(a, b);
    far + turned
}

fn push(sim: &mut SimulationManager, id: RigidObjectId, x: f64) {
    set_wrench(sim, id, [x, 0.0, 0.0], [0.0; 3]);
}

fn attached(sim: &SimulationManager, weld: WeldId) -> Vec<bool> {
    sim.weld(weld).is_attached().to_vec()
}

/// F t / (m1 + m2) where they are attached, F t / m1 elsewhere; after the release the second object keeps its velocity.
#[test]
fn held_as_one() {
    let (mut sim, ids, held) = cubes(2);
    assert_eq!(attached(&sim, held), [false, false]);
    let before = relative(&sim, ids, 1);
    sim.weld_mut(held).attach(Some(SECOND)).unwrap();
    assert_eq!(attached(&sim, held), [false, true]);
    push(&mut sim, ids[0], 2.0);
    sim.update(500);
    let v = ids.map(|id| sim.rigid_object(id).velocity());
    // At first the weld yields by 1e-4 of the acceleration that its load would cause.
    assert!((v[0][(1, 0)] - 0.25).abs() < 1e-3 && (v[1][(1, 0)] - 0.25).abs() < 1e-3, "{v:?}");
    assert!((v[0][(1, 0)] + 3.0 * v[1][(1, 0)] - 1.0).abs() < 1e-9, "momentum is F t: {v:?}");
    assert!((v[0][(0, 0)] - 1.0).abs() < 1e-9 && v[1][(0, 0)] == 0.0, "{v:?}");
    assert!(apart(&relative(&sim, ids, 1), &before) < 1e-4, "{}", apart(&relative(&sim, ids, 1), &before));
    sim.weld_mut(held).release(None).unwrap();
    assert_eq!(attached(&sim, held), [false, false]);
    sim.update(500);
    let later = sim.rigid_object(ids[1]).velocity();
    assert!((later[(1, 0)] - v[1][(1, 0)]).abs() < 1e-12, "{later}");
    assert!((sim.rigid_object(ids[0]).velocity()[(1, 0)] - v[0][(1, 0)] - 1.0).abs() < 1e-9);
}

/// Each attachment holds the current relative pose.
#[test]
fn attaching_again() {
    let (mut sim, ids, _) = cubes(1);
    let held = sim.add_weld(WeldCfg { uid: "turned".into(), ..weld("second", "first") }).unwrap();
    sim.weld_mut(held).attach(None).unwrap();
    let there = array![[0.2, 0.7, -0.3, 0.5, 0.5, 0.5, 0.5]];
    sim.weld_mut(held).release(None).unwrap();
    sim.rigid_object_mut(ids[1]).write_pose(&there, None).unwrap();
    sim.weld_mut(held).attach(None).unwrap();
    let before = relative(&sim, ids, 0);
    push(&mut sim, ids[0], 1.0);
    sim.update(300);
    assert!(apart(&relative(&sim, ids, 0), &before) < 1e-3, "{}", apart(&relative(&sim, ids, 0), &before));
    assert!(sim.rigid_object(ids[0]).velocity().iter().any(|v| v.abs() > 0.01));
    // A reset detaches the weld.
    sim.reset(None).unwrap();
    assert_eq!(attached(&sim, held), [false]);
    push(&mut sim, ids[0], 1.0);
    sim.update(100);
    assert_eq!(sim.rigid_object(ids[1]).velocity(), Array2::<f64>::zeros((1, 6)));
}

/// Welds to a link of a driven arm, and to the world, against gravity.
#[test]
fn links_and_world() {
    let mut sim = sim(SimulationManagerCfg { physics_dt: 2e-3, ..empty_cfg(2) });
    let arm = sim.add_robot(sr5("arm")).unwrap();
    let tip = sim.robot(arm).link_names().last().unwrap().to_string();
    let ids = [("carried", 1.5), ("hung", 3.0)].map(|(uid, x)| sim.add_rigid_object(small(uid, x)).unwrap());
    let at_link = sim.add_weld(weld(&format!("arm/{tip}"), "carried")).unwrap();
    let at_world = sim.add_weld(WeldCfg { uid: "nail".into(), ..weld("hung", "world") }).unwrap();
    for id in [at_link, at_world] {
        sim.weld_mut(id).attach(Some(SECOND)).unwrap();
    }
    let in_link = |sim: &SimulationManager| {
        pose_of_row(&sim.robot(arm).link_pose(&tip).unwrap(), 1).inverse()
            * pose_of_row(&sim.rigid_object(ids[0]).pose(), 1)
    };
    let before = in_link(&sim);
    let start = sim.robot(arm).link_pose(&tip).unwrap();
    sim.robot_mut(arm).set_qpos_target(&row([0.3; 6]), None, None).unwrap();
    sim.update(500);
    let moved = sim.robot(arm).link_pose(&tip).unwrap();
    assert!((&moved - &start).iter().any(|d| d.abs() > 0.1), "the arm moved: {moved}");
    // 0.3 kg on a lever of a meter: the weld yields by 1e-4 of the acceleration that the load would cause.
    assert!(apart(&in_link(&sim), &before) < 2e-3, "{}", apart(&in_link(&sim), &before));
    let hung = sim.rigid_object(ids[1]).pose();
    assert!((hung[(1, 2)] - 1.0).abs() < 1e-5 && hung[(0, 2)] < -3.0, "{hung}");
}

/// A snapshot includes the attached welds and their relative poses. Continuing from it is bit-identical: from memory
/// and from a file, in another environment, and after the weld was released or attached differently.
#[test]
fn snapshots() {
    let (mut sim, ids, held) = cubes(3);
    sim.weld_mut(held).attach(Some(SECOND)).unwrap();
    push(&mut sim, ids[0], 2.0);
    sim.update(50);
    let snapshot = sim.snapshot(None).unwrap();
    let files = TempFiles::default();
    let path = files.folder().join("state");
    snapshot.save(&path).unwrap();
    let run = |sim: &mut SimulationManager| {
        sim.update(70);
        ids.map(|id| (sim.rigid_object(id).pose(), sim.rigid_object(id).velocity()))
    };
    let expected = run(&mut sim);
    assert!(expected[1].1[(1, 0)] > 0.01 && expected[1].1[(0, 0)] == 0.0);
    // Attached differently in every environment.
    sim.weld_mut(held).release(Some(SECOND)).unwrap();
    sim.update(20);
    sim.weld_mut(held).attach(None).unwrap();
    sim.update(20);
    sim.restore(&snapshot, None).unwrap();
    assert_eq!(attached(&sim, held), [false, true, false]);
    assert_eq!(run(&mut sim), expected);
    sim.reset(None).unwrap();
    let read = Snapshot::load(&path).unwrap();
    sim.restore(&read, Some(&[EnvId(0), EnvId(2), EnvId(1)])).unwrap();
    assert_eq!(attached(&sim, held), [false, false, true]);
    let found = run(&mut sim);
    for (found, expected) in found.iter().zip(&expected) {
        assert_eq!((found.0.row(2), found.1.row(2)), (expected.0.row(1), expected.1.row(1)));
        assert_eq!((found.0.row(1), found.1.row(1)), (expected.0.row(2), expected.1.row(2)));
    }
}

/// Environments with their own models for other reasons, and growing scenes, keep attached welds.
#[test]
fn masses_and_additions() {
    let (mut sim, ids, held) = cubes(2);
    sim.weld_mut(held).attach(Some(SECOND)).unwrap();
    let before = relative(&sim, ids, 1);
    sim.rigid_object_mut(ids[1]).set_mass(&array![7.0], Some(SECOND)).unwrap();
    sim.add_rigid_object(object("other", ObjectShape::cube(0.1), [0.0, 3.0, 0.0])).unwrap();
    assert_eq!(attached(&sim, held), [false, true]);
    push(&mut sim, ids[0], 4.0);
    sim.update(500);
    let v = ids.map(|id| sim.rigid_object(id).velocity()[(1, 0)]);
    assert!((v[0] - 0.25).abs() < 1e-3 && (v[1] - 0.25).abs() < 1e-3, "F t / 8 kg: {v:?}");
    assert!(apart(&relative(&sim, ids, 1), &before) < 1e-4);
    sim.properties_mut().reset(None).unwrap();
    assert_eq!(attached(&sim, held), [false, true]);
    sim.update(100);
    assert!(apart(&relative(&sim, ids, 1), &before) < 1e-4);
}

/// Attached to a distant static object, as to the world: a cube keeps its pose, without sag or rotation.
#[test]
fn far_and_fixed() {
    for (body_type, turned) in [BodyType::Static, BodyType::Kinematic].iter().flat_map(|t| [(*t, false), (*t, true)]) {
        let mut sim = sim(SimulationManagerCfg { physics_dt: 2e-3, ..empty_cfg(1) });
        sim.add_rigid_object(RigidObjectCfg { body_type, ..small("wall", 1000.0) }).unwrap();
        let id = sim.add_rigid_object(small("hung", 0.0)).unwrap();
        let pair = if turned { ["wall", "hung"] } else { ["hung", "wall"] };
        let held = sim.add_weld(weld(pair[0], pair[1])).unwrap();
        assert_eq!([sim.weld(held).cfg().first.as_str(), sim.weld(held).cfg().second.as_str()], pair);
        sim.weld_mut(held).attach(None).unwrap();
        // Without the weld the cube would rotate by a quarter of a turn in the meantime.
        sim.rigid_object_mut(id).write_velocity(&row([0.0, 0.0, 0.0, 0.0, 0.0, 1.5]), None).unwrap();
        sim.update(500);
        let (off, angle) = pose_error(&pose_of_row(&sim.rigid_object(id).pose(), 0), &Pose::translation(0.0, 0.0, 1.0));
        // Twice the motion of one step at 1.5 rad/s before the weld stops the cube; 1e-4 of the weight.
        assert!(off < 1e-5 && angle < 1e-2, "{body_type:?} {pair:?}: {off} {angle}");
    }
}

/// A snapshot contains the bodies of its welds: a scene with a weld between other bodies rejects it.
#[test]
fn snapshots_of_other_pairs() {
    let build = |second: &str| {
        let (mut sim, ..) = cubes(1);
        sim.add_rigid_object(object("third", ObjectShape::cube(0.1), [0.0, 3.0, 0.0])).unwrap();
        let held = sim.add_weld(WeldCfg { uid: "other".into(), ..weld("first", second) }).unwrap();
        sim.weld_mut(held).attach(None).unwrap();
        sim
    };
    let (mut sim, mut other) = (build("second"), build("third"));
    let snapshot = sim.snapshot(None).unwrap();
    let error = other.restore(&snapshot, None).unwrap_err().to_string();
    assert!(error.contains("\"second\"") && error.contains("\"third\""), "{error}");
    // Control: scenes with the same weld accept the snapshot.
    sim.restore(&snapshot, None).unwrap();
    build("second").restore(&snapshot, None).unwrap();
}

/// A rollout starts with the welds of its start snapshot, regardless of the current welds of the environment.
#[test]
fn rollouts() {
    let (mut sim, ids, held) = cubes(2);
    push(&mut sim, ids[0], 2.0);
    sim.update(5);
    let loose = sim.snapshot(Some(SECOND)).unwrap();
    sim.weld_mut(held).attach(Some(SECOND)).unwrap();
    sim.update(5);
    let tight = sim.snapshot(Some(SECOND)).unwrap();
    let controls = Array3::zeros((1, 40, 0));
    let rows = [EnvId(1); 3];
    for (current, start) in [(&tight, &loose), (&loose, &tight), (&tight, &tight), (&loose, &loose)] {
        sim.restore(current, Some(SECOND)).unwrap();
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
        let moved = sim.rigid_object(ids[1]).velocity()[(1, 0)] != 0.0;
        assert!(moved == expected && expected == std::ptr::eq(start, &tight));
        sim.restore(&rollout.final_states, Some(&rows)).unwrap();
        assert_eq!(attached(&sim, held), [false, expected]);
    }
}

#[test]
fn refusals() {
    let (mut sim, _, held) = cubes(2);
    sim.add_robot(sr5("arm")).unwrap();
    sim.add_rigid_object(fixed(object("wall", ObjectShape::cube(0.1), [9.0; 3]))).unwrap();
    let text = r#"<mujoco><worldbody><body name="trunk"><freejoint/><geom size="0.1"/>
        <body name="tail" pos="0.3 0 0"><geom size="0.1"/></body></body></worldbody></mujoco>"#;
    sim.add_mjcf(MjcfPartCfg::text("part", text)).unwrap();
    let taken = WeldCfg { uid: "first".into(), ..weld("first", "second") };
    let other = |first: &str, second: &str| WeldCfg { uid: "other".into(), ..weld(first, second) };
    let field = "Config { field: \"weld\"";
    for (cfg, kind, part) in [
        (other("first", "secnd"), "candidates: [\"second\"", ""),
        (other("first", "first"), field, "different bodies"),
        (other("part/trunk", "part/tail"), field, "different bodies"),
        (other("wall", "world"), field, "must be dynamic"),
        (other("first", "arm"), field, "one of its links"),
        (taken, "DuplicateUid(\"first\")", ""),
        (weld("first", "second"), "DuplicateUid(", ""),
    ] {
        assert_error(sim.add_weld(cfg), kind, &[part]);
    }
    let far = sim.weld_mut(held).attach(Some(&[EnvId(1), EnvId(2)]));
    assert!(matches!(far, Err(Error::UnknownIndex { index: 2, .. })));
    let twice = sim.weld_mut(held).release(Some(&[EnvId(1), EnvId(1)]));
    assert!(matches!(twice, Err(Error::RepeatedItem { argument: "release", .. })));
    assert_eq!(attached(&sim, held), [false, false]);
}

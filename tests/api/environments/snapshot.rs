//! Continuing from a snapshot gives the same bits, in any manager and environment; snapshots of other scenes are
//! refused.

use super::worlds::{ALL, all_bits, all_properties, all_values, arm, bits_of, cfg, cube, fewest_contacts, world};
use kinetoscope::ndarray::{Array2, Array3, array};
use kinetoscope::prelude::*;
use kinetoscope::sensors::JointStateCfg;
use kinetoscope::sim::{DelayedPd, DriveType, Error, FrictionCone, Integrator, Snapshot, SnapshotError, WrenchFrame};
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::urdf;
use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::worlds::text_robot;

/// A snapshot after 500 steps, with the bits at that time and 300 steps later.
fn run(settings: SimulationManagerCfg) -> (SimulationManager, Snapshot, Vec<Vec<u64>>, Vec<Vec<u64>>) {
    let (mut sim, _) = world(settings);
    sim.update(500);
    assert!(fewest_contacts(&sim) > 3 && sim.diverged().is_empty(), "the world is what this test is about");
    let (snapshot, there) = (sim.snapshot(ALL).unwrap(), all_bits(&sim));
    sim.update(300);
    let end = all_bits(&sim);
    assert!(end.iter().zip(&there).all(|(end, there)| end != there), "everything moves on");
    (sim, snapshot, there, end)
}

#[test]
fn same_bits() {
    for settings in [cfg(3, 2), SimulationManagerCfg { cone: FrictionCone::Elliptic, substeps: 2, ..cfg(3, 1) }] {
        let (mut sim, snapshot, there, end) = run(settings.clone());
        sim.restore(&snapshot, ALL).unwrap();
        assert!(all_bits(&sim) == there, "the state is back");
        assert!((snapshot.time()[0] - 5.0).abs() < 1e-9 && sim.time() == snapshot.time());
        sim.update(300);
        assert!(all_bits(&sim) == end, "and continues bit-identically");

        // A new manager of the same program, with another number of threads.
        let (mut fresh, _) = world(SimulationManagerCfg { threads: Some(3), ..settings });
        fresh.restore(&snapshot, ALL).unwrap();
        assert!(all_bits(&fresh) == there);
        fresh.update(300);
        assert!(all_bits(&fresh) == end);

        // Control: without the snapshot the manager is in another state.
        let (mut other, _) = world(fresh.cfg().clone());
        other.update(300);
        assert!(all_bits(&other) != end);
    }
}

#[test]
fn other_environments() {
    let (mut sim, snapshot, there, end) = run(cfg(3, 2));
    // The first to the last, the last to the first.
    sim.restore(&snapshot, Some(&[EnvId(2), EnvId(1), EnvId(0)])).unwrap();
    assert_eq!(all_bits(&sim), [there[2].clone(), there[1].clone(), there[0].clone()]);
    sim.update(300);
    assert_eq!(all_bits(&sim), [end[2].clone(), end[1].clone(), end[0].clone()]);
    // One to all, and into a manager with one environment.
    sim.restore(&snapshot, ALL).unwrap();
    let one = sim.snapshot(Some(&[EnvId(1)])).unwrap();
    assert_eq!((one.len(), one.env_ids()), (1, vec![EnvId(1)]));
    sim.restore(&one, Some(&[EnvId(0), EnvId(2)])).unwrap();
    assert_eq!(all_bits(&sim), vec![there[1].clone(); 3]);
    let (mut single, _) = world(cfg(1, 1));
    single.restore(&one, Some(&[EnvId(0)])).unwrap();
    single.update(300);
    assert_eq!(all_bits(&single)[0], end[1]);
    // A subset leaves the others unchanged.
    sim.update(10);
    let before = all_bits(&sim);
    sim.restore(&one, Some(&[EnvId(2)])).unwrap();
    assert_eq!(all_bits(&sim), [before[0].clone(), before[1].clone(), there[1].clone()]);
}

#[test]
fn file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("state.kts");
    let (_, snapshot, there, end) = run(cfg(2, 2));
    std::fs::write(&path, "an older file").unwrap();
    snapshot.save(&path).unwrap();
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "nothing temporary is left");
    let (mut sim, _) = world(cfg(2, 1));
    sim.restore(&Snapshot::load(&path).unwrap(), ALL).unwrap();
    assert!(all_bits(&sim) == there);
    sim.update(300);
    assert!(all_bits(&sim) == end);
}

#[test]
fn bad_files() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("state.kts");
    let mut sim = SimulationManager::new(cfg(2, 1)).unwrap();
    sim.add_robot(arm()).unwrap();
    sim.snapshot(ALL).unwrap().save(&path).unwrap();
    let good = std::fs::read(&path).unwrap();
    let fault = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        match Snapshot::load(&path) {
            Err(Error::Snapshot(fault)) => fault,
            other => panic!("{other:?}"),
        }
    };
    assert!(matches!(fault(&good[..good.len() / 2]), SnapshotError::Truncated { .. }));
    assert!(matches!(fault(b"{\"json\": true}"), SnapshotError::NotASnapshot { .. }));
    let mut bytes = good.clone();
    bytes[good.len() / 2] ^= 0x10;
    assert!(matches!(fault(&bytes), SnapshotError::Damaged { .. }));
    let message = fault(&bytes).to_string();
    assert!(message.contains("state.kts"), "{message}");
    assert!(matches!(Snapshot::load(dir.path().join("nowhere")), Err(Error::File { .. })));
    let unwritable = sim.snapshot(ALL).unwrap().save(dir.path().join("no/such/folder/file"));
    assert!(matches!(unwritable, Err(Error::File { .. })));
}

#[test]
fn other_scenes() {
    let mut sim = SimulationManager::new(cfg(3, 1)).unwrap();
    sim.add_robot(arm()).unwrap();
    sim.update(5);
    let snapshot = sim.snapshot(ALL).unwrap();
    let before = all_bits(&sim);
    let mut other = SimulationManager::new(cfg(3, 1)).unwrap();
    other.add_robot(RobotCfg { uid: "leg".into(), ..arm() }).unwrap();
    assert_error(other.restore(&snapshot, ALL), "Snapshot(OtherScene", &["arm/", "leg/"]);
    let unknown = sim.snapshot(Some(&[EnvId(3)]));
    assert!(matches!(unknown, Err(Error::UnknownIndex { index: 3, .. })));
    assert_eq!(all_bits(&sim), before);
    // After an addition, earlier snapshots belong to another scene.
    sim.add_rigid_object(cube("late", 1.0, [1.0, 1.0, 1.0])).unwrap();
    assert!(matches!(sim.restore(&snapshot, ALL), Err(Error::Snapshot(SnapshotError::OtherScene { .. }))));
}

#[test]
fn other_settings() {
    let build = |settings| {
        let mut sim = SimulationManager::new(settings).unwrap();
        // Without a robot, because the drives of `arm` require Euler's integrator.
        sim.add_rigid_object(cube("box", 1.0, [0.0, 0.0, 1.0])).unwrap();
        sim
    };
    let mut sim = build(cfg(1, 1));
    let file = tempfile::NamedTempFile::new().unwrap();
    sim.snapshot(ALL).unwrap().save(file.path()).unwrap();
    let snapshot = Snapshot::load(file.path()).unwrap();
    let others = [
        (SimulationManagerCfg { physics_dt: 0.005, ..cfg(1, 1) }, "timestep 0.005"),
        // The same MuJoCo steps, but two of them per update.
        (SimulationManagerCfg { physics_dt: 0.02, substeps: 2, ..cfg(1, 1) }, "2 substeps"),
        (SimulationManagerCfg { integrator: Integrator::Rk4, ..cfg(1, 1) }, "RK4"),
        (SimulationManagerCfg { cone: FrictionCone::Elliptic, ..cfg(1, 1) }, "elliptic"),
    ];
    for (settings, what) in others {
        assert_error(build(settings).restore(&snapshot, ALL), "Snapshot(OtherScene", &[what]);
    }
    // Control.
    build(cfg(1, 1)).restore(&snapshot, ALL).unwrap();
    sim.restore(&snapshot, ALL).unwrap();
}

#[test]
fn diverged() {
    let files = TempFiles::default();
    let spin = urdf::joint("spin", "continuous", ["post", "disc"], [0.0; 3], "0 1 0", "");
    let disc = urdf::link("disc", 1.0, 0.01, [0.1, 0.0, 0.0], "");
    let wheel = urdf::robot("wheel", &format!("<link name=\"post\"/>{spin}{disc}"));
    let mut sim = SimulationManager::new(cfg(3, 1)).unwrap();
    let wheel = sim.add_robot(text_robot(&files, "wheel", &wheel)).unwrap();
    sim.update(20);
    let good = sim.snapshot(ALL).unwrap();
    sim.robot_mut(wheel).write_qpos(&array![[1e11]], None, Some(&[EnvId(1)])).unwrap();
    sim.update(5);
    let reason = sim.diverged();
    assert_eq!(reason.len(), 1);
    // MuJoCo's warnings are counted per environment.
    let counts = [0, 1, 2].map(|env| sim.warnings().env_counts(EnvId(env)).unwrap());
    assert!(counts[0].is_empty() && !counts[1].is_empty() && counts[2].is_empty(), "{counts:?}");
    assert!(counts[1].iter().all(|(name, count)| sim.warnings().counts()[*name] == *count), "{counts:?}");
    assert!(matches!(sim.warnings().env_counts(EnvId(3)), Err(Error::UnknownIndex { index: 3, .. })));
    let bad = sim.snapshot(ALL).unwrap();
    bad.save(files.folder().join("bad")).unwrap();
    sim.restore(&good, ALL).unwrap();
    assert!(sim.diverged().is_empty(), "revived");
    sim.update(25);
    assert!(sim.time().iter().all(|time| (time - 0.45).abs() < 1e-9), "and it goes on");
    sim.restore(&Snapshot::load(files.folder().join("bad")).unwrap(), ALL).unwrap();
    assert_eq!(sim.diverged(), reason);
    let before = sim.batch().read(1, bits_of);
    sim.update(5);
    assert_eq!(sim.batch().read(1, bits_of), before, "it does not move");
    assert!((sim.time()[0] - 0.30).abs() < 1e-9 && (sim.time()[1] - 0.20).abs() < 1e-9);
}

#[test]
fn sensors() {
    let mut sim = SimulationManager::new(cfg(2, 1)).unwrap();
    let robot = sim.add_robot(arm()).unwrap();
    sim.robot_mut(robot).set_qpos_target(&Array2::from_elem((1, 6), 0.4), None, None).unwrap();
    let sampling = SamplingCfg { history_length: 4, ..SamplingCfg::every(0.05) };
    let id = sim.add_sensor("joints", JointStateCfg { sampling, ..Default::default() }).unwrap();
    sim.update(23);
    let (snapshot, there) = (sim.snapshot(Some(&[EnvId(1)])).unwrap(), sim.robot(robot).qpos());
    sim.update(40);
    let other = sim.sensor(id).unwrap().positions().row(0).to_owned();
    sim.restore(&snapshot, ALL).unwrap();
    let sensor = sim.sensor(id).unwrap();
    assert_eq!(sensor.positions().row(1), there.row(1), "at once");
    assert_eq!(sensor.positions().row(0), other, "the other environment's are its own");
    assert_eq!(sensor.sample_counts().to_vec(), [12, 0]);
    sim.update(4);
    assert_eq!(sim.sensor(id).unwrap().sample_counts()[1], 0, "periods count from the restored state");
    sim.update(1);
    let sensor = sim.sensor(id).unwrap();
    assert_eq!(sensor.sample_counts()[1], 1);
    assert_eq!(sensor.positions().row(1), sim.robot(robot).qpos().row(1));
}

/// Delay lines, changed drives and wrenches are part of a snapshot, in memory and in a file.
#[test]
fn drives_and_wrenches() {
    let delayed = DelayedPd { delay: 4, max_delay: 9 }.into();
    let drive =
        DriveCfg { actuators: vec![("JOINT[12]".into(), delayed)], ..kinetoscope_testkit::worlds::gains(200.0, 20.0) };
    let build = || {
        let mut sim = SimulationManager::new(cfg(2, 1)).unwrap();
        let id = sim.add_robot(RobotCfg { drive: drive.clone(), ..arm() }).unwrap();
        (sim, id)
    };
    let command = |sim: &mut SimulationManager, id: RobotId, n: u32| {
        let n = f64::from(n);
        let targets = Array2::from_shape_fn((2, 6), |(e, k)| 0.3 * (0.2 * n + k as f64 + 0.5 * e as f64).sin());
        sim.robot_mut(id).set_qpos_target(&targets, None, None).unwrap();
    };
    let go = |sim: &mut SimulationManager, id: RobotId, from: u32| {
        (from..from + 60).for_each(|n| {
            command(sim, id, n);
            sim.update(1);
        });
        all_bits(sim)
    };
    let (mut sim, id) = build();
    let first = sim.robot(id).find_joints(&["JOINT[12]"]).unwrap();
    let links = sim.robot(id).link_names().len();
    let force = Array3::from_elem((1, links, 3), 0.7);
    let mut arm = sim.robot_mut(id);
    arm.set_delay(&array![[2_u32, 9]], Some(&first), Some(&[EnvId(1)])).unwrap();
    arm.set_drive_type(DriveType::Acceleration, Some(&[JointIndex(3)]), None).unwrap();
    arm.set_qf_limits(&array![[11.0]], Some(&[JointIndex(2)]), None).unwrap();
    arm.set_external_wrench(&force, &force, WrenchFrame::Link, None, Some(&[EnvId(0)])).unwrap();
    arm.set_gravity_compensation(true, None, Some(&[EnvId(1)])).unwrap();
    go(&mut sim, id, 0);
    let snapshot = sim.snapshot(ALL).unwrap();
    let file = tempfile::NamedTempFile::new().unwrap();
    snapshot.save(file.path()).unwrap();
    let end = go(&mut sim, id, 60);
    let (mut fresh, its) = build();
    fresh.restore(&Snapshot::load(file.path()).unwrap(), ALL).unwrap();
    assert_eq!(fresh.robot(its).delay(), sim.robot(id).delay());
    assert_eq!(fresh.robot(its).drive_types(), sim.robot(id).drive_types());
    assert_eq!(fresh.robot(its).gravity_compensation(), sim.robot(id).gravity_compensation());
    assert!(go(&mut fresh, its, 60) == end, "the same bits from a file");
    sim.restore(&snapshot, ALL).unwrap();
    assert!(go(&mut sim, id, 60) == end, "and from memory");
    // Control: without these changes the states differ.
    let (mut other, its) = build();
    go(&mut other, its, 0);
    assert!(go(&mut other, its, 60) != end);
}

/// From memory and from a file, into the same manager and an equal one: the same bits with the properties of the
/// snapshot, and the next randomizations repeat as well.
#[test]
fn with_properties() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("drawn.kts");
    let (mut sim, ids) = world(cfg(3, 2));
    sim.properties_mut().randomize(&all_properties(), Some(&[EnvId(0), EnvId(2)])).unwrap();
    sim.robot_mut(ids.arm).set_damping(&array![[77.0, 78.0, 79.0, 80.0, 81.0, 82.0]], None, Some(&[EnvId(2)])).unwrap();
    sim.update(120);
    let (snapshot, there, properties_at_snapshot) = (sim.snapshot(ALL).unwrap(), all_bits(&sim), all_values(&sim));
    snapshot.save(&path).unwrap();
    let stiffness = sim.robot(ids.arm).stiffness();
    sim.update(80);
    let end = all_bits(&sim);
    sim.properties_mut().randomize(&all_properties(), ALL).unwrap();
    let next = all_values(&sim);
    assert!(properties_at_snapshot != next && (0..3).all(|env| properties_at_snapshot[env] != next[env]));
    // In the same manager, from memory, after other properties; in another manager, from the file, after another
    // randomization.
    let (mut fresh, _) = world(cfg(3, 1));
    fresh.properties_mut().randomize_with(ALL, |_, _, p| p.set(Property::Friction, "ground", &[0.1])).unwrap();
    let loaded = Snapshot::load(&path).unwrap();
    for (sim, snapshot) in [(&mut sim, &snapshot), (&mut fresh, &loaded)] {
        sim.properties_mut().restore(snapshot, ALL).unwrap();
        assert!(all_bits(sim) == there && all_values(sim) == properties_at_snapshot, "back, in every bit");
        assert_eq!(sim.properties().bytes(EnvId(1)).unwrap(), 0, "what was nominal is shared again");
        sim.update(80);
        assert!(all_bits(sim) == end, "and continues bit-identically");
        sim.properties_mut().randomize(&all_properties(), ALL).unwrap();
        assert!(all_values(sim) == next, "the next draw is the next one");
        // Restored gains still count as randomized: a randomized gain persists when a plain state is restored, a set
        // gain does not.
        sim.properties_mut().restore(snapshot, ALL).unwrap();
        assert_eq!(sim.robot(sim.entities().robot_id("arm").unwrap()).stiffness(), stiffness);
    }
    // Control: a plain restore leaves properties unchanged, and the states differ.
    sim.properties_mut().reset(ALL).unwrap();
    sim.restore(&snapshot, ALL).unwrap();
    assert!(all_values(&sim) != properties_at_snapshot);
    sim.update(80);
    assert!(all_bits(&sim) != end);
    // Into other environments: each gets the properties of the snapshot's row.
    let now = sim.snapshot(ALL).unwrap();
    sim.properties_mut().restore(&now, ALL).unwrap();
    fresh.properties_mut().restore(&loaded, Some(&[EnvId(2), EnvId(1), EnvId(0)])).unwrap();
    assert_eq!(
        all_values(&fresh),
        [properties_at_snapshot[2].clone(), properties_at_snapshot[1].clone(), properties_at_snapshot[0].clone()]
    );
    fresh.update(80);
    assert!(all_bits(&fresh) == [end[2].clone(), end[1].clone(), end[0].clone()]);
    // The end of a rollout includes the properties of the rollout.
    let rollout = fresh.rollout(&Array3::zeros((1, 5, 7)), None, ALL).unwrap();
    fresh.properties_mut().reset(ALL).unwrap();
    fresh.properties_mut().restore(&rollout.final_states, ALL).unwrap();
    assert_eq!(
        all_values(&fresh),
        [properties_at_snapshot[2].clone(), properties_at_snapshot[1].clone(), properties_at_snapshot[0].clone()]
    );
}

/// A scene with the same states in which an entity lacks the property is refused as another scene, and nothing changes.
#[test]
fn missing_properties() {
    let build = |size: bool| {
        let mut sim = SimulationManager::new(cfg(2, 1)).unwrap();
        let shape = if size { ObjectShape::cube(0.1) } else { ObjectShape::Cone { radius: 0.1, height: 0.1 } };
        sim.add_rigid_object(RigidObjectCfg { shape, ..cube("box", 1.0, [0.0, 0.0, 1.0]) }).unwrap();
        sim
    };
    let mut sim = build(true);
    sim.properties_mut()
        .randomize_with(Some(&[EnvId(1)]), |_, _, p| p.set(Property::Size, "box", &[0.1, 0.2, 0.3]))
        .unwrap();
    let snapshot = sim.snapshot(ALL).unwrap();
    let mut other = build(false);
    other.update(3);
    let before = all_bits(&other);
    let result = other.properties_mut().restore(&snapshot, ALL);
    assert_error(result, "Snapshot(OtherScene", &["size", "box"]);
    assert_eq!(all_bits(&other), before);
    other.restore(&snapshot, ALL).unwrap();
    assert!(matches!(sim.properties_mut().restore(&snapshot, Some(&[EnvId(2)])), Err(Error::UnknownIndex { .. })));
}

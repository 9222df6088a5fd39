//! A diverged environment is taken out, reported and revived; the others do not notice.

use super::support::{all_bits, bits_of, cfg, drives, free_robot, walker, wheel};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::sim::batch::Batch;
use kinetoscope::sim::env::{Divergence, EnvStatus};
use kinetoscope::sim::mj::{Data, Warning};

fn walkers(num_envs: usize) -> SimulationManager {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(num_envs, 2)).unwrap();
    sim.add_robot(free_robot(dir.path(), "walker", &walker(), 0.3)).unwrap();
    sim
}

/// A batch below the manager, in the manager's initial state.
fn batch_of(sim: &SimulationManager, num_envs: usize) -> Batch {
    Batch::new(&kinetoscope::sim::env::with_small_buffers(sim.batch().model()), &drives(sim), num_envs, 2).unwrap()
}

type BlowUp = (&'static str, fn(&mut Data), Warning);

const BLOW_UPS: [BlowUp; 6] = [
    ("velocity huge", |d| d.qvel_mut()[0] = f64::MAX, Warning::BadVelocity),
    ("velocity NaN", |d| d.qvel_mut()[3] = f64::NAN, Warning::BadVelocity),
    ("position infinite", |d| d.qpos_mut()[2] = f64::INFINITY, Warning::BadPosition),
    ("joint NaN", |d| d.qpos_mut()[7] = f64::NAN, Warning::BadPosition),
    ("force huge", |d| d.xfrc_applied_mut()[6] = 1e300, Warning::BadAcceleration),
    ("force NaN", |d| d.xfrc_applied_mut()[8] = f64::NAN, Warning::BadAcceleration),
];

#[test]
fn one_of_64_blows_up_and_63_do_not_notice() {
    let sim = walkers(1);
    for (what, blow_up, warning) in BLOW_UPS {
        let (mut batch, mut calm) = (batch_of(&sim, 64), batch_of(&sim, 64));
        batch.step(50);
        calm.step(50);
        let last_good = calm.read(17, bits_of);
        batch.write(17, |env| env.write(blow_up));
        batch.step(30);
        calm.step(30);
        batch.read(17, |env| {
            let EnvStatus::Diverged { step, reason } = env.status() else { panic!("{what}: {:?}", env.status()) };
            assert_eq!(*step, 50, "{what}");
            assert_eq!(*reason, Divergence::Warning(warning), "{what}");
            assert!((env.data().time() - 0.5).abs() < 1e-9, "{what}: time is {}", env.data().time());
            assert_eq!(bits_of(env), last_good, "{what}: the last good state");
            let height = env.data().xpos()[5];
            assert!((height - env.data().qpos()[2]).abs() < 1e-12, "{what}: poses belong to the state");
        });
        for (k, (mine, theirs)) in all_bits(&batch).into_iter().zip(all_bits(&calm)).enumerate() {
            assert!(k == 17 || mine == theirs, "{what}: environment {k} changed");
        }
        batch.write(17, |env| env.reset(|_, _| ()));
        let mut fresh = batch_of(&sim, 1);
        assert_eq!(batch.read(17, bits_of), fresh.read(0, bits_of), "{what}: revived");
        batch.step(20);
        fresh.step(20);
        assert_eq!(batch.read(17, bits_of), fresh.read(0, bits_of), "{what}: and goes on");
    }
}

#[test]
fn the_manager_reports_and_revives() {
    let dir = tempfile::tempdir().unwrap();
    let new = |n| {
        let mut sim = SimulationManager::new(cfg(n, 2)).unwrap();
        let robot = sim.add_robot(wheel(dir.path())).unwrap();
        (sim, robot)
    };
    for bad in [f64::MAX, -1e11] {
        let (mut sim, robot) = new(64);
        let (mut calm, _) = new(64);
        sim.update(25);
        calm.update(25);
        let last_good = calm.batch().read(40, bits_of);
        sim.robot_mut(robot).write_qpos(&array![[bad]], None, Some(&[EnvId(40)])).unwrap();
        assert_eq!(sim.diverged().len(), 1, "reported at once");
        sim.update(25);
        calm.update(25);
        let diverged = sim.diverged();
        assert_eq!(diverged.len(), 1);
        assert_eq!(diverged[0].0, EnvId(40));
        assert!(diverged[0].1.contains("bad-position") && diverged[0].1.contains("25"), "{diverged:?}");
        assert_eq!(sim.batch().read(40, bits_of), last_good);
        assert_eq!(sim.time()[40], sim.batch().read(40, |env| env.data().time()));
        assert!((sim.time()[40] - 0.25).abs() < 1e-9 && (sim.time()[39] - 0.5).abs() < 1e-9);
        assert_eq!(sim.warning_counts()["environment-diverged"], 1);
        assert_eq!(sim.warning_counts()["mujoco-bad-position"], 1);
        for (k, (mine, theirs)) in all_bits(sim.batch()).into_iter().zip(all_bits(calm.batch())).enumerate() {
            assert!(k == 40 || mine == theirs, "environment {k}");
        }
        // Only a reset revives, and only the one that is named.
        let before = all_bits(sim.batch());
        sim.reset(Some(&[EnvId(40)])).unwrap();
        assert!(sim.diverged().is_empty());
        let (mut fresh, _) = new(1);
        assert_eq!(sim.batch().read(40, bits_of), fresh.batch().read(0, bits_of));
        assert_eq!(sim.batch().read(41, bits_of), before[41]);
        sim.update(10);
        fresh.update(10);
        assert_eq!(sim.batch().read(40, bits_of), fresh.batch().read(0, bits_of));
    }
}

#[test]
fn a_state_that_blows_up_in_the_step_is_undone() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(4, 2)).unwrap();
    let robot = sim.add_robot(wheel(dir.path())).unwrap();
    sim.update(10);
    // Below MuJoCo's largest number; an unlimited drive answers with an acceleration above it.
    sim.robot_mut(robot).write_qpos(&array![[9e9]], None, Some(&[EnvId(2)])).unwrap();
    assert!(sim.diverged().is_empty());
    sim.update(1);
    let diverged = sim.diverged();
    assert_eq!(diverged.len(), 1, "{diverged:?}");
    assert!(diverged[0].1.contains("step 10"), "{diverged:?}");
    assert_eq!(sim.robot(robot).get_qpos()[(2, 0)], 9e9, "the state before the step");
    assert!((sim.time()[2] - 0.1).abs() < 1e-12);
    assert_eq!(sim.robot(robot).get_qvel().iter().filter(|v| !v.is_finite()).count(), 0);
    sim.reset(None).unwrap();
    assert!(sim.diverged().is_empty());
    assert_eq!(sim.robot(robot).get_qpos()[(2, 0)], 0.7);
}

#[test]
fn a_quarantined_environment_can_be_written_to_and_stays_out() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(3, 1)).unwrap();
    let robot = sim.add_robot(wheel(dir.path())).unwrap();
    sim.robot_mut(robot).write_qpos(&array![[1e300]], None, Some(&[EnvId(1)])).unwrap();
    for value in [0.4, 1e300, 0.2] {
        sim.robot_mut(robot).write_qpos(&array![[value]], None, Some(&[EnvId(1)])).unwrap();
        sim.update(3);
        assert_eq!(sim.diverged().len(), 1);
        assert!(sim.robot(robot).get_qpos().iter().all(|q| q.abs() < 10.0), "{}", sim.robot(robot).get_qpos());
    }
}

#[test]
fn adding_a_robot_revives_nobody() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(3, 1)).unwrap();
    let robot = sim.add_robot(wheel(dir.path())).unwrap();
    sim.update(5);
    sim.robot_mut(robot).write_qpos(&array![[1e300]], None, Some(&[EnvId(1)])).unwrap();
    let (diverged, counts) = (sim.diverged(), sim.warning_counts());
    sim.add_robot(free_robot(dir.path(), "walker", &walker(), 0.3)).unwrap();
    assert_eq!(sim.diverged(), diverged);
    assert_eq!(sim.warning_counts()["mujoco-bad-position"], counts["mujoco-bad-position"]);
    sim.update(5);
    assert_eq!(sim.diverged(), diverged, "it stands still");
    assert!((sim.time()[1] - 0.05).abs() < 1e-12);
}

//! Quarantine: a diverged environment is stopped, reported and revived by a reset; the others are unaffected.

use super::support::{add_walker, all_bits, bits_of, cfg, sim, wheel};
use kinetoscope::exec::ThreadPool;
use kinetoscope::mujoco::{Data, Warning};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::sim::DivergedEnv;
use kinetoscope::sim::batch::Batch;
use kinetoscope::sim::env::{Divergence, EnvStatus, with_small_buffers};
use kinetoscope_testkit::urdf::TempFiles;
use std::sync::Arc;

type BlowUp = (&'static str, fn(&mut Data), Warning);

const BLOW_UPS: [BlowUp; 8] = [
    ("velocity huge", |d| d.qvel_mut()[0] = f64::MAX, Warning::BadVelocity),
    ("velocity infinite", |d| d.qvel_mut()[1] = f64::NEG_INFINITY, Warning::BadVelocity),
    ("velocity NaN", |d| d.qvel_mut()[3] = f64::NAN, Warning::BadVelocity),
    ("position infinite", |d| d.qpos_mut()[2] = f64::INFINITY, Warning::BadPosition),
    ("joint NaN", |d| d.qpos_mut()[7] = f64::NAN, Warning::BadPosition),
    ("force huge", |d| d.xfrc_applied_mut()[6] = 1e300, Warning::BadAcceleration),
    ("force infinite", |d| d.xfrc_applied_mut()[7] = f64::INFINITY, Warning::BadAcceleration),
    ("force NaN", |d| d.xfrc_applied_mut()[8] = f64::NAN, Warning::BadAcceleration),
];

/// One of 64 environments diverges, with no manager on top of the batch; after 50 steps it holds its initial state.
#[test]
fn one_of_64() {
    let mut sim = sim(cfg(1, 2));
    add_walker(&mut sim, "walker", 0.3);
    let table = sim.batch().read(0, |env| Arc::clone(env.drives.table()));
    let model = with_small_buffers(sim.batch().model());
    let batch_of = |num_envs| Batch::new(&model, &table, num_envs, 2, ThreadPool::new()).unwrap();
    for (what, blow_up, warning) in BLOW_UPS {
        let (mut batch, mut calm) = (batch_of(64), batch_of(64));
        batch.step(50);
        calm.step(50);
        let last_good = calm.read(17, bits_of);
        batch.write(17, |env| env.write(blow_up));
        batch.step(30);
        calm.step(30);
        batch.read(17, |env| {
            let EnvStatus::Diverged { step, reason } = env.status() else { panic!("{what}: {:?}", env.status()) };
            assert_eq!((*step, reason), (50, &Divergence::Warning(warning)), "{what}");
            assert!((env.data().time() - 0.5).abs() < 1e-9, "{what}: time is {}", env.data().time());
            assert_eq!(bits_of(env), last_good, "{what}: the last good state");
            let height = env.data().xpos()[5];
            assert!((height - env.data().qpos()[2]).abs() < 1e-12, "{what}: poses belong to the state");
        });
        let different: Vec<usize> = (0..64).filter(|&k| batch.read(k, bits_of) != calm.read(k, bits_of)).collect();
        assert_eq!(different, [17], "{what}");
        batch.write(17, |env| env.reset(|_, _| ()));
        let mut fresh = batch_of(1);
        assert_eq!(batch.read(17, bits_of), fresh.read(0, bits_of), "{what}: revived");
        batch.step(20);
        fresh.step(20);
        assert_eq!(batch.read(17, bits_of), fresh.read(0, bits_of), "{what}: and continues");
    }
}

fn wheels(num_envs: usize) -> (SimulationManager, RobotId) {
    let (files, mut sim) = (TempFiles::default(), sim(cfg(num_envs, 2)));
    let robot = sim.add_robot(wheel(&files)).unwrap();
    (sim, robot)
}

fn put(sim: &mut SimulationManager, robot: RobotId, position: f64, env: usize) {
    sim.robot_mut(robot).write_qpos(&array![[position]], None, Some(&[EnvId(env)])).unwrap();
}

#[test]
fn report_and_revival() {
    for bad in [f64::MAX, -1e11] {
        let ((mut sim, robot), (mut calm, _)) = (wheels(64), wheels(64));
        sim.update(25);
        calm.update(25);
        let last_good = calm.batch().read(40, bits_of);
        put(&mut sim, robot, bad, 40);
        assert_eq!(sim.diverged().len(), 1, "reported at once");
        sim.update(25);
        calm.update(25);
        let diverged = sim.diverged();
        let [DivergedEnv { env: EnvId(40), .. }] = &diverged[..] else { panic!("{diverged:?}") };
        let message = diverged[0].to_string();
        assert!(message.contains("bad-position") && message.contains("25"), "{message}");
        assert_eq!(sim.batch().read(40, bits_of), last_good);
        assert_eq!(sim.time()[40], sim.batch().read(40, |env| env.data().time()));
        assert!((sim.time()[40] - 0.25).abs() < 1e-9 && (sim.time()[39] - 0.5).abs() < 1e-9);
        assert_eq!(sim.warnings().counts()["environment-diverged"], 1);
        assert_eq!(sim.warnings().counts()["mujoco-bad-position"], 1);
        let (before, undisturbed) = (all_bits(&sim), all_bits(&calm));
        assert!((0..64).all(|k| k == 40 || before[k] == undisturbed[k]), "the others");
        // Only a reset revives an environment, and only the named one.
        sim.reset(Some(&[EnvId(40)])).unwrap();
        assert!(sim.diverged().is_empty());
        let (mut fresh, _) = wheels(1);
        assert_eq!(sim.batch().read(40, bits_of), fresh.batch().read(0, bits_of));
        assert_eq!(sim.batch().read(41, bits_of), before[41]);
        sim.update(10);
        fresh.update(10);
        assert_eq!(sim.batch().read(40, bits_of), fresh.batch().read(0, bits_of));
    }
}

/// A position below MuJoCo's limit, with an unlimited drive that produces an acceleration above it: the step is undone.
#[test]
fn divergence_in_a_step() {
    let (mut sim, robot) = wheels(4);
    sim.update(10);
    put(&mut sim, robot, 9e9, 2);
    assert!(sim.diverged().is_empty());
    sim.update(1);
    let diverged = sim.diverged();
    assert!(diverged.len() == 1 && diverged[0].step == 10, "{diverged:?}");
    assert_eq!(sim.robot(robot).qpos()[(2, 0)], 9e9, "the state before the step");
    assert!((sim.time()[2] - 0.1).abs() < 1e-12);
    assert!(sim.robot(robot).qvel().iter().all(|v| v.is_finite()));
    sim.reset(None).unwrap();
    assert!(sim.diverged().is_empty());
    assert_eq!(sim.robot(robot).qpos()[(2, 0)], 0.7);
}

/// Writing to a diverged environment and adding a robot do not revive it.
#[test]
fn no_revival() {
    let (mut sim, robot) = wheels(3);
    sim.update(5);
    put(&mut sim, robot, 1e300, 1);
    let (diverged, counts) = (sim.diverged(), sim.warnings().counts());
    add_walker(&mut sim, "walker", 0.3);
    assert_eq!(sim.diverged(), diverged);
    assert_eq!(sim.warnings().counts()["mujoco-bad-position"], counts["mujoco-bad-position"]);
    sim.update(5);
    assert_eq!(sim.diverged(), diverged, "it does not move");
    assert!((sim.time()[1] - 0.05).abs() < 1e-12);
    for value in [0.4, 1e300, 0.2] {
        put(&mut sim, robot, value, 1);
        sim.update(3);
        assert_eq!(sim.diverged().len(), 1);
        assert!(sim.robot(robot).qpos().iter().all(|q| q.abs() < 10.0), "{}", sim.robot(robot).qpos());
    }
}

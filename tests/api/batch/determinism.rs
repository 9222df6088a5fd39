//! The same bits for any number of threads and environments, and for one update or many.

use super::support::{all_bits, arm_and_hand, cfg, free_robot, most_contacts, walker};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;

/// The arm reaches into the ground, the walker falls on it and kicks, each environment with targets of its own.
fn scene(num_envs: usize, threads: usize) -> SimulationManager {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(num_envs, threads)).unwrap();
    let arm = sim.add_robot(arm_and_hand()).unwrap();
    let legs = sim.add_robot(free_robot(dir.path(), "walker", &walker(), 0.5)).unwrap();
    for (robot, reach) in [(arm, 1.6), (legs, -0.8)] {
        let dof = sim.robot(robot).dof();
        // By the index of the environment, not by their number.
        let targets = Array2::from_shape_fn((num_envs, dof), |(env, joint)| {
            if joint == 1 { reach + 0.01 * env as f64 } else { 0.3 + 0.003 * env as f64 }
        });
        sim.robot_mut(robot).set_qpos(&targets, None, None).unwrap();
    }
    sim
}

fn run(num_envs: usize, threads: usize, steps: u32) -> Vec<Vec<u64>> {
    let mut sim = scene(num_envs, threads);
    sim.update(steps);
    assert!(most_contacts(sim.batch()) > 0, "nothing touches: the test tests too little");
    assert!(sim.diverged().is_empty(), "{:?}", sim.diverged());
    all_bits(sim.batch())
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let alone = run(33, 1, 200);
    assert!(alone.iter().skip(1).all(|env| *env != alone[0]), "environments have targets of their own");
    for threads in [2, 3, 8] {
        assert_eq!(run(33, threads, 200), alone, "{threads} threads");
    }
}

#[test]
fn any_number_of_environments_gives_the_same_bits() {
    let many = run(64, 2, 150);
    for n in [1, 7, 16, 33] {
        assert_eq!(run(n, 2, 150), many[..n], "{n} environments");
    }
}

#[test]
fn one_update_of_many_steps_equals_many_updates_of_one() {
    // More than the block in which steps are handed to the workers.
    let steps = 1003;
    let mut one_by_one = scene(3, 2);
    for _ in 0..steps {
        one_by_one.update(1);
    }
    let at_once = run(3, 1, steps);
    assert_eq!(all_bits(one_by_one.batch()), at_once);
    one_by_one.update(0);
    assert_eq!(all_bits(one_by_one.batch()), at_once, "no step changes nothing");
}

#[test]
fn substeps_are_steps() {
    let dir = tempfile::tempdir().unwrap();
    let robot = free_robot(dir.path(), "walker", &walker(), 0.4);
    let run = |physics_dt: f64, substeps: u32, steps: u32| {
        let mut sim = SimulationManager::new(SimulationManagerCfg { physics_dt, substeps, ..cfg(2, 2) }).unwrap();
        sim.add_robot(robot.clone()).unwrap();
        sim.update(steps);
        all_bits(sim.batch())
    };
    assert_eq!(run(0.008, 4, 100), run(0.002, 1, 400));
}

#[test]
fn managers_in_threads_do_not_disturb_each_other() {
    let alone = run(3, 1, 100);
    std::thread::scope(|scope| {
        let all: Vec<_> = (0..4).map(|i| scope.spawn(move || run(3, 1 + i % 2, 100))).collect();
        for one in all {
            assert_eq!(one.join().unwrap(), alone);
        }
    });
}

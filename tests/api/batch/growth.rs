//! Growth of buffers: a step with too small buffers is repeated with larger ones, with the same bits.

use super::support::{add_ball, add_plate, all_bits, assert_quiet, bits_of, cfg, copy_of, most_contacts, row, sim};
use kinetoscope::mujoco::{BUILD_VERSION, Buffers, Data, Model, SupportedVersion};
use kinetoscope::prelude::*;
use kinetoscope::sim::env::SimEnv;

/// Buffers that are large enough for all tests of this file.
const HUGE: Buffers = Buffers { contacts: 1000, constraints: 3000, arena_bytes: 64 << 20 };

/// Runs `sim` and a copy of its environment with large buffers, and compares them after every 10 steps.
fn compare_with_huge_buffers(sim: &mut SimulationManager, steps: u32, contacts: usize) {
    let huge = sim.batch().model().with_buffers(HUGE);
    let mut reference = sim.batch().read(0, |env| copy_of(&huge, env));
    let mut most = 0;
    for step in 0..=steps / 10 {
        let (mine, other) = (sim.batch().read(0, bits_of), bits_of(&reference));
        let different: Vec<usize> = (0..mine.len()).filter(|&i| mine[i] != other[i]).collect();
        assert!(different.is_empty(), "after {} steps: {different:?} of {}", 10 * step, mine.len());
        if step < steps / 10 {
            sim.update(10);
            reference.step(10);
            most = most.max(most_contacts(sim.batch()));
        }
    }
    assert_eq!(reference.buffer_growths(), 0, "the reference did not grow its buffers");
    assert!(most >= contacts, "{most} contacts");
    assert_quiet(sim);
}

#[test]
fn many_contacts() {
    let mut sim = sim(cfg(3, 2));
    add_plate(&mut sim, [14, 0], [0.0, 0.0, 0.1], [0.0; 3]);
    compare_with_huge_buffers(&mut sim, 60, 100);
    assert!(sim.warnings().buffer_growths() > 0);
}

/// A slightly tilted plate: contacts arise one after the other, and the buffers grow several times during the motion.
#[test]
fn drives_at_work() {
    let mut sim = sim(cfg(2, 1));
    let robot = add_plate(&mut sim, [16, 5], [0.0, 0.0, 0.1], [0.05, 0.04, 0.3]);
    sim.robot_mut(robot).set_qpos_target(&row([-0.9, -0.8, -0.7, -1.1, -0.3]), None, None).unwrap();
    compare_with_huge_buffers(&mut sim, 150, 60);
    assert!(sim.warnings().buffer_growths() > 0);
    let moved = sim.robot(robot).qf();
    assert!(moved.iter().any(|effort| effort.abs() > 0.1), "{moved}");
}

#[test]
fn pile_of_robots() {
    let mut sim = sim(cfg(2, 2));
    for i in 0..24 {
        let (layer, place) = (f64::from(i / 6), f64::from(i % 6));
        let [x, y] = [0.115 * (place % 3.0) + 0.01 * layer, 0.115 * (place / 3.0).floor()];
        add_ball(&mut sim, &format!("ball{i}"), [x, y, 0.058 + 0.1 * layer]);
    }
    compare_with_huge_buffers(&mut sim, 60, 24);
    // On 4.x the arena of a scene of 24 robots has room for the pile.
    assert_eq!(sim.warnings().buffer_growths() > 0, BUILD_VERSION == SupportedVersion::V2);
}

/// The model, and an environment with many contacts.
fn resting_plate() -> (Model, SimEnv) {
    let mut sim = sim(cfg(1, 1));
    add_plate(&mut sim, [9, 3], [0.0, 0.0, 0.03], [0.0; 3]);
    let model = sim.batch().model().with_buffers(HUGE);
    let mut env = sim.batch().read(0, |env| copy_of(&model, env));
    env.step(40);
    assert!(env.data().contact().len() > 60);
    let start = copy_of(&model, &env);
    (model, start)
}

/// The half of the step (1 or 2) in which an allocation first fails.
fn first_failure(model: &Model, start: &SimEnv) -> Option<u8> {
    let Ok(mut data) = Data::new(model) else { return Some(1) };
    data.qpos_mut().copy_from_slice(start.data().qpos());
    data.qvel_mut().copy_from_slice(start.data().qvel());
    for _ in 0..20 {
        if data.step1().is_err() || data.take_warnings().overflow().is_some() {
            return Some(1);
        }
        if data.step2().is_err() || data.take_warnings().overflow().is_some() {
            return Some(2);
        }
    }
    None
}

/// The place of the failed allocation within a step depends on the size of the buffers; the test covers every place.
#[test]
fn every_failing_allocation() {
    let (model, start) = resting_plate();
    let reference = |steps: u32| {
        let mut env = copy_of(&model, &start);
        env.step(steps);
        bits_of(&env)
    };
    let (mut in_step1, mut in_step2) = (0, 0);
    let sizes: Vec<Buffers> = match BUILD_VERSION {
        SupportedVersion::V2 => {
            (0..10).map(|i| Buffers { contacts: 1 << i, constraints: 1 << (9 - i), ..HUGE }).collect()
        }
        _ => (0..60).map(|i| Buffers { arena_bytes: (4096.0 * 1.12_f64.powi(i)) as usize, ..HUGE }).collect(),
    };
    let expected = reference(20);
    for buffers in sizes {
        let small = model.with_buffers(buffers);
        let failure = first_failure(&small, &start);
        in_step1 += u32::from(failure == Some(1));
        in_step2 += u32::from(failure == Some(2));
        let mut env = copy_of(&small, &start);
        env.step(20);
        assert_eq!(bits_of(&env), expected, "{buffers:?}, grown {} times", env.buffer_growths());
        assert_eq!(*env.warnings(), Default::default(), "{buffers:?}");
    }
    // On 2.2.2 the stack is sized to fit the rows; on 4.x both share the arena.
    assert!(in_step1 > 0 && (in_step2 > 0 || BUILD_VERSION == SupportedVersion::V2), "{in_step1} {in_step2}");
    let expected = reference(5);
    for minimum in [0, 1] {
        let buffers = Buffers { contacts: minimum, constraints: minimum, arena_bytes: minimum };
        let mut env = copy_of(&model.with_buffers(buffers), &start);
        env.step(5);
        assert_eq!(bits_of(&env), expected, "{buffers:?}");
        assert!(env.buffer_growths() > 0);
    }
}

#[test]
fn all_environments() {
    let mut sim = sim(cfg(9, 3));
    add_plate(&mut sim, [14, 0], [1.0, 1.0, 0.1], [0.0; 3]);
    sim.update(60);
    let bits = all_bits(&sim);
    assert!(bits.iter().all(|env| *env == bits[0]));
    // Each of three threads that takes an environment grows its own buffers, from 16 contacts to the 196 of the plate at
    // most: four times on 2.2.2, and as often for the rows. On 4.x one arena has both.
    let growths = sim.warnings().buffer_growths();
    assert!((1..=3 * 8).contains(&growths), "{growths}");
    assert_quiet(&sim);
}

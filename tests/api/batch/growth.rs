//! Buffers that were too small never show: the step is done again with larger ones, to the same bits.

use super::support::{all_bits, ball, bits_of, cfg, copy_of, free_robot, most_contacts, plate};
use kinetoscope::prelude::*;
use kinetoscope::sim::env::Env;
use kinetoscope::sim::mj::{Buffers, Data, Model};

/// Room for everything in these tests.
const HUGE: Buffers = Buffers { contacts: 1000, constraints: 3000, arena_bytes: 64 << 20 };

fn assert_quiet(sim: &SimulationManager) {
    let mujoco: Vec<_> = sim.warning_counts().into_keys().filter(|name| name.starts_with("mujoco")).collect();
    assert!(mujoco.is_empty(), "{mujoco:?}");
    assert!(sim.diverged().is_empty(), "{:?}", sim.diverged());
}

/// Runs `sim` from its start and the same environment with huge buffers, and compares after every 10 steps.
fn compare_with_huge_buffers(sim: &mut SimulationManager, steps: u32, contacts: usize) {
    let huge = sim.batch().model().with_buffers(HUGE);
    let mut reference = sim.batch().read(0, |env| copy_of(&huge, env));
    let mut most = 0;
    for step in 0..steps / 10 {
        let (mine, theirs) = (sim.batch().read(0, bits_of), bits_of(&reference));
        let different: Vec<usize> = (0..mine.len()).filter(|&i| mine[i] != theirs[i]).collect();
        assert!(different.is_empty(), "after {} steps: {different:?} of {}", 10 * step, mine.len());
        sim.update(10);
        reference.step(10);
        most = most.max(most_contacts(sim.batch()));
    }
    assert_eq!(sim.batch().read(0, bits_of), bits_of(&reference));
    assert_eq!(reference.growths(), 0, "the reference had room");
    assert!(most >= contacts, "{most} contacts");
    assert_quiet(sim);
}

#[test]
fn more_contacts_than_room_grow_the_buffers_and_change_no_bit() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(3, 2)).unwrap();
    let robot = free_robot(dir.path(), "plate", &plate(14, 0), 0.15);
    sim.add_robot(RobotCfg { init_pose: kinetoscope::scene::pose::from_xyz_rpy([0.0, 0.0, 0.1], [0.0; 3]), ..robot })
        .unwrap();
    compare_with_huge_buffers(&mut sim, 60, 100);
    assert!(sim.buffer_growths() > 0);
}

#[test]
fn growth_with_drives_at_work_changes_no_bit() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(2, 1)).unwrap();
    // A little tilted: contacts come one after the other, and the buffers grow several times in the middle of the
    // motion.
    let mut plate = free_robot(dir.path(), "plate", &plate(16, 5), 0.0);
    plate.init_pose = kinetoscope::scene::pose::from_xyz_rpy([0.0, 0.0, 0.1], [0.05, 0.04, 0.3]);
    let robot = sim.add_robot(plate).unwrap();
    sim.robot_mut(robot).set_qpos(&kinetoscope::ndarray::array![[-0.9, -0.8, -0.7, -1.1, -0.3]], None, None).unwrap();
    compare_with_huge_buffers(&mut sim, 150, 60);
    assert!(sim.buffer_growths() > 0);
    let moved = sim.robot(robot).get_qf();
    assert!(moved.iter().any(|effort| effort.abs() > 0.1), "{moved}");
}

#[test]
fn a_pile_of_robots_grows_the_buffers_and_changes_no_bit() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(2, 2)).unwrap();
    for i in 0..24 {
        let mut robot = free_robot(dir.path(), &format!("ball{i}"), &ball(), 0.0);
        let (layer, place) = (f64::from(i / 6), f64::from(i % 6));
        robot.init_pose = kinetoscope::scene::pose::from_xyz_rpy(
            [0.115 * (place % 3.0) + 0.01 * layer, 0.115 * (place / 3.0).floor(), 0.058 + 0.1 * layer],
            [0.0; 3],
        );
        sim.add_robot(robot).unwrap();
    }
    compare_with_huge_buffers(&mut sim, 60, 24);
    // On 4.x the arena of a scene of 24 robots has room for the pile.
    assert!(sim.buffer_growths() > 0 || kinetoscope::sim::mj::TARGET != V2);
}

const V2: kinetoscope::sim::mj::Target = kinetoscope::sim::mj::Target::V2;

/// The model, and an environment of it in the state in which its contacts are many.
fn resting_plate() -> (Model, Env) {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(1, 1)).unwrap();
    let robot = free_robot(dir.path(), "plate", &plate(9, 3), 0.1);
    sim.add_robot(RobotCfg { init_pose: kinetoscope::scene::pose::from_xyz_rpy([0.0, 0.0, 0.03], [0.0; 3]), ..robot })
        .unwrap();
    let model = sim.batch().model().with_buffers(HUGE);
    let mut env = sim.batch().read(0, |env| copy_of(&model, env));
    env.step(40);
    assert!(env.data().contact().len() > 60);
    (model, env)
}

/// Where in a step the buffers are found too small depends on their size: every place is to be gone through.
#[test]
fn wherever_in_the_step_room_runs_out_the_bits_are_the_same() {
    let (model, mut reference) = resting_plate();
    let start = copy_of(&model, &reference);
    reference = copy_of(&model, &start);
    reference.step(20);
    let (mut in_step1, mut in_step2, mut fitted) = (0, 0, 0);
    let sizes: Vec<Buffers> = match kinetoscope::sim::mj::TARGET {
        V2 => (0..10).map(|i| Buffers { contacts: 1 << i, constraints: 1 << (9 - i), ..HUGE }).collect(),
        _ => (0..60).map(|i| Buffers { arena_bytes: (4096.0 * 1.12_f64.powi(i)) as usize, ..HUGE }).collect(),
    };
    for buffers in sizes {
        let small = model.with_buffers(buffers);
        match first_failure(&small, &start) {
            Some(1) => in_step1 += 1,
            Some(_) => in_step2 += 1,
            None => fitted += 1,
        }
        let mut env = copy_of(&small, &start);
        env.step(20);
        assert_eq!(bits_of(&env), bits_of(&reference), "{buffers:?}, grown {} times", env.growths());
        assert_eq!(*env.warnings(), Default::default(), "{buffers:?}");
    }
    assert!(in_step1 > 0, "{in_step1} {in_step2} {fitted}");
    // On 2.2.2 the stack is made to fit the rows; on 4.x both share the arena.
    assert!(in_step2 > 0 || kinetoscope::sim::mj::TARGET == V2, "{in_step1} {in_step2} {fitted}");
}

/// The half of the step that first finds no room.
fn first_failure(model: &Model, start: &Env) -> Option<u8> {
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

#[test]
fn buffers_of_nothing_grow_as_well() {
    let (model, start) = resting_plate();
    let mut reference = copy_of(&model, &start);
    reference.step(5);
    for nothing in [0, 1] {
        let buffers = Buffers { contacts: nothing, constraints: nothing, arena_bytes: nothing };
        let mut env = copy_of(&model.with_buffers(buffers), &start);
        env.step(5);
        assert_eq!(bits_of(&env), bits_of(&reference), "{buffers:?}");
        assert!(env.growths() > 0);
    }
}

#[test]
fn all_environments_of_a_batch_grow_alike() {
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(9, 3)).unwrap();
    sim.add_robot(free_robot(dir.path(), "plate", &plate(10, 2), 0.4)).unwrap();
    sim.update(120);
    let bits = all_bits(sim.batch());
    assert!(bits.iter().all(|env| *env == bits[0]));
    assert_eq!(sim.buffer_growths() % 9, 0);
    assert_quiet(&sim);
}

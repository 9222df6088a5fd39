//! A rollout gives the same results as stepping by hand, and changes nothing.

use super::worlds::{ALL, Ids, all_bits, cfg, world};
use kinetoscope::ndarray::{Array2, Array3, Axis, concatenate, s};
use kinetoscope::prelude::*;
use kinetoscope::sim::{Error, rollout_until, update_until};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const STEPS: usize = 60;

fn controls(rows: usize) -> Array3<f64> {
    Array3::from_shape_fn((rows, STEPS, 7), |(n, t, k)| (0.7 * n as f64 + 0.05 * t as f64 + k as f64).sin() * 2.0)
}

/// Sets the controls of step `t` and steps.
fn step(sim: &mut SimulationManager, ids: Ids, controls: &Array3<f64>, t: usize) {
    let now = controls.index_axis(Axis(1), t);
    sim.robot_mut(ids.arm).set_qpos_target(now.slice(s![.., ..6]), None, None).unwrap();
    sim.mjcf_part_mut(ids.machine).set_ctrl(now.slice(s![.., 6..]), None, None).unwrap();
    sim.update(1);
}

/// Positions and velocities of all environments.
fn states(sim: &SimulationManager) -> Array2<f64> {
    let model = sim.batch().model();
    let mut states = Array2::zeros((sim.num_envs(), model.nq() + model.nv()));
    sim.batch().for_each(|i, env| {
        let now: Vec<f64> = env.data().qpos().iter().chain(env.data().qvel()).copied().collect();
        states.row_mut(i).assign(&kinetoscope::ndarray::ArrayView1::from(&now));
    });
    states
}

#[test]
fn steps_by_hand() {
    for (settings, threads) in [(cfg(3, 2), 2), (SimulationManagerCfg { substeps: 3, ..cfg(3, 1) }, 1)] {
        let (mut sim, ids) = world(settings);
        assert_eq!(sim.threads(), threads);
        sim.update(200);
        let (before, warnings) = (all_bits(&sim), sim.warnings().counts());
        let forces = sim.mjcf_part(ids.machine).actuator_force();
        let controls = controls(3);
        let rollout = sim.rollout(&controls, None, ALL).unwrap();
        assert_eq!(all_bits(&sim), before, "the present stays");
        assert_eq!((sim.warnings().counts(), sim.mjcf_part(ids.machine).actuator_force()), (warnings, forces));
        assert!(rollout.diverged.is_empty());

        let current = sim.snapshot(ALL).unwrap();
        for t in 0..STEPS {
            step(&mut sim, ids, &controls, t);
            assert!(states(&sim) == rollout.states.index_axis(Axis(1), t), "step {t}");
        }
        let end = all_bits(&sim);
        // The end is a state that can be restored.
        sim.restore(&rollout.final_states, ALL).unwrap();
        assert_eq!(all_bits(&sim), end);

        // From a snapshot, independent of the current state; and many rows in one environment.
        let again = sim.rollout(&controls, Some(&current), ALL).unwrap();
        assert!(again.states == rollout.states);
        sim.restore(&current, ALL).unwrap();
        let many = sim.rollout(&controls, None, Some(&[EnvId(1); 3])).unwrap();
        assert!(many.states.index_axis(Axis(0), 1) == rollout.states.index_axis(Axis(0), 1));
        assert!(many.states.index_axis(Axis(0), 0) != rollout.states.index_axis(Axis(0), 0), "another start");
        assert_eq!(many.final_states.env_ids(), [EnvId(1); 3]);
        // One row of controls for all.
        let one = sim.rollout(controls.slice(s![..1, .., ..]), None, ALL).unwrap();
        assert!(one.states.index_axis(Axis(0), 0) == rollout.states.index_axis(Axis(0), 0));
        let copies = concatenate(Axis(0), &[controls.slice(s![..1, .., ..]); 3]).unwrap();
        assert!(one.states == sim.rollout(&copies, None, ALL).unwrap().states);
    }
}

#[test]
fn names() {
    let (sim, _) = world(cfg(1, 1));
    let names = sim.entities().control_names();
    assert_eq!((names.len(), names[0].as_str(), names[6].as_str()), (7, "arm/JOINT1", "machine/motor"));
    let states = sim.entities().state_names();
    let model = sim.batch().model();
    assert_eq!(states.len(), model.nq() + model.nv());
    let rollout = sim.rollout(&Array3::zeros((1, 1, 7)), None, ALL).unwrap();
    let column = |name: &str| states.iter().position(|n| n == name).unwrap();
    // One step of free fall from rest, except for the velocities set by the world; the height is in the named column.
    let height = rollout.states[(0, 0, column("qpos cube/free[2]"))];
    let velocity = rollout.states[(0, 0, column("qvel cube/free[2]"))];
    let first = 2.0 * 2.0_f64.sin() - 9.81 * 0.01;
    assert!((velocity - first).abs() < 1e-12 && (height - (0.4 + 0.01 * first)).abs() < 1e-12, "{height} {velocity}");
    assert_eq!(states[0], "qpos arm/JOINT1");
    assert!(["qvel machine/ball[2]", "qpos machine/ball[3]"].iter().all(|name| states.iter().any(|n| n == name)));
}

#[test]
fn clamped_targets() {
    let (mut sim, ids) = world(cfg(1, 1));
    let rollout = sim.rollout(&Array3::from_elem((1, 5, 7), 100.0), None, ALL).unwrap();
    sim.restore(&rollout.final_states, ALL).unwrap();
    let limits = sim.robot(ids.arm).qpos_limits();
    assert_eq!(sim.robot(ids.arm).qpos_target().row(0), limits.slice(s![0, .., 1]));
}

/// Regression: controls were clamped to the limits at the creation of the robot instead of those of the start state.
/// `set_qpos_limits` changes limits in an environment, and they are part of its state.
#[test]
fn limits_of_start() {
    let (mut sim, ids) = world(cfg(2, 1));
    let tight = Array3::from_shape_fn((1, 6, 2), |(_, joint, end)| 0.01 * (joint + 1) as f64 * [-1.0, 1.0][end]);
    let wide = sim.snapshot(ALL).unwrap();
    sim.robot_mut(ids.arm).set_qpos_limits(&tight, None, Some(&[EnvId(1)])).unwrap();
    let narrow = sim.snapshot(ALL).unwrap();
    let controls = controls(2);
    // The current state has other limits than the start state, in both directions.
    for (present, start) in [(&narrow, None), (&narrow, Some(&wide)), (&wide, Some(&narrow))] {
        sim.restore(present, ALL).unwrap();
        let rollout = sim.rollout(&controls, start, ALL).unwrap();
        sim.restore(start.unwrap_or(present), ALL).unwrap();
        for t in 0..STEPS {
            step(&mut sim, ids, &controls, t);
            assert!(states(&sim) == rollout.states.index_axis(Axis(1), t), "step {t}");
        }
        let end = all_bits(&sim);
        sim.restore(&rollout.final_states, ALL).unwrap();
        assert_eq!(all_bits(&sim), end);
        let (targets, limits) = (sim.robot(ids.arm).qpos_target(), sim.robot(ids.arm).qpos_limits());
        for ((env, joint), target) in targets.indexed_iter() {
            let requested = controls[(env, STEPS - 1, joint)];
            assert_eq!(*target, requested.clamp(limits[(env, joint, 0)], limits[(env, joint, 1)]));
        }
        // The limits matter here: the last controls exceed the tight limits of environment 1.
        let is_tight = start.is_none_or(|start| std::ptr::eq(start, &narrow));
        let inside =
            targets.row(1).iter().zip(tight.outer_iter().next().unwrap().rows()).all(|(x, ends)| x.abs() <= ends[1]);
        assert_eq!(inside, is_tight);
    }
    // A state keeps its limits in every environment.
    sim.restore(&wide, ALL).unwrap();
    let there = sim.rollout(&controls, Some(&narrow), ALL).unwrap();
    let elsewhere = sim.rollout(&controls, Some(&narrow), Some(&[EnvId(0); 2])).unwrap();
    assert!(elsewhere.states == there.states);
}

#[test]
fn diverged_row() {
    // A slide without damping and a force of 1e12 newtons on 1 kg: beyond MuJoCo's largest acceleration.
    let text = r#"<mujoco><worldbody><body><joint name="x" type="slide" axis="1 0 0"/><geom size="0.1" mass="1"/></body>
        </worldbody><actuator><motor name="push" joint="x" gear="1000000"/></actuator></mujoco>"#;
    let mut sim = SimulationManager::new(SimulationManagerCfg { ground: None, ..cfg(2, 2) }).unwrap();
    sim.add_mjcf(MjcfPartCfg::text("slider", text)).unwrap();
    let mut controls = Array3::from_elem((2, 6, 1), 1e-6);
    controls[(0, 3, 0)] = 1e6;
    let rollout = sim.rollout(&controls, None, ALL).unwrap();
    assert_eq!(rollout.diverged.len(), 1);
    assert!(rollout.diverged[0].0 == 0 && rollout.diverged[0].1.contains("step 3"), "{:?}", rollout.diverged);
    for t in 3..6 {
        assert_eq!(rollout.states.slice(s![0, t, ..]), rollout.states.slice(s![0, 2, ..]));
    }
    // Semi-implicit Euler under 1 N on 1 kg: v = k h, x = h² k (k + 1) / 2 after k steps.
    assert!((rollout.states[(1, 5, 1)] - 0.06).abs() < 1e-12);
    assert!((rollout.states[(1, 5, 0)] - 21.0 * 1e-4).abs() < 1e-12);
    assert!(sim.diverged().is_empty());
    sim.restore(&rollout.final_states, ALL).unwrap();
    assert_eq!(sim.diverged().len(), 1);
}

/// A flag that is set ends rollouts and steps; one that is not changes no bit.
#[test]
fn interrupted() {
    let (mut sim, _) = world(cfg(3, 2));
    let (set, unset) = (AtomicBool::new(true), AtomicBool::new(false));
    let (controls, before) = (controls(3), all_bits(&sim));
    let stopped = rollout_until(&sim, &set, &controls, None, ALL);
    assert!(matches!(stopped, Err(Error::Interrupted)), "{stopped:?}");
    assert_eq!((update_until(&mut sim, &set, 50), all_bits(&sim)), (0, before));
    // Set by another thread in the middle of steps that would take days.
    let flag = &AtomicBool::new(false);
    let (steps, late) = std::thread::scope(|scope| {
        let setter = scope.spawn(move || {
            std::thread::sleep(Duration::from_millis(200));
            flag.store(true, Ordering::Relaxed);
            Instant::now()
        });
        let steps = update_until(&mut sim, flag, u32::MAX);
        let late = Instant::now().saturating_duration_since(setter.join().unwrap());
        (steps, late)
    });
    assert!(steps > 0 && steps < u32::MAX && late < Duration::from_secs(2), "{steps} steps, {late:?}");
    let (mut other, _) = world(cfg(3, 2));
    other.update(steps);
    assert_eq!(all_bits(&sim), all_bits(&other));
    assert!(
        rollout_until(&sim, &unset, &controls, None, ALL).unwrap().states
            == other.rollout(&controls, None, ALL).unwrap().states
    );
    assert_eq!(update_until(&mut sim, &unset, 37), 37);
    other.update(37);
    assert_eq!(all_bits(&sim), all_bits(&other));
}

#[test]
fn mistakes() {
    let (sim, _) = world(cfg(2, 1));
    let shape = |controls: &Array3<f64>| match sim.rollout(controls, None, ALL) {
        Err(Error::Shape { expected, .. }) => expected,
        other => panic!("{other:?}"),
    };
    assert_eq!(shape(&Array3::zeros((2, 4, 6))), [2, 4, 7]);
    assert_eq!(shape(&Array3::zeros((3, 4, 7))), [2, 4, 7]);
    let mut controls = Array3::zeros((2, 4, 7));
    controls[(1, 2, 6)] = f64::NAN;
    let error = sim.rollout(&controls, None, ALL).unwrap_err();
    assert!(matches!(error, Error::NotFinite { row: 1, column: 6, .. }));
    assert!(error.to_string().contains("machine/motor") && error.to_string().contains("step 2"), "{error}");
    let unknown = sim.rollout(&Array3::zeros((1, 1, 7)), None, Some(&[EnvId(2)]));
    assert!(matches!(unknown, Err(Error::UnknownIndex { index: 2, .. })));
    let none = sim.rollout(&Array3::zeros((1, 0, 7)), None, ALL).unwrap();
    assert_eq!(none.states.shape()[1], 0);
}

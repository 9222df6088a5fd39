//! Schedules and histories of sensors.

use super::worlds::{cfg, cube, sr5};
use kinetoscope::ndarray::{Array2, ArrayD, ArrayViewD, Axis, array};
use kinetoscope::prelude::*;
use kinetoscope::sensors::{FrameTransformerCfg, JointStateCfg, TargetFrameCfg};

const LENGTH: usize = 3;

fn with_history(sampling: SamplingCfg) -> SamplingCfg {
    SamplingCfg { history_length: LENGTH, ..sampling }
}

/// Asserts that a history of shape (N, T, ...) holds the newest readings; `read` is oldest first.
fn assert_newest_first(name: &str, read: &[ArrayD<f64>], history: &ArrayViewD<'_, f64>) {
    assert_eq!(history.shape()[1], LENGTH, "{name}");
    for (age, expected) in read.iter().rev().take(LENGTH).enumerate() {
        assert_eq!(history.index_axis(Axis(1), age), expected.view(), "{name}, {age} samples ago");
    }
    // Control: equal readings would not verify their order.
    assert!(read[read.len() - 1] != read[read.len() - 2], "{name} does not change");
}

/// A sensor with a period of 5 steps holds the joint positions of the last multiple of 5. A reset restarts the clock of
/// its environment only.
#[test]
fn joint_state() {
    let mut sim = kinetoscope_testkit::worlds::sim(kinetoscope_testkit::worlds::cfg(2, 2));
    let robot = sim.add_robot(sr5("robot")).unwrap();
    sim.robot_mut(robot).set_qpos_target(&array![[0.1, 0.2, -0.3, 0.4, -0.5, 0.6]], None, None).unwrap();
    let slow = JointStateCfg { sampling: with_history(SamplingCfg::every(0.05)), ..Default::default() };
    let id = sim.add_sensor("joints", slow).unwrap();
    let always = sim.add_sensor("always", JointStateCfg::default()).unwrap();
    let mut sampled = Vec::new();
    for step in 1..=17_u32 {
        sim.update(1);
        if step % 5 == 0 {
            sampled.push(sim.robot(robot).qpos().into_dyn());
        }
        let sensor = sim.sensor(id).unwrap();
        assert_eq!(sensor.sample_counts().to_vec(), vec![u64::from(step / 5); 2], "step {step}");
        if let Some(last) = sampled.last() {
            assert_eq!(sensor.positions().into_dyn(), last.view(), "step {step}");
        }
    }
    let sensor = sim.sensor(id).unwrap();
    assert_newest_first("positions", &sampled, &sensor.position_history().into_dyn());
    assert!((sensor.stamps()[0] - 0.15).abs() < 1e-12);
    sim.reset(Some(&[EnvId(1)])).unwrap();
    assert_eq!(sim.sensor(id).unwrap().positions().row(1), sim.robot(robot).qpos().row(1), "nothing stale");
    for (steps, counts) in [(3, [4, 0]), (2, [4, 1])] {
        sim.update(steps);
        assert_eq!(sim.sensor(id).unwrap().sample_counts().to_vec(), counts);
    }
    // Efforts are those of the drives: they carry the weight about JOINT2.
    sim.update(400);
    assert_eq!(sim.sensor(always).unwrap().efforts(), sim.robot(robot).qf().view());
    assert!(sim.robot(robot).qf()[(0, 1)].abs() > 5.0);
}

/// Forces of a cube that falls onto an edge and tumbles, so that forces have all directions.
#[test]
fn contact_history() {
    let mut sim = kinetoscope_testkit::worlds::sim(kinetoscope_testkit::worlds::cfg(2, 2));
    let cube = kinetoscope_testkit::worlds::object("cube", ObjectShape::cube(0.2), [0.0; 3]);
    let cube = sim.add_rigid_object(cube).unwrap();
    let pose = [0.2_f64, 0.5].map(|half| [0.0, 0.0, 0.16, half.cos(), half.sin(), 0.0, 0.0]);
    sim.rigid_object_mut(cube).write_pose(&Array2::from(pose.to_vec()), None).unwrap();
    let sampling = with_history(SamplingCfg::default());
    let id = sim.add_sensor("contact", ContactSensorCfg { sampling, ..ContactSensorCfg::for_bodies("cube") }).unwrap();
    let (mut total, mut friction) = (Vec::new(), Vec::new());
    for _ in 0..20 {
        sim.update(1);
        let sensor = sim.sensor(id).unwrap();
        total.push(sensor.total_forces_w().to_owned().into_dyn());
        friction.push(sensor.friction_forces_w().to_owned().into_dyn());
        let off = &sensor.total_forces_w() - &sensor.net_forces_w() - sensor.friction_forces_w();
        // Sums of a few forces of less than 1e3 N.
        assert!(off.iter().all(|d| d.abs() < 1e-11), "{off}");
    }
    let sensor = sim.sensor(id).unwrap();
    assert_newest_first("total", &total, &sensor.total_forces_w_history().into_dyn());
    assert_newest_first("friction", &friction, &sensor.friction_forces_w_history().into_dyn());
}

const STEPS: u64 = 1_000_000;

/// Steps of 5 ms between two measurements, and their latency in steps.
const RATES: [(u64, u32); 4] = [(1, 0), (3, 0), (20, 0), (20, 7)];

/// A cube drifts at 1 mm/s in empty space, so its position is the time. Every measurement is at its tick, up to the
/// last, for any number of steps per call. In single precision, intervals of 20 steps would become 21 after 3200 of
/// them, and 762 of the 10000 in a thousand seconds would be wrong.
#[test]
fn million_steps() {
    let empty = SimulationManagerCfg { ground: None, gravity: [0.0; 3].into(), threads: Some(1), ..cfg(1) };
    let mut sim = kinetoscope_testkit::worlds::sim(empty);
    let dt = sim.cfg().physics_dt;
    let object = sim.add_rigid_object(cube("cube", 0.1, 1.0, [0.0; 3])).unwrap();
    sim.rigid_object_mut(object).write_velocity(&array![[1e-3, 0.0, 0.0, 0.0, 0.0, 0.0]], None).unwrap();
    let ids = RATES.map(|(period, latency_steps)| {
        let sampling = SamplingCfg { latency_steps, ..with_history(SamplingCfg::every(period as f64 * dt)) };
        let targets = vec![TargetFrameCfg::for_bodies("cube")];
        let frames = FrameTransformerCfg { sampling, ..FrameTransformerCfg::new("cube", targets) };
        sim.add_sensor(format!("every {period}, {latency_steps} late"), frames).unwrap()
    });
    let (mut step, mut block) = (0, 1);
    while step < STEPS {
        // Blocks of 1 to 4999 steps, which no period divides for long.
        block = (block * 7 + 3) % 5000;
        let block_steps = block.max(1).min(STEPS - step);
        sim.update(block_steps as u32);
        step += block_steps;
        for ((period, latency), id) in RATES.into_iter().zip(ids) {
            let sensor = sim.sensor(id).unwrap();
            let count = step.saturating_sub(latency.into()) / period;
            assert_eq!(sensor.sample_counts()[0], count, "period {period}, step {step}");
            for age in 0..sensor.history_filled(0) {
                let tick = (count - age as u64) * period;
                // MuJoCo's clock is a sum of `tick` steps, each rounded by 2^-53 of the time at most.
                let (stamp, time) = (sensor.stamp_history()[(0, age)], tick as f64 * dt);
                let rounding = tick as f64 * time * f64::EPSILON / 2.0;
                assert!((stamp - time).abs() <= rounding, "period {period}, step {step}: {stamp} s, not {time} s");
                // The position is also a sum of small numbers, up to 5 m: 6e-10.
                let position = sensor.sampler().history("source_pos_w")[(0, age, 0)];
                assert!((position - 1e-3 * tick as f64 * dt).abs() < 1e-9, "{position} m at tick {tick}");
            }
        }
    }
}

//! When sensors measure, over a million steps of a running simulation.

use crate::sensors::worlds::{cfg, cube};
use kinetoscope::prelude::*;

const STEPS: u64 = 1_000_000;

/// How many steps of 5 ms lie between two measurements, and how late they come.
const RATES: [(u64, u32); 4] = [(1, 0), (3, 0), (20, 0), (20, 7)];

/// A cube that drifts with 1 mm/s in nothing at all: its place is the time. Every measurement falls on its tick, to the last
/// one, whatever the number of steps that are asked for at once; in single precision, intervals of 20 steps become 21 after
/// 3200 of them, and 762 of a thousand seconds' 10000 are wrong.
#[test]
fn a_million_steps_later_ticks_are_where_they_were() {
    let empty = SimulationManagerCfg { ground: None, gravity: [0.0; 3].into(), threads: Some(1), ..cfg(1) };
    let mut sim = SimulationManager::new(empty).unwrap();
    let dt = sim.cfg().physics_dt;
    let object = sim.add_rigid_object(cube("cube", 1.0, 0.1, [0.0; 3])).unwrap();
    let drift = kinetoscope::ndarray::array![[1e-3, 0.0, 0.0, 0.0, 0.0, 0.0]];
    sim.rigid_object_mut(object).write_velocity(&drift, None).unwrap();
    let ids: Vec<_> = RATES
        .iter()
        .map(|&(period, latency_steps)| {
            let sampling = SamplingCfg { latency_steps, history_length: 3, ..SamplingCfg::every(period as f64 * dt) };
            let targets = vec![TargetFrameCfg::of("cube")];
            let frames = FrameTransformerCfg { sampling, ..FrameTransformerCfg::from("cube", targets) };
            sim.add_sensor(format!("every {period}, {latency_steps} late"), frames).unwrap()
        })
        .collect();
    let (mut step, mut block) = (0, 1);
    while step < STEPS {
        // Blocks of 1 to 4999 steps, that no period divides for long.
        block = (block * 7 + 3) % 5000;
        let block_steps = block.max(1).min(STEPS - step);
        sim.update(block_steps as u32);
        step += block_steps;
        for (&(period, latency), id) in RATES.iter().zip(&ids) {
            let sensor = sim.sensor(*id).unwrap();
            let count = step.saturating_sub(latency.into()) / period;
            assert_eq!(sensor.sample_counts()[0], count, "period {period}, step {step}");
            for age in 0..sensor.history_filled(0) {
                let tick = (count - age as u64) * period;
                // MuJoCo's clock is a sum of `tick` steps, each rounded by 2^-53 of the time at most.
                let (stamp, time) = (sensor.stamp_history()[(0, age)], tick as f64 * dt);
                let rounding = tick as f64 * time * f64::EPSILON / 2.0;
                assert!((stamp - time).abs() <= rounding, "period {period}, step {step}: {stamp} s, not {time} s");
                // The place, too, is a sum of so many small numbers, of five metres: 6e-10.
                let place = sensor.sampler().history("source_pos_w")[(0, age, 0)];
                assert!((place - 1e-3 * tick as f64 * dt).abs() < 1e-9, "{place} m at tick {tick}");
            }
        }
    }
    println!("after {STEPS} steps MuJoCo's clock shows {} s", sim.time()[0]);
}

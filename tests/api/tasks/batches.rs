//! The number of threads, environments and processes does not change a bit.

use super::bundled::{all_terms_task, cfg, policy};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::sim::Shard;
use kinetoscope::tasks::EndedEpisode;
use kinetoscope_testkit::bits::bits;

/// All bits of 150 steps, by environment, and the reasons of all episode ends.
fn run(settings: SimulationManagerCfg) -> (Vec<Vec<u64>>, Vec<Vec<String>>) {
    let mut env = all_terms_task(settings);
    let n = env.num_envs();
    let mut seen = env.reset(None, Some(77)).unwrap();
    let (mut all, mut ends) = (vec![Vec::new(); n], vec![Vec::new(); n]);
    let append_bits = |all: &mut Vec<Vec<u64>>, of: &Array2<f64>| {
        all.iter_mut().zip(of.rows()).for_each(|(all, row)| all.extend(bits(row)));
    };
    append_bits(&mut all, &seen);
    for _ in 0..150 {
        let step = env.step(&policy(seen.view())).unwrap();
        for numbers in [&step.observations, &step.final_observations, &step.info.reward_terms] {
            append_bits(&mut all, numbers);
        }
        for (e, all) in all.iter_mut().enumerate() {
            all.extend([step.rewards[e].to_bits(), step.terminated[e].into(), step.truncated[e].into()]);
        }
        for EndedEpisode { env, reason, steps, reward_sums } in step.info.ended {
            ends[env.0].push(format!("{reason} {steps} {reward_sums:?}"));
        }
        seen = step.observations;
    }
    (all, ends)
}

#[test]
fn threads() {
    let one = run(cfg(9, 1));
    for threads in [2, 3, 5] {
        assert!(run(cfg(9, threads)) == one, "{threads} threads");
    }
    // The comparison is meaningful: episodes ended for both reasons, differently in each environment.
    let reasons: Vec<&str> = one.1.iter().flatten().filter_map(|end| end.split(' ').next()).collect();
    assert!(reasons.contains(&"fell") && reasons.contains(&"time"), "{reasons:?}");
    assert!((1..9).all(|e| one.0[e] != one.0[0]));
}

#[test]
fn shards() {
    let eight = run(cfg(8, 2));
    for world in [2, 8] {
        let share = |rank| run(SimulationManagerCfg { shard: Shard { rank, world }, ..cfg(8 / world, 1) });
        let (bits, ends): (Vec<_>, Vec<_>) = (0..world).map(share).unzip();
        assert!(bits.concat() == eight.0 && ends.concat() == eight.1, "{world} processes");
    }
    // Control: without its rank a process repeats the first one.
    assert!(run(cfg(4, 1)).0[..] != eight.0[4..]);
    assert!(run(cfg(4, 1)).0[..] == eight.0[..4]);
}

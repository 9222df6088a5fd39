//! Two processes with four environments equal one process with eight.

use super::worlds::{Ids, all_bits, cfg, world};
use kinetoscope::prelude::*;
use kinetoscope::sensors::{JointStateCfg, NoiseCfg};
use kinetoscope::sim::{Error, Shard};
use kinetoscope_testkit::bits::bits;

/// Bits of states and of a noisy sensor's measurements, after randomizations, steps and resets. `first` is the global
/// index of the manager's first environment.
fn run(num_envs: usize, shard: Shard, first: usize) -> Vec<(Vec<u64>, Vec<u64>)> {
    let (mut sim, ids) = world_alike(SimulationManagerCfg { seed: 11, shard, ..cfg(num_envs, 2) });
    let noise = [("positions".to_string(), NoiseCfg { bias_std: 0.1, ..NoiseCfg::white(0.01) })].into();
    let sampling = SamplingCfg { noise, ..SamplingCfg::every(0.03) };
    let sensor = sim.add_sensor("joints", JointStateCfg { sampling, ..Default::default() }).unwrap();
    let random = Randomization::new()
        .with(Property::Mass, "arm/.*|cube", RandomizationOp::Scale([0.7, 1.3]))
        .with(Property::Friction, "cube|ground", RandomizationOp::Set([0.3, 1.0]))
        .with(Property::Gravity, "gravity", RandomizationOp::Add([-0.3, 0.3]));
    sim.properties_mut().randomize(&random, None).unwrap();
    sim.update(50);
    // The environments with the global indices 1 and 6 are reset and randomized again.
    let again: Vec<EnvId> = [1, 6].iter().filter_map(|&g: &usize| g.checked_sub(first)).map(EnvId).collect();
    let again: Vec<EnvId> = again.into_iter().filter(|env| env.0 < num_envs).collect();
    sim.reset(Some(&again)).unwrap();
    sim.properties_mut().randomize(&random, Some(&again)).unwrap();
    sim.update(70);
    let read = sim.sensor(sensor).unwrap();
    let measured = |env| bits(read.positions().row(env));
    assert!(sim.rigid_object(ids.cube).nominal_mass() > 0.0);
    all_bits(&sim).into_iter().enumerate().map(|(env, state)| (state, measured(env))).collect()
}

/// The world of these tests with the same commands in every environment.
fn world_alike(settings: SimulationManagerCfg) -> (SimulationManager, Ids) {
    let (mut sim, ids) = world(settings);
    let first = sim.snapshot(Some(&[EnvId(0)])).unwrap();
    sim.restore(&first, Some(&(0..sim.num_envs()).map(EnvId).collect::<Vec<_>>())).unwrap();
    let hand = kinetoscope::ndarray::array![[0.0, 2.0, 0.5, 1.0, 0.0, 0.0, 0.0]];
    sim.mjcf_part_mut(ids.machine).write_mocap_pose("hand", &hand, None).unwrap();
    (sim, ids)
}

#[test]
fn twice_four() {
    for (rank, first) in [(0, 0), (1, 4)] {
        let settings = SimulationManagerCfg { num_envs: 4, shard: Shard { rank, world: 2 }, ..Default::default() };
        assert_eq!(settings.first_env(), first);
    }
    let eight = run(8, Shard::default(), 0);
    let parts = [run(4, Shard { rank: 0, world: 2 }, 0), run(4, Shard { rank: 1, world: 2 }, 4)];
    for (env, (whole, part)) in eight.iter().zip(parts.iter().flatten()).enumerate() {
        assert!(whole.0 == part.0, "state of environment {env}");
        assert!(whole.1 == part.1, "what the sensor of environment {env} says");
    }
    for env in 1..8 {
        assert!(eight[env].0 != eight[0].0 && eight[env].1 != eight[0].1, "environment {env} is one of its own");
    }
    // Control: without a shard the second process repeats the first.
    assert!(run(4, Shard::default(), 4)[0].1 != eight[4].1);
}

#[test]
fn refused() {
    const RANK: &str = "the rank must be 0 to";
    for (rank, world, expected) in [(2, 2, RANK), (0, 0, RANK), (usize::MAX - 1, usize::MAX, "fewer than 2^64")] {
        let shard = Shard { rank, world };
        let refused = SimulationManager::new(SimulationManagerCfg { shard, ..cfg(4, 1) }).unwrap_err();
        assert!(matches!(refused, Error::Config { field: "shard", .. }), "{refused:?}");
        assert!(refused.to_string().contains(expected), "{refused}");
    }
    // A configuration without environments is refused later; its list of origins is empty.
    assert_eq!(SimulationManagerCfg { num_envs: 0, ..cfg(4, 1) }.env_origins().dim(), (0, 3));
}

#[test]
fn variables_of_launchers() {
    let ask = |variables: &[(&str, &str)]| {
        let mut child = kinetoscope_testkit::process::command(module_path!(), "child");
        let all =
            ["RANK", "WORLD_SIZE", "OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", "SLURM_PROCID", "SLURM_NTASKS"];
        for name in all.into_iter().chain(["SLURM_STEP_ID"]) {
            child.env_remove(name);
        }
        let output = child.envs(variables.iter().copied()).output().unwrap();
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    assert!(ask(&[]).contains("Ok(Shard { rank: 0, world: 1 })"));
    let mpi = ask(&[("OMPI_COMM_WORLD_RANK", "2"), ("OMPI_COMM_WORLD_SIZE", "3")]);
    assert!(mpi.contains("Ok(Shard { rank: 2, world: 3 })"), "{mpi}");
    assert!(ask(&[("RANK", "2")]).contains("Err(Incomplete"));
}

/// The child process of the test above.
#[test]
#[ignore = "runs in a process of its own"]
fn child() {
    if kinetoscope_testkit::process::is_child() {
        println!("{:?}", Shard::from_env());
    }
}

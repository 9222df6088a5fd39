//! A task equals, bit for bit, a hand-written loop over the plain API.

use super::bundled::{cfg, world};
use kinetoscope::ndarray::{Array1, Array2, Axis, array, concatenate};
use kinetoscope::prelude::*;
use kinetoscope::scene::KeyedRng;
use kinetoscope::tasks::{
    ActionTerm, EndReason, EnvBuilder, EnvCfg, EventTerm, ObservationTerm, RewardTerm, Space, TerminationTerm,
};
use kinetoscope_testkit::bits::bits;

const LIMIT: u64 = 60;
const DECIMATION: u32 = 2;
const FALLEN: f64 = 0.15;
const BOUND: f64 = 2.0;

/// The random start of an episode; both loops compute it independently.
fn start(seed: u64, env: usize, episode: u64) -> Array2<f64> {
    let mut random = KeyedRng::keyed(seed, env as u64, &format!("my own start {episode}"));
    array![[0.4 * (random.uniform() - 0.5), 0.2 * (random.uniform() - 0.5)]]
}

/// Holds the pole in half of the environments and lets it fall in the others; some actions exceed the bounds.
fn command(observations: &Array2<f64>) -> Array2<f64> {
    Array2::from_shape_fn((observations.nrows(), 1), |(env, _)| {
        let o = observations.row(env);
        let gain = if env % 2 == 0 { 1.0 } else { 0.1 };
        gain * (40.0 * o[1] + 6.0 * o[3] + 2.0 * o[0] + 3.0 * o[2])
    })
}

fn observe(sim: &SimulationManager, robot: RobotId) -> Array2<f64> {
    let robot = sim.robot(robot);
    concatenate(Axis(1), &[robot.qpos().view(), robot.qvel().view()]).unwrap()
}

type Row = (Vec<u64>, Vec<u64>, u64, bool, bool);

fn row(seen: &Array2<f64>, last: &Array2<f64>, env: usize, reward: f64, terminated: bool, truncated: bool) -> Row {
    (bits(seen.row(env)), bits(last.row(env)), reward.to_bits(), terminated, truncated)
}

fn by_hand(num_envs: usize, steps: usize, seed: u64) -> Vec<Vec<Row>> {
    let (mut sim, robot) = world(cfg(num_envs, 1), true);
    let slide = sim.robot(robot).joint_id("slide").unwrap();
    let (mut episodes, mut lengths) = (vec![0; num_envs], vec![0_u64; num_envs]);
    for env in 0..num_envs {
        sim.robot_mut(robot).write_qpos(&start(seed, env, 0), None, Some(&[EnvId(env)])).unwrap();
    }
    let mut seen = observe(&sim, robot);
    let mut all = Vec::new();
    for _ in 0..steps {
        let force = command(&seen).mapv(|force| force.clamp(-BOUND, BOUND));
        sim.robot_mut(robot).set_qf_target(&force, Some(&[slide]), None).unwrap();
        sim.update(DECIMATION);
        let last = observe(&sim, robot);
        let mut ends = Vec::new();
        for env in 0..num_envs {
            lengths[env] += 1;
            let (x, angle) = (last[(env, 0)], last[(env, 1)]);
            let terminated = angle.abs() > FALLEN;
            let reward = 0.0 + 1.0 * 1.0 + -0.25 * (x * x) + -0.01 * (force[(env, 0)] * force[(env, 0)]);
            ends.push((reward, terminated, lengths[env] >= LIMIT));
            if terminated || lengths[env] >= LIMIT {
                (lengths[env], episodes[env]) = (0, episodes[env] + 1);
                sim.reset(Some(&[EnvId(env)])).unwrap();
                let start = start(seed, env, episodes[env]);
                sim.robot_mut(robot).write_qpos(&start, None, Some(&[EnvId(env)])).unwrap();
            }
        }
        seen = observe(&sim, robot);
        let of = |(env, &(reward, terminated, truncated)): (usize, &(f64, bool, bool))| {
            row(&seen, &last, env, reward, terminated, truncated)
        };
        all.push(ends.iter().enumerate().map(of).collect());
    }
    all
}

#[test]
fn loop_by_hand() {
    let (num_envs, steps, seed) = (6, 200, 41);
    let (sim, robot) = world(cfg(num_envs, 2), true);
    let slide = sim.robot(robot).joint_id("slide").unwrap();
    let space = Space::uniform(["force"], [-BOUND, BOUND]).unwrap();
    let mut env =
        EnvBuilder::new(sim, EnvCfg { decimation: DECIMATION, episode_steps: Some(LIMIT), ..EnvCfg::default() })
            .action(ActionTerm::new("push", space, move |sim, forces| {
                Ok(sim.robot_mut(robot).set_qf_target(forces, Some(&[slide]), None)?)
            }))
            .observation(ObservationTerm::new("state", ["x", "angle", "v", "spin"], move |now| {
                Ok(observe(now.sim(), robot))
            }))
            .reward(RewardTerm::new("alive", 1.0, |now| Ok(Array1::ones(now.num_envs()))))
            .reward(RewardTerm::new("middle", -0.25, move |now| {
                Ok(now.sim().robot(robot).qpos().column(0).mapv(|x| x * x))
            }))
            .reward(RewardTerm::new("effort", -0.01, |now| Ok(now.actions().column(0).mapv(|force| force * force))))
            .termination(TerminationTerm::new("fell", move |now| {
                Ok(now.sim().robot(robot).qpos().column(1).mapv(|angle| angle.abs() > FALLEN))
            }))
            .event(EventTerm::on_reset("start", move |sim, rng| {
                for die in rng {
                    let start = start(die.seed(), die.global_env(), die.episode());
                    sim.robot_mut(robot).write_qpos(&start, None, Some(&[die.env()]))?;
                }
                Ok(())
            }))
            .build()
            .unwrap();
    assert_eq!(env.observation_space().names(), ["state/x", "state/angle", "state/v", "state/spin"]);
    assert_eq!((env.action_space().low(), env.action_space().high()), (&[-BOUND][..], &[BOUND][..]));
    assert_eq!(env.step_dt(), 0.02);

    let mut seen = env.reset(None, Some(seed)).unwrap();
    let (mut fell, mut in_time, mut clamped) = (0, 0, 0);
    for (k, expected) in by_hand(num_envs, steps, seed).into_iter().enumerate() {
        let actions = command(&seen);
        clamped += actions.iter().filter(|force| force.abs() > BOUND).count();
        let step = env.step(&actions).unwrap();
        for (e, expected) in expected.into_iter().enumerate() {
            let (terminated, truncated) = (step.terminated[e], step.truncated[e]);
            let found = row(&step.observations, &step.final_observations, e, step.rewards[e], terminated, truncated);
            assert_eq!(found, expected, "step {k}, environment {e}");
        }
        for ended in &step.info.ended {
            match &ended.reason {
                EndReason::Term(name) if name == "fell" => fell += 1,
                EndReason::TimeLimit => in_time += 1,
                other => panic!("{other}"),
            }
        }
        seen = step.observations;
    }
    // Control: the comparison includes both kinds of ends, and actions beyond the bounds.
    assert!(fell > 10 && in_time >= 3 && clamped > 3, "{fell} fell, {in_time} did not, {clamped} were clamped");
}

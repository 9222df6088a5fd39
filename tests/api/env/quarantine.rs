//! A step that cannot be done ends the episode of its environment, and nothing else.

use super::tasks::{cart_task, cfg, world};
use kinetoscope::env::{ActionTerm, EndReason, EnvBuilder, EnvCfg, ObservationTerm, RewardTerm, Space};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;

/// A cart that can be pushed by any finite number.
fn env(num_envs: usize) -> kinetoscope::env::Env {
    let (sim, robot) = world(cfg(num_envs, 2), false);
    let space = Space::uniform(["force"], [-1e308, 1e308]).unwrap();
    EnvBuilder::new(sim, EnvCfg { decimation: 3, episode_steps: Some(50) })
        .action(ActionTerm::new("push", space, move |sim, forces| {
            Ok(sim.robot_mut(robot).set_qf(forces, None, None)?)
        }))
        .observation(ObservationTerm::new("x", ["x"], move |now| Ok(now.sim().robot(robot).get_qpos())))
        .observation(ObservationTerm::new("v", ["v"], move |now| Ok(now.sim().robot(robot).get_qvel())))
        .reward(RewardTerm::new("v", 1.0, move |now| Ok(now.sim().robot(robot).get_qvel().column(0).to_owned())))
        .build()
        .unwrap()
}

#[test]
fn diverged() {
    let (mut env, mut calm) = (env(8), env(8));
    env.reset(None, None).unwrap();
    calm.reset(None, None).unwrap();
    let actions = |k: u64, blow_up: bool| {
        let of = |e: usize| if blow_up && k == 20 && e == 5 { 1e307 } else { (e as f64 + 0.1 * k as f64).sin() };
        Array2::from_shape_fn((8, 1), |(e, _)| of(e))
    };
    let mut before = env.observations().to_owned();
    for k in 1..=49 {
        let (step, expected) = (env.step(&actions(k, true)).unwrap(), calm.step(&actions(k, false)).unwrap());
        assert!(step.observations.iter().chain(&step.final_observations).chain(&step.rewards).all(|x| x.is_finite()));
        for e in (0..8).filter(|&e| e != 5 || k < 20) {
            assert_eq!(step.observations.row(e), expected.observations.row(e), "step {k}, environment {e}");
            assert_eq!(step.rewards[e], expected.rewards[e]);
        }
        let bad = k == 20;
        assert_eq!(step.terminated.iter().filter(|t| **t).count(), usize::from(bad), "step {k}");
        assert!(!step.truncated.iter().any(|t| *t));
        if bad {
            let [ended] = &step.info.ended[..] else { panic!("{:?}", step.info.ended) };
            assert_eq!((ended.env, ended.steps), (EnvId(5), 20));
            let EndReason::Diverged(why) = &ended.reason else { panic!("{}", ended.reason) };
            // Three physics steps in a step: 19 went well.
            assert!(why.starts_with("step 57: "), "{why}");
            assert_eq!(step.final_observations.row(5), before.row(5), "the last good state");
            assert_eq!(step.observations.row(5).to_vec(), [0.0, 0.0], "revived");
            assert!(env.sim().diverged().is_empty());
        }
        before = step.observations;
    }
    // The revived episode is 29 steps old, the others end now.
    let step = env.step(&actions(50, false)).unwrap();
    assert_eq!(step.truncated.iter().filter(|t| **t).count(), 7);
    assert!(!step.truncated[5] && env.now().episode_steps()[5] == 30);
}

/// A state that is written between steps and cannot be stepped on ends the same way.
#[test]
fn written_state() {
    let (sim, robot) = world(cfg(2, 1), false);
    let mut env = cart_task(sim, robot, EnvCfg::default()).build().unwrap();
    env.reset(None, None).unwrap();
    let far = Array2::from_elem((1, 1), 1e11);
    env.sim_mut().robot_mut(robot).write_qpos(&far, None, Some(&[EnvId(1)])).unwrap();
    let step = env.step(&Array2::zeros((2, 1))).unwrap();
    assert_eq!(step.terminated.to_vec(), [false, true]);
    assert!(matches!(&step.info.ended[..], [ended] if matches!(ended.reason, EndReason::Diverged(_))));
    assert!(env.step(&Array2::zeros((2, 1))).unwrap().info.ended.is_empty());
}

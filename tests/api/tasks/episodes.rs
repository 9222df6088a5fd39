//! Starts and ends of episodes, and the observations at them.

use super::bundled::{all_terms_task, cart_env, cart_task, cfg, idle, policy, world};
use kinetoscope::ndarray::{Array1, Array2, array};
use kinetoscope::prelude::*;
use kinetoscope::tasks::{
    ActionTerm, EndReason, Env, EnvBuilder, EnvCfg, EventMode, EventTerm, ObservationTerm, RewardTerm, Space,
    TermContext, TermResult, TerminationTerm,
};
use kinetoscope::viewer::{Command, SnapshotRequest, ViewerExt};
use kinetoscope_testkit::bits::bits;
use std::sync::{Arc, Mutex};

#[test]
fn time_limit() {
    for limit in [1, 2, 7] {
        let mut env = cart_env(2, Some(limit));
        let start = env.reset(None, None).unwrap();
        assert_eq!(start, array![[0.0], [0.0]]);
        for episode in 0..3 {
            for k in 1..=limit {
                let step = env.step(&array![[1.0], [2.0]]).unwrap();
                let last = k == limit;
                assert_eq!(step.truncated, Array1::from_elem(2, last), "step {k} of {limit}");
                assert_eq!(step.terminated, Array1::from_elem(2, false));
                let ended: Vec<u64> = step.info.ended.iter().map(|ended| ended.steps).collect();
                assert_eq!(ended, vec![limit; 2 * usize::from(last)]);
                // h² F k (k + 1) / 2.
                let away = |f: f64| 1e-4 * f * (k * (k + 1) / 2) as f64;
                for (e, f) in [1.0, 2.0].into_iter().enumerate() {
                    assert!((step.final_observations[(e, 0)] - away(f)).abs() < 1e-12, "episode {episode}, step {k}");
                }
                let seen = if last { &start } else { &step.final_observations };
                assert_eq!(bits(&step.observations), bits(seen));
                assert!(step.info.ended.iter().all(|ended| ended.reason == EndReason::TimeLimit));
            }
        }
    }
    // Without a limit no episode ends.
    let mut env = cart_env(1, None);
    env.reset(None, None).unwrap();
    assert!((0..100).all(|_| !env.step(&array![[1.0]]).unwrap().truncated[0]));
}

#[test]
fn two_ends_at_once() {
    let (sim, robot) = world(cfg(3, 1), false);
    let at = |step: u64| {
        move |now: &TermContext<'_>| -> TermResult<Array1<bool>> {
            Ok(now.episode_steps().iter().enumerate().map(|(env, &k)| env > 0 && k == step).collect())
        }
    };
    let mut env = cart_task(sim, robot, EnvCfg { episode_steps: Some(3), ..EnvCfg::default() })
        .termination(TerminationTerm::new("seen enough", at(2)).truncating())
        .termination(TerminationTerm::new("done", move |now| {
            Ok(at(2)(now)?.iter().enumerate().map(|(env, ends)| *ends && env == 2).collect())
        }))
        .build()
        .unwrap();
    env.reset(None, None).unwrap();
    let idle = Array2::zeros((3, 1));
    env.step(&idle).unwrap();
    let step = env.step(&idle).unwrap();
    assert_eq!(step.truncated, array![false, true, true]);
    assert_eq!(step.terminated, array![false, false, true]);
    let reasons: Vec<String> =
        step.info.ended.iter().map(|ended| format!("{} {}", ended.env.0, ended.reason)).collect();
    assert_eq!(reasons, ["1 seen enough", "2 seen enough"]);
    let step = env.step(&idle).unwrap();
    assert_eq!(step.truncated, array![true, false, false]);
    assert_eq!(step.info.ended[0].reason.to_string(), "time limit");
}

#[test]
fn seeds() {
    let run = |env: &mut Env, seed: Option<u64>| {
        let mut seen = env.reset(None, seed).unwrap();
        let mut all = bits(&seen);
        for _ in 0..100 {
            let step = env.step(&policy(seen.view())).unwrap();
            all.extend([bits(&step.observations), bits(&step.final_observations), bits(&step.rewards)].concat());
            seen = step.observations;
        }
        all
    };
    let (mut env, mut other) = (all_terms_task(cfg(4, 2)), all_terms_task(cfg(4, 2)));
    let first = run(&mut env, Some(5));
    assert_ne!(run(&mut env, None), first, "the next episodes");
    assert_ne!(run(&mut env, Some(6)), first, "another seed");
    assert_eq!(run(&mut env, Some(5)), first, "again");
    assert_eq!(run(&mut other, Some(5)), first, "another batch");
    // At first the seed is the simulation's.
    assert_eq!(run(&mut all_terms_task(cfg(4, 2)), None), run(&mut env, Some(cfg(4, 2).seed)));
}

#[test]
fn masks() {
    let (mut env, mut undisturbed_env) = (all_terms_task(cfg(5, 2)), all_terms_task(cfg(5, 2)));
    let (mut seen, mut undisturbed) =
        (env.reset(None, Some(5)).unwrap(), undisturbed_env.reset(None, Some(5)).unwrap());
    for k in 0..60 {
        if k == 17 {
            let again = env.reset(Some(&[false, true, false, false, true]), Some(9)).unwrap();
            for e in 0..5 {
                assert_eq!(again.row(e) == seen.row(e), ![1, 4].contains(&e), "environment {e}");
            }
            seen = again;
            assert_eq!(env.context().episode_steps(), [17, 0, 17, 17, 0]);
        }
        seen = env.step(&policy(seen.view())).unwrap().observations;
        undisturbed = undisturbed_env.step(&policy(undisturbed.view())).unwrap().observations;
        for e in [0, 2, 3] {
            assert_eq!(bits(seen.row(e)), bits(undisturbed.row(e)), "step {k}, environment {e}");
        }
    }
    // The reset environments are in the state of a batch with that seed.
    let mut with_seed = all_terms_task(cfg(5, 2));
    let mut expected = with_seed.reset(None, Some(9)).unwrap();
    for _ in 17..60 {
        expected = with_seed.step(&policy(expected.view())).unwrap().observations;
    }
    assert_eq!(bits(expected.row(1)), bits(seen.row(1)));
}

/// Global environment, episode and step of each event.
type Log = Arc<Mutex<Vec<(usize, u64, u64)>>>;

#[test]
fn events() {
    let log = |times: &Log, name: &'static str, when: EventMode| {
        let times = Arc::clone(times);
        EventTerm::new(name, when, move |_, rng| {
            let mut times = times.lock().unwrap();
            times.extend(rng.iter().map(|die| (die.env().0, die.episode(), die.seed())));
            Ok(())
        })
    };
    let [startup, reset, fixed, drawn]: [Log; 4] = std::array::from_fn(|_| Log::default());
    let (sim, _) = world(cfg(3, 1), false);
    let mut env = EnvBuilder::new(sim, EnvCfg { episode_steps: Some(10), ..EnvCfg::default() })
        .action(idle())
        .observation(ObservationTerm::new("k", ["k"], |now| {
            Ok(Array2::from_shape_fn((now.num_envs(), 1), |(env, _)| now.episode_steps()[env] as f64))
        }))
        .event(log(&startup, "startup", EventMode::Startup))
        .event(log(&reset, "reset", EventMode::Reset))
        .event(log(&fixed, "fixed", EventMode::Interval { steps: [4, 4] }))
        .event(log(&drawn, "drawn", EventMode::Interval { steps: [1, 6] }))
        .build()
        .unwrap();
    let taken = |log: &Log| std::mem::take(&mut *log.lock().unwrap());
    assert_eq!(taken(&startup), [(0, 0, 3), (1, 0, 3), (2, 0, 3)]);
    assert_eq!(taken(&reset), []);
    env.reset(None, Some(8)).unwrap();
    assert_eq!(taken(&reset), [(0, 0, 8), (1, 0, 8), (2, 0, 8)]);
    let actions = Array2::zeros((3, 1));
    let mut gaps = Vec::new();
    let mut last = [0; 3];
    for k in 1..=200_u64 {
        let step = env.step(&actions).unwrap();
        let of_episode = (k - 1) % 10 + 1;
        assert_eq!(step.final_observations[(0, 0)], of_episode as f64);
        // In steps 4 and 8; step 10 ends the episode, and an ended episode has no events.
        assert_eq!(taken(&fixed).len(), if of_episode % 4 == 0 { 3 } else { 0 }, "step {of_episode}");
        assert_eq!(taken(&reset).len(), if of_episode == 10 { 3 } else { 0 });
        for (e, _, _) in taken(&drawn) {
            gaps.push(of_episode - last[e]);
            last[e] = of_episode;
        }
        if of_episode == 10 {
            last = [0; 3];
        }
    }
    gaps.sort_unstable();
    gaps.dedup();
    assert_eq!(gaps, [1, 2, 3, 4, 5, 6], "every wait was drawn at some time");
    assert_eq!(taken(&startup), []);
}

#[test]
fn commands() {
    let mut env = all_terms_task(cfg(4, 2));
    let mut seen = env.reset(None, Some(1)).unwrap();
    let goal = env.observation_space().column_index("goal/x").unwrap();
    let mut of_episode = seen.column(goal).to_owned();
    assert!(of_episode.iter().all(|x| (-0.5..0.5).contains(x)) && of_episode[0] != of_episode[1]);
    let mut changes = 0;
    for _ in 0..120 {
        let step = env.step(&policy(seen.view())).unwrap();
        assert_eq!(step.final_observations.column(goal), of_episode, "the goal of the episode that ended");
        for ended in &step.info.ended {
            let EnvId(e) = ended.env;
            assert_ne!(step.observations[(e, goal)], of_episode[e]);
            of_episode[e] = step.observations[(e, goal)];
            changes += 1;
        }
        seen = step.observations;
    }
    assert!(changes >= 12, "{changes}");
}

/// Steps two equal tasks; after 10 steps, `act` applies an external reset to the first.
fn with_external_reset(act: impl FnOnce(&mut Env)) -> (Env, Env) {
    let (mut env, mut calm) = (all_terms_task(cfg(3, 2)), all_terms_task(cfg(3, 2)));
    let (mut seen, mut same) = (env.reset(None, Some(5)).unwrap(), calm.reset(None, Some(5)).unwrap());
    for _ in 0..10 {
        seen = env.step(&policy(seen.view())).unwrap().observations;
        same = calm.step(&policy(same.view())).unwrap().observations;
    }
    act(&mut env);
    let step = env.step(&policy(seen.view())).unwrap();
    let other = calm.step(&policy(same.view())).unwrap();
    let [ended] = &step.info.ended[..] else { panic!("{:?}", step.info.ended) };
    assert_eq!((ended.env, &ended.reason, ended.steps), (EnvId(1), &EndReason::Reset, 11));
    assert_eq!((step.truncated, step.terminated), (array![false, true, false], array![false, false, false]));
    assert!(other.info.ended.is_empty());
    assert_eq!(env.context().episode_steps(), [11, 0, 11]);
    for e in [0, 2] {
        assert_eq!(step.observations.row(e), other.observations.row(e), "the others do not notice");
    }
    // The next episode equals the one after a reset by the task itself: with its start, its command and its noise.
    let again = calm.reset(Some(&[false, true, false]), None).unwrap();
    assert_eq!(step.observations.row(1), again.row(1));
    (env, calm)
}

#[test]
fn reset_by_program() {
    let (mut env, mut calm) = with_external_reset(|env| env.sim_mut().reset(Some(&[EnvId(1)])).unwrap());
    // It continues undisturbed.
    let (mut a, mut b) = (env.observations().to_owned(), calm.observations().to_owned());
    for _ in 0..20 {
        let (one, other) = (env.step(&policy(a.view())).unwrap(), calm.step(&policy(b.view())).unwrap());
        assert_eq!((&one.observations, &one.info), (&other.observations, &other.info));
        (a, b) = (one.observations, other.observations);
    }
    // The simulation is returned without the task's observer.
    let mut sim = env.into_sim();
    sim.reset(None).unwrap();
    sim.update(1);
}

#[test]
fn reset_by_viewer() {
    let mut viewer = None;
    with_external_reset(|env| {
        let watching = env.sim_mut().viewer(SnapshotRequest { rate: 1.0, ..SnapshotRequest::default() });
        watching.send(Command::Reset(Some(EnvId(1))));
        viewer = Some(watching);
    });
}

/// A reset by the task itself does not count as external; `time_limit` asserts the same for ends of episodes.
#[test]
fn reset_by_task() {
    let mut env = cart_env(2, Some(3));
    env.reset(None, None).unwrap();
    for _ in 0..9 {
        env.step(&array![[1.0], [2.0]]).unwrap();
    }
    env.step(&array![[1.0], [2.0]]).unwrap();
    env.reset(Some(&[true, false]), None).unwrap();
    assert!(env.step(&array![[1.0], [2.0]]).unwrap().info.ended.is_empty());
}

/// A cart with an action of any finite force.
fn free_cart(num_envs: usize) -> Env {
    let (sim, robot) = world(cfg(num_envs, 2), false);
    let space = Space::uniform(["force"], [-1e308, 1e308]).unwrap();
    EnvBuilder::new(sim, EnvCfg { decimation: 3, episode_steps: Some(50), ..EnvCfg::default() })
        .action(ActionTerm::new("push", space, move |sim, forces| {
            Ok(sim.robot_mut(robot).set_qf_target(forces, None, None)?)
        }))
        .observation(ObservationTerm::new("x", ["x"], move |now| Ok(now.sim().robot(robot).qpos())))
        .observation(ObservationTerm::new("v", ["v"], move |now| Ok(now.sim().robot(robot).qvel())))
        .reward(RewardTerm::new("v", 1.0, move |now| Ok(now.sim().robot(robot).qvel().column(0).to_owned())))
        .build()
        .unwrap()
}

#[test]
fn diverged() {
    let (mut env, mut calm) = (free_cart(8), free_cart(8));
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
            // A step has three physics steps, and 19 steps succeeded.
            assert!(why.starts_with("step 57: "), "{why}");
            assert_eq!(step.final_observations.row(5), before.row(5), "the last good state");
            assert_eq!(step.observations.row(5).to_vec(), [0.0, 0.0], "revived");
            assert!(env.sim().diverged().is_empty());
        }
        before = step.observations;
    }
    // The revived episode is 29 steps old; the others end now.
    let step = env.step(&actions(50, false)).unwrap();
    assert_eq!(step.truncated.iter().filter(|t| **t).count(), 7);
    assert!(!step.truncated[5] && env.context().episode_steps()[5] == 30);
}

/// A state that is written between steps and diverges ends the episode in the same way.
#[test]
fn diverged_by_hand() {
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

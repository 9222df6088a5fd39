//! Resets that the task has not asked for.

use super::tasks::{cart_env, cfg, everything, policy};
use kinetoscope::env::{EndReason, Env};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::view::{Command, Viewing, Wants};

/// Steps two tasks alike; `act` is done to the first after 10 steps. Gives it, when the reset has been noticed.
fn disturbed(act: impl FnOnce(&mut Env)) -> (Env, Env) {
    let (mut env, mut calm) = (everything(cfg(3, 2)), everything(cfg(3, 2)));
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
    assert_eq!(env.now().episode_steps(), [11, 0, 11]);
    for e in [0, 2] {
        assert_eq!(step.observations.row(e), other.observations.row(e), "the others do not notice");
    }
    // The next episode is the one that follows a reset of the task's own: with its start, its command, its noise.
    let again = calm.reset(Some(&[false, true, false]), None).unwrap();
    assert_eq!(step.observations.row(1), again.row(1));
    (env, calm)
}

#[test]
fn of_the_program() {
    let (mut env, mut calm) = disturbed(|env| env.sim_mut().reset(Some(&[EnvId(1)])).unwrap());
    // It goes on as if nothing had happened.
    let (mut a, mut b) = (env.observations().to_owned(), calm.observations().to_owned());
    for _ in 0..20 {
        let (one, other) = (env.step(&policy(a.view())).unwrap(), calm.step(&policy(b.view())).unwrap());
        assert_eq!((&one.observations, &one.info), (&other.observations, &other.info));
        (a, b) = (one.observations, other.observations);
    }
    // The simulation is given back without its observer.
    let mut sim = env.into_sim();
    sim.reset(None).unwrap();
    sim.update(1);
}

#[test]
fn of_a_viewer() {
    let mut viewer = None;
    disturbed(|env| {
        let watching = env.sim_mut().viewer(Wants { rate: 1.0, ..Wants::default() });
        watching.send(Command::Reset(Some(EnvId(1))));
        viewer = Some(watching);
    });
}

/// A reset of the task itself, or of an episode that ended, does not count as a foreign one.
#[test]
fn of_the_task() {
    let mut env = cart_env(2, Some(3));
    env.reset(None, None).unwrap();
    for k in 1..=9 {
        let step = env.step(&array![[1.0], [2.0]]).unwrap();
        assert_eq!(step.info.ended.len(), if k % 3 == 0 { 2 } else { 0 });
        assert!(step.info.ended.iter().all(|ended| ended.reason == EndReason::TimeLimit));
    }
    env.step(&array![[1.0], [2.0]]).unwrap();
    env.reset(Some(&[true, false]), None).unwrap();
    assert!(env.step(&array![[1.0], [2.0]]).unwrap().info.ended.is_empty());
}

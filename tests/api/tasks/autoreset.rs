//! The three modes of automatic resets, against Gymnasium's.

use super::bundled::{all_terms_task_in, cart_task, cfg, policy, world};
use super::checks::{Broken, Fault};
use kinetoscope::ndarray::{Array1, Array2, Axis};
use kinetoscope::tasks::{
    AutoresetMode, CommandTerm, Env, EnvBuilder, EnvCfg, EnvError, Finding, ObservationTerm, RewardTerm, Step,
    TermContext, TermResult, TerminationTerm, VectorEnv, check, terms,
};
use kinetoscope_testkit::bits::bits;

/// A call and its result in three environments, for [`counter`].
enum Call {
    /// A step: observations, rewards, terminated, truncated.
    Step([f64; 3], [f64; 3], [u8; 3], [u8; 3]),
    /// A step in `SAME_STEP`: the same, and `final_obs` with its mask.
    SameStep([f64; 3], [f64; 3], [u8; 3], [u8; 3], [Option<f64>; 3]),
    /// A reset with a `reset_mask`: the mask, observations.
    Masked([u8; 3], [f64; 3]),
}

/// The environment k steps after the start of episode e is observed as 10 e + k, and the reward is 0.5 more. An
/// episode of environment 0 terminates after 3 steps, one of environment 1 is truncated after 2, environment 2 goes on.
fn counter(autoreset: AutoresetMode) -> Env {
    let (sim, robot) = world(cfg(3, 1), false);
    let push = terms::joint_efforts(&sim, "push", robot, &["slide"], 1.0).unwrap();
    let at = |now: &TermContext<'_>| -> TermResult<Array1<f64>> {
        let episodes = now.command("episode")?;
        Ok((0..3).map(|e| 10.0 * episodes[(e, 0)] + now.episode_steps()[e] as f64).collect())
    };
    let ends = |env: usize, limit: u64| {
        move |now: &TermContext<'_>| -> TermResult<Array1<bool>> {
            // Environments that only begin an episode in a step are past their end in it.
            Ok((0..3).map(|e| e == env && now.episode_steps()[e] >= limit).collect())
        }
    };
    EnvBuilder::new(sim, EnvCfg { autoreset, ..EnvCfg::default() })
        .action(push)
        .command(CommandTerm::new("episode", ["number"], |rng| [rng.episode() as f64]))
        .observation(ObservationTerm::new("at", ["k"], move |now| Ok(at(now)?.insert_axis(Axis(1)))))
        .reward(RewardTerm::new("at", 1.0, move |now| Ok(at(now)? + 0.5)))
        .termination(TerminationTerm::new("done", ends(0, 3)))
        .termination(TerminationTerm::new("cut", ends(1, 2)).truncating())
        .build()
        .unwrap()
}

/// Expected calls after the first reset, which gives observations of 0.
///
/// Gymnasium 1.4.0 gives these numbers: `SyncVectorEnv(envs, autoreset_mode=mode)` with three environments whose
/// `step` counts as [`counter`] does and whose `reset` begins the next episode at 0, and `reset(options={"reset_mask":
/// terminations | truncations})` after each end if resets are disabled.
fn expected(mode: AutoresetMode) -> Vec<Call> {
    const NO: [u8; 3] = [0; 3];
    let (first, second) = ([1, 0, 0], [0, 1, 0]);
    match mode {
        AutoresetMode::NextStep => vec![
            Call::Step([1.0, 1.0, 1.0], [1.5, 1.5, 1.5], NO, NO),
            Call::Step([2.0, 2.0, 2.0], [2.5, 2.5, 2.5], NO, second),
            Call::Step([3.0, 10.0, 3.0], [3.5, 0.0, 3.5], first, NO),
            Call::Step([10.0, 11.0, 4.0], [0.0, 11.5, 4.5], NO, NO),
            Call::Step([11.0, 12.0, 5.0], [11.5, 12.5, 5.5], NO, second),
            Call::Step([12.0, 20.0, 6.0], [12.5, 0.0, 6.5], NO, NO),
            Call::Step([13.0, 21.0, 7.0], [13.5, 21.5, 7.5], first, NO),
            Call::Step([20.0, 22.0, 8.0], [0.0, 22.5, 8.5], NO, second),
        ],
        AutoresetMode::SameStep => vec![
            Call::SameStep([1.0, 1.0, 1.0], [1.5, 1.5, 1.5], NO, NO, [None; 3]),
            Call::SameStep([2.0, 10.0, 2.0], [2.5, 2.5, 2.5], NO, second, [None, Some(2.0), None]),
            Call::SameStep([10.0, 11.0, 3.0], [3.5, 11.5, 3.5], first, NO, [Some(3.0), None, None]),
            Call::SameStep([11.0, 20.0, 4.0], [11.5, 12.5, 4.5], NO, second, [None, Some(12.0), None]),
            Call::SameStep([12.0, 21.0, 5.0], [12.5, 21.5, 5.5], NO, NO, [None; 3]),
            Call::SameStep([20.0, 30.0, 6.0], [13.5, 22.5, 6.5], first, second, [Some(13.0), Some(22.0), None]),
            Call::SameStep([21.0, 31.0, 7.0], [21.5, 31.5, 7.5], NO, NO, [None; 3]),
            Call::SameStep([22.0, 40.0, 8.0], [22.5, 32.5, 8.5], NO, second, [None, Some(32.0), None]),
        ],
        AutoresetMode::Disabled => vec![
            Call::Step([1.0, 1.0, 1.0], [1.5, 1.5, 1.5], NO, NO),
            Call::Step([2.0, 2.0, 2.0], [2.5, 2.5, 2.5], NO, second),
            Call::Masked([0, 1, 0], [2.0, 10.0, 2.0]),
            Call::Step([3.0, 11.0, 3.0], [3.5, 11.5, 3.5], first, NO),
            Call::Masked([1, 0, 0], [10.0, 11.0, 3.0]),
            Call::Step([11.0, 12.0, 4.0], [11.5, 12.5, 4.5], NO, second),
            Call::Masked([0, 1, 0], [11.0, 20.0, 4.0]),
            Call::Step([12.0, 21.0, 5.0], [12.5, 21.5, 5.5], NO, NO),
            Call::Step([13.0, 22.0, 6.0], [13.5, 22.5, 6.5], first, second),
            Call::Masked([1, 1, 0], [20.0, 30.0, 6.0]),
            Call::Step([21.0, 31.0, 7.0], [21.5, 31.5, 7.5], NO, NO),
            Call::Step([22.0, 32.0, 8.0], [22.5, 32.5, 8.5], NO, second),
        ],
        mode => panic!("{mode} has no table"),
    }
}

#[test]
fn gymnasium_tables() {
    let flags = |of: &Array1<bool>| [of[0].into(), of[1].into(), of[2].into()];
    let numbers = |of: &Array2<f64>| [of[(0, 0)], of[(1, 0)], of[(2, 0)]];
    for mode in AutoresetMode::ALL {
        let mut env = counter(mode);
        assert_eq!(VectorEnv::autoreset_mode(&env), mode);
        assert_eq!(numbers(&env.reset(None, Some(1)).unwrap()), [0.0; 3]);
        let actions = Array2::zeros((3, 1));
        let mut over = [0; 3];
        for (k, call) in expected(mode).into_iter().enumerate() {
            let step = |env: &mut Env, seen, rewards: [f64; 3], terminated, truncated| -> Step {
                let step = env.step(&actions).unwrap();
                assert_eq!(numbers(&step.observations), seen, "{mode}, call {k}");
                assert_eq!(step.rewards.to_vec(), rewards, "{mode}, call {k}");
                assert_eq!((flags(&step.terminated), flags(&step.truncated)), (terminated, truncated), "{mode}, {k}");
                // The reasons and lengths of the ended episodes are Gymnasium's infos of these steps.
                let ended: Vec<(usize, u64)> = step.info.ended.iter().map(|one| (one.env.0, one.steps)).collect();
                let (first, second) = (terminated[0] == 1, truncated[1] == 1);
                let all: Vec<(usize, u64)> =
                    [(first, (0, 3)), (second, (1, 2))].into_iter().filter(|(over, _)| *over).map(|of| of.1).collect();
                assert_eq!(ended, all, "{mode}, call {k}");
                step
            };
            match call {
                Call::Step(seen, rewards, terminated, truncated) => {
                    let step = step(&mut env, seen, rewards, terminated, truncated);
                    assert_eq!(bits(&step.final_observations), bits(&step.observations), "{mode}, call {k}");
                    over = std::array::from_fn(|e| terminated[e] | truncated[e]);
                }
                Call::SameStep(seen, rewards, terminated, truncated, last) => {
                    let step = step(&mut env, seen, rewards, terminated, truncated);
                    let expected: [f64; 3] = std::array::from_fn(|e| last[e].unwrap_or(seen[e]));
                    assert_eq!(numbers(&step.final_observations), expected, "{mode}, call {k}");
                }
                Call::Masked(mask, seen) => {
                    // Gymnasium asserts that every ended environment was reset.
                    let first = over.iter().position(|over| *over == 1).unwrap();
                    let error = env.step(&actions).unwrap_err();
                    assert!(matches!(error, EnvError::EpisodeEnded { env } if env == first), "{error}");
                    assert_eq!(mask, over, "the table resets the environments whose episode ended");
                    assert_eq!(numbers(&env.reset(Some(&mask.map(|on| on == 1)), None).unwrap()), seen, "call {k}");
                }
            }
        }
    }
}

/// Episodes of each environment: bits of all observations, of the first to the last, and of the rewards.
type Episodes = Vec<Vec<Vec<u64>>>;

fn episodes(mode: AutoresetMode, steps: usize) -> Episodes {
    let mut env = all_terms_task_in(cfg(5, 2), mode);
    let n = env.num_envs();
    let mut seen = env.reset(None, Some(5)).unwrap();
    let mut all: Episodes = (0..n).map(|e| vec![bits(seen.row(e))]).collect();
    let mut over = vec![false; n];
    for _ in 0..steps {
        if mode == AutoresetMode::Disabled && over.contains(&true) {
            seen = env.reset(Some(&over), None).unwrap();
            (0..n).filter(|&e| over[e]).for_each(|e| all[e].push(bits(seen.row(e))));
        }
        let step = env.step(&policy(seen.view())).unwrap();
        for e in 0..n {
            if mode == AutoresetMode::NextStep && over[e] {
                all[e].push(bits(step.observations.row(e)));
                continue;
            }
            let episode = all[e].last_mut().unwrap();
            episode.extend(bits(step.final_observations.row(e)));
            episode.push(step.rewards[e].to_bits());
            if mode == AutoresetMode::SameStep && (step.terminated[e] || step.truncated[e]) {
                all[e].push(bits(step.observations.row(e)));
            }
        }
        over = (0..n)
            .map(|e| (step.terminated[e] || step.truncated[e]) && !(mode == AutoresetMode::NextStep && over[e]))
            .collect();
        seen = step.observations;
    }
    // The last episode of an environment may be cut off.
    all.iter_mut().for_each(|of| drop(of.pop()));
    all
}

/// Noise, commands, events and physics of an episode do not depend on the mode.
#[test]
fn same_episodes() {
    let of: Vec<Episodes> = AutoresetMode::ALL.into_iter().map(|mode| episodes(mode, 150)).collect();
    for e in 0..5 {
        let count = of.iter().map(|of| of[e].len()).min().unwrap();
        assert!(count >= 3, "environment {e} has {count} episodes");
        for other in &of[1..] {
            assert!(of[0][e][..count] == other[e][..count], "environment {e}");
        }
        // Control: two episodes differ.
        assert_ne!(of[0][e][0], of[0][e][1]);
    }
}

#[test]
fn ignored_actions() {
    let mut env = counter(AutoresetMode::NextStep);
    env.reset(None, None).unwrap();
    let mut actions = Array2::zeros((3, 1));
    env.step(&actions).unwrap();
    env.step(&actions).unwrap();
    // Environment 1 begins an episode in the next step.
    actions[(1, 0)] = f64::NAN;
    env.step(&actions).unwrap();
    assert!(matches!(env.step(&actions), Err(EnvError::NotFinite { env: 1, .. })));
    actions[(1, 0)] = 0.0;
    env.step(&actions).unwrap();
    // A reset by mask comes before the automatic one.
    env.step(&actions).unwrap();
    assert_eq!(env.reset(Some(&[false, true, false]), None).unwrap()[(1, 0)], 20.0);
    assert_eq!(env.step(&actions).unwrap().observations[(1, 0)], 21.0);
}

#[test]
fn checked() {
    for mode in AutoresetMode::ALL {
        assert_eq!(check(&mut all_terms_task_in(cfg(4, 2), mode), 11), [], "{mode}");
        assert_eq!(mode.to_string().to_uppercase().parse::<AutoresetMode>().unwrap(), mode);
    }
    let error = "next_stop".parse::<AutoresetMode>().unwrap_err();
    assert!(matches!(&error, EnvError::UnknownName { candidates, .. } if candidates[0] == "next_step"), "{error}");
    // Faults that only these modes have.
    let broken = |autoreset, fault| {
        let (sim, robot) = world(cfg(4, 1), false);
        let env = cart_task(sim, robot, EnvCfg { episode_steps: Some(30), autoreset, ..EnvCfg::default() });
        check(&mut Broken::around(env.build().unwrap(), fault), 7)
    };
    let found = broken(AutoresetMode::NextStep, Fault::RewardAtBeginning);
    assert!(matches!(found[..], [Finding::BeginningStep { env: 0, ended: false, .. }]), "{found:?}");
    let found = broken(AutoresetMode::Disabled, Fault::StepsEndedEpisodes);
    assert!(matches!(found[..], [Finding::MissingError { .. }, ..]), "{found:?}");
    let found = broken(AutoresetMode::Disabled, Fault::WrongFinalObservations);
    assert!(found.iter().any(|finding| matches!(finding, Finding::FinalObservation { .. })), "{found:?}");
}

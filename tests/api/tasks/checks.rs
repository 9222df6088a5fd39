//! `kinetoscope_tasks::check` finds nothing in valid tasks, and the fault of broken ones.

use super::bundled::{all_terms_task, cart_env, cart_task, cfg, world};
use super::vector_env::Carts;
use kinetoscope::ndarray::{Array2, ArrayView2, s};
use kinetoscope::tasks::{AutoresetMode, Env, EnvCfg, EnvError, Finding, Space, Step, StepInfo, VectorEnv, check};

#[test]
fn good_tasks() {
    assert_eq!(check(&mut cart_env(3, Some(20)), 7), []);
    assert_eq!(check(&mut cart_env(1, None), 7), []);
    assert_eq!(check(&mut all_terms_task(cfg(4, 2)), 11), []);
    // The hand-written carts accept two kinds of invalid actions.
    let is_accepted = |finding: &Finding| matches!(finding, Finding::MissingError { .. });
    let found = check(&mut Carts::new(3, 1.0, 20), 7);
    assert!(found.iter().all(is_accepted) && found.len() == 2, "{found:?}");
    let messages: Vec<String> = found.iter().map(ToString::to_string).collect();
    assert!(messages[0].contains("one column too many") && messages[1].contains("a NaN action"), "{messages:?}");
}

/// Faults of an environment that the check must detect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Fault {
    None,
    RowMissing,
    NarrowSpace,
    NotReproducible,
    MaskIgnored,
    NeighborDependent,
    ActionsNotClamped,
    NeverRestarts,
    WrongFinalObservations,
    NanReward,
    StepFails,
    AcceptsWrongMask,
    MaskedResetFails,
    OutOfBoundsFails,
    /// A reward in a step that only begins an episode.
    RewardAtBeginning,
    /// Environments whose episode ended are reset by the next step, although automatic resets are disabled.
    StepsEndedEpisodes,
}

/// A valid task with a fault added.
pub(super) struct Broken {
    inner: Env,
    fault: Fault,
    narrow: Space,
    resets: u32,
    steps: u32,
    ended_observations: Option<Array2<f64>>,
}

impl Broken {
    fn new(fault: Fault) -> Self {
        let (sim, robot) = world(cfg(4, 1), false);
        Self::around(
            cart_task(sim, robot, EnvCfg { episode_steps: Some(30), ..Default::default() }).build().unwrap(),
            fault,
        )
    }

    pub(super) fn around(inner: Env, fault: Fault) -> Self {
        let narrow = Space::uniform(["place/x"], [-1e-6, 1e-6]).unwrap();
        Self { inner, fault, narrow, resets: 0, steps: 0, ended_observations: None }
    }
}

impl VectorEnv for Broken {
    type Error = EnvError;
    type Info = StepInfo;

    fn num_envs(&self) -> usize {
        self.inner.num_envs()
    }

    fn observation_space(&self) -> &Space {
        if self.fault == Fault::NarrowSpace { &self.narrow } else { self.inner.observation_space() }
    }

    fn action_space(&self) -> &Space {
        self.inner.action_space()
    }

    fn autoreset_mode(&self) -> AutoresetMode {
        self.inner.cfg().autoreset
    }

    fn reset(&mut self, mask: Option<&[bool]>, seed: Option<u64>) -> Result<Array2<f64>, EnvError> {
        (self.resets, self.ended_observations) = (self.resets + 1, None);
        if self.fault == Fault::MaskedResetFails && mask.is_some_and(|mask| mask.len() == self.num_envs()) {
            return Err(EnvError::ResetFirst { env: 1 });
        }
        let mask = match (self.fault, mask) {
            (Fault::MaskIgnored, Some(mask)) if mask.len() == self.num_envs() => None,
            (Fault::AcceptsWrongMask, _) => None,
            (_, mask) => mask,
        };
        let seen = self.inner.reset(mask, seed)?;
        Ok(match self.fault {
            Fault::RowMissing => seen.slice(s![1.., ..]).to_owned(),
            Fault::NotReproducible => seen + f64::from(self.resets),
            _ => seen,
        })
    }

    fn step(&mut self, actions: ArrayView2<'_, f64>) -> Result<Step, EnvError> {
        self.steps += 1;
        if self.fault == Fault::StepFails && self.steps == 5 {
            return Err(EnvError::ResetFirst { env: 0 });
        }
        let high = self.action_space().high()[0];
        if self.fault == Fault::OutOfBoundsFails && actions.iter().any(|action| *action > high) {
            return Err(EnvError::ResetFirst { env: 2 });
        }
        if self.fault == Fault::StepsEndedEpisodes && self.ended_observations.take().is_some() {
            self.inner.reset(None, None)?;
        }
        let mut step = self.inner.step(actions)?;
        match self.fault {
            Fault::NeighborDependent => {
                step.observations[(0, 0)] += 1e-9 * actions[(1, 0)];
                step.final_observations[(0, 0)] += 1e-9 * actions[(1, 0)];
            }
            Fault::ActionsNotClamped => step.rewards += &actions.column(0),
            Fault::WrongFinalObservations => step.final_observations.fill(0.0),
            Fault::NanReward => step.rewards[2] = f64::NAN,
            Fault::RewardAtBeginning => {
                let begins = self.ended_observations.take().is_some();
                step.rewards.iter_mut().for_each(|reward| *reward += f64::from(u8::from(begins)));
                self.ended_observations = step.truncated[0].then(|| step.observations.clone());
            }
            Fault::StepsEndedEpisodes => {
                self.ended_observations = step.truncated[0].then(|| step.observations.clone());
            }
            Fault::NeverRestarts if self.ended_observations.is_some() || step.truncated.iter().any(|over| *over) => {
                // The environment stays at the end of its episode and reports that end in every step.
                let over = self.ended_observations.get_or_insert_with(|| step.final_observations.clone()).clone();
                (step.observations, step.final_observations) = (over.clone(), over);
                step.truncated.fill(true);
            }
            _ => {}
        }
        Ok(step)
    }
}

/// True for the expected finding.
type IsExpected = fn(&Finding) -> bool;

#[test]
fn broken_tasks() {
    assert_eq!(check(&mut Broken::new(Fault::None), 7), [], "the control");
    let cases: [(Fault, IsExpected, &str); 13] = [
        (
            Fault::RowMissing,
            |f| matches!(f, Finding::Shape { found, expected, .. } if found == &[3, 1] && expected == &[4, 1]),
            "[3, 1]",
        ),
        (Fault::NarrowSpace, |f| matches!(f, Finding::OutOfSpace { column, .. } if column == "place/x"), "place/x"),
        (
            Fault::NotReproducible,
            |f| matches!(f, Finding::NotReproducible(apart) if apart.when == "after the reset"),
            "the same seed",
        ),
        (Fault::MaskIgnored, |f| matches!(f, Finding::MaskedReset(apart) if apart.env % 2 == 0), "a reset of other"),
        (
            Fault::NeighborDependent,
            |f| matches!(f, Finding::Interference(apart) if apart.env == 0),
            "actions of another",
        ),
        (
            Fault::ActionsNotClamped,
            |f| matches!(f, Finding::ActionClamping(apart) if apart.what == "reward"),
            "beyond their bounds",
        ),
        (Fault::NeverRestarts, |f| matches!(f, Finding::NoAutoReset { .. }), "no new one began"),
        (Fault::WrongFinalObservations, |f| matches!(f, Finding::FinalObservation { .. }), "final_observations"),
        (Fault::NanReward, |f| matches!(f, Finding::Reward { env: 2, value, .. } if value.is_nan()), "reward"),
        (Fault::StepFails, |f| matches!(f, Finding::UnexpectedError { what, .. } if what == "step 4"), "step 4"),
        // Regression: findings of the runs with masked resets and with actions beyond their bounds were dropped.
        (
            Fault::MaskedResetFails,
            |f| matches!(f, Finding::UnexpectedError { what, .. } if what == "a reset by mask"),
            "a reset by mask",
        ),
        (Fault::OutOfBoundsFails, |f| matches!(f, Finding::UnexpectedError { what, .. } if what == "step 0"), "step 0"),
        (Fault::AcceptsWrongMask, |f| matches!(f, Finding::MissingError { .. }), "mask"),
    ];
    for (fault, is_it, word) in cases {
        let found = check(&mut Broken::new(fault), 7);
        let said: Vec<String> = found.iter().map(ToString::to_string).collect();
        let it = found.iter().position(is_it);
        assert!(it.is_some_and(|k| said[k].contains(word)), "{fault:?}: {said:?}");
    }
}

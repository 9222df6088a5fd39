//! A conformance test of [`VectorEnv`] implementations.

use crate::autoreset::AutoresetMode;
use crate::space::Space;
use crate::step::Step;
use crate::vector::VectorEnv;
use kinetoscope_scene::KeyedRng;
use ndarray::{Array1, Array2};
use std::fmt;

/// Number of task steps of a run. Only episode ends within them are checked.
const STEPS: usize = 100;

/// A violation of the [`VectorEnv`] contract.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Finding {
    /// The batch has no environment.
    NoEnvironments,
    /// A valid call returned an error.
    UnexpectedError {
        /// The call: `a reset with a seed` or `step 12`.
        what: String,
        /// The error message.
        error: String,
    },
    /// An invalid call returned no error.
    MissingError {
        /// The invalid argument.
        what: &'static str,
    },
    /// An array has the wrong shape.
    Shape {
        /// The array and the time, such as `rewards of step 12`.
        what: String,
        /// Its shape.
        found: Vec<usize>,
        /// The expected shape.
        expected: Vec<usize>,
    },
    /// An observation is not finite, or outside the observation space.
    OutOfSpace {
        /// The array and the time: `observations of step 12`, `final_observations of step 12`, or `after the reset`.
        /// Steps count from 0.
        when: String,
        /// The environment.
        env: usize,
        /// Name of the column.
        column: String,
        /// The value.
        value: f64,
        /// Lower and upper bound of the column.
        bounds: [f64; 2],
    },
    /// A reward is not finite.
    Reward {
        /// Time: `step 12`.
        when: String,
        /// The environment.
        env: usize,
        /// The reward.
        value: f64,
    },
    /// The final observation differs from the observation of the same step, although the environment did not begin an
    /// episode after it: the episode goes on, or the mode is not
    /// [`AutoresetMode::SameStep`](crate::AutoresetMode::SameStep).
    FinalObservation {
        /// Time: `step 12`.
        when: String,
        /// The environment.
        env: usize,
    },
    /// No episode began after an end in the mode [`AutoresetMode::SameStep`](crate::AutoresetMode::SameStep): three
    /// consecutive steps end the episode, with `observations` equal to `final_observations`.
    NoAutoReset {
        /// Time of the third consecutive end: `step 12`.
        when: String,
        /// The environment.
        env: usize,
    },
    /// In the step after the end of an episode, which only begins the next one
    /// ([`AutoresetMode::NextStep`](crate::AutoresetMode::NextStep)), there is a reward, or another end.
    BeginningStep {
        /// Time: `step 12`.
        when: String,
        /// The environment.
        env: usize,
        /// The reward; it must be 0.
        reward: f64,
        /// True if an end was reported.
        ended: bool,
    },
    /// Two runs with the same seed and actions differ.
    NotReproducible(RunDifference),
    /// A reset of some environments changed others.
    MaskedReset(RunDifference),
    /// The actions of one environment changed the results of others.
    Interference(RunDifference),
    /// Actions beyond their bounds give other results than actions at the bounds. Only columns with two finite bounds
    /// are tested.
    ActionClamping(RunDifference),
}

/// The first difference between two runs that should be equal.
#[derive(Clone, Debug, PartialEq)]
pub struct RunDifference {
    /// Time of the difference: `step 12`, or `after the reset`.
    pub when: String,
    /// The environment.
    pub env: usize,
    /// The compared quantity: a column of the observations, `reward`, `terminated` or `truncated` (1 or 0).
    pub what: String,
    /// Value in one run.
    pub first: f64,
    /// Value in the other run.
    pub second: f64,
}

impl fmt::Display for RunDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { when, env, what, first, second } = self;
        write!(f, "{when}, environment {env}: {what} is {first:e} in one run and {second:e} in the other")
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoEnvironments => f.write_str("the batch has no environment; it needs at least one"),
            Self::UnexpectedError { what, error } => write!(f, "{what} returned an error, but must succeed: {error}"),
            Self::MissingError { what } => write!(f, "{what} was accepted, but must return an error"),
            Self::Shape { what, found, expected } => {
                write!(f, "{what} has shape {found:?}; it must have {expected:?}")
            }
            Self::OutOfSpace { when, env, column, value, bounds: [low, high] } => {
                write!(f, "{when}, environment {env}: {column} is {value}; it must be finite and from {low} to {high}")
            }
            Self::Reward { when, env, value } => {
                write!(f, "{when}, environment {env}: the reward is {value}; it must be finite")
            }
            Self::FinalObservation { when, env } => write!(
                f,
                "{when}, environment {env}: no episode began after it, but final_observations differ from observations"
            ),
            Self::NoAutoReset { when, env } => write!(
                f,
                "{when}, environment {env}: the episode ended and no new one began; observations must be the first ones of the \
                 next episode"
            ),
            Self::BeginningStep { when, env, reward, ended } => write!(
                f,
                "{when}, environment {env}: the step after an end only begins an episode, so its reward must be 0 and no \
                 episode can end in it; the reward is {reward}, ended is {ended}"
            ),
            Self::NotReproducible(apart) => write!(f, "the same seed and actions give different results: {apart}"),
            Self::MaskedReset(apart) => write!(f, "a reset of other environments changed this one: {apart}"),
            Self::Interference(apart) => write!(f, "actions of another environment changed this one: {apart}"),
            Self::ActionClamping(apart) => write!(f, "actions beyond their bounds do not act as the bounds: {apart}"),
        }
    }
}

/// Tests a batch of environments against the [`VectorEnv`] contract, as Gymnasium's `check_env` does. Returns the first
/// violation of each kind, and every invalid call that was accepted; the list is empty if no violation was found.
///
/// Each of several runs resets the batch with `seed` and does 100 steps with random actions of that seed. Episode ends
/// after these steps are not tested. If a call of the first run fails, or an array has the wrong shape, the other tests
/// are skipped. The test covers:
///
/// - shapes, observations within their space, finite rewards;
/// - final observations, and the automatic reset at the time of [`VectorEnv::autoreset_mode`]; if resets are disabled,
///   an error for a step without the reset;
/// - the same bits for the same seed; without them, the next three tests are skipped;
/// - resets by mask that leave other environments unchanged, if there are two or more environments;
/// - environments that do not influence each other, if there are two or more environments;
/// - actions beyond their bounds, which must act as the bounds;
/// - errors for masks and actions of another shape, and for actions that are NaN.
///
/// Reset the environments before they are used again.
///
/// ```
/// # use kinetoscope_tasks::{Space, Step, VectorEnv};
/// # use ndarray::{Array1, Array2, ArrayView2};
/// # fn all_is_well<E: VectorEnv>(environments: &mut E) {
/// let findings = kinetoscope_tasks::check(environments, 7);
/// assert!(findings.is_empty(), "{}", findings.iter().map(|finding| format!("{finding}\n")).collect::<String>());
/// # }
/// ```
#[must_use = "findings are only returned, not printed"]
pub fn check<E: VectorEnv + ?Sized>(env: &mut E, seed: u64) -> Vec<Finding> {
    let n = env.num_envs();
    if n == 0 {
        return vec![Finding::NoEnvironments];
    }
    let mut found = Vec::new();
    let plain = RunVariant { seed, ..RunVariant::default() };
    let Some(first) = rollout(env, &plain, &mut found) else { return found };
    let compare =
        |env: &mut E, plan: &RunVariant, of: &dyn Fn(usize) -> bool, found: &mut Vec<Finding>, kind: FindingFn| {
            let names = env.observation_space().names().to_vec();
            if let Some(other) = rollout(env, plan, found)
                && let Some(apart) = first_difference(&first, &other, &names, of)
            {
                found.push(kind(apart));
            }
        };
    compare(env, &plain, &|_| true, &mut found, Finding::NotReproducible);
    // Without reproducible runs, every comparison below would fail for the same reason.
    if !found.iter().any(|finding| matches!(finding, Finding::NotReproducible(_))) {
        if n > 1 {
            let is_even = |env: usize| env.is_multiple_of(2);
            compare(env, &RunVariant { reset_odd: true, ..plain }, &is_even, &mut found, Finding::MaskedReset);
            compare(
                env,
                &RunVariant { odd_actions_differ: true, ..plain },
                &is_even,
                &mut found,
                Finding::Interference,
            );
        }
        let bounded = RunVariant { beyond_bounds_by: Some(0.0), ..plain };
        let names = env.observation_space().names().to_vec();
        let (at, beyond) = (
            rollout(env, &bounded, &mut found),
            rollout(env, &RunVariant { beyond_bounds_by: Some(1.0), ..plain }, &mut found),
        );
        if let (Some(at), Some(beyond)) = (at, beyond)
            && let Some(apart) = first_difference(&at, &beyond, &names, &|_| true)
        {
            found.push(Finding::ActionClamping(apart));
        }
    }
    check_invalid_calls(env, seed, &mut found);
    found
}

/// Constructor of a finding from a difference between two runs.
type FindingFn = fn(RunDifference) -> Finding;

/// Variations of a run.
#[derive(Clone, Copy, Debug, Default)]
struct RunVariant {
    seed: u64,
    /// Odd environments are reset in the middle of the run.
    reset_odd: bool,
    /// Odd environments get other actions.
    odd_actions_differ: bool,
    /// Bounded actions are at their bounds, or beyond them by this distance.
    beyond_bounds_by: Option<f64>,
}

impl RunVariant {
    fn actions(&self, space: &Space, n: usize, step: usize) -> Array2<f64> {
        let mut actions = Array2::zeros((n, space.len()));
        for (env, mut row) in actions.rows_mut().into_iter().enumerate() {
            let other = self.odd_actions_differ && env % 2 == 1;
            let what = format!("env/check/{step}/{}", if other { "other" } else { "" });
            let mut random = KeyedRng::keyed(self.seed, env as u64, &what);
            for (k, action) in row.iter_mut().enumerate() {
                let (low, high, part) = (space.low()[k], space.high()[k], random.uniform());
                *action = match (self.beyond_bounds_by, low.is_finite(), high.is_finite()) {
                    (Some(beyond), true, true) if part < 0.5 => low - beyond,
                    (Some(beyond), true, true) => high + beyond,
                    (_, true, true) => low + (high - low) * part,
                    (_, true, false) => low + part,
                    (_, false, true) => high - part,
                    (_, false, false) => 2.0 * part - 1.0,
                };
            }
        }
        actions
    }
}

/// Results of a run: observations after the reset, and results of each step.
struct Rollout {
    initial_observations: Array2<f64>,
    steps: Vec<StepOutput>,
}

/// Results of a step that are compared.
struct StepOutput {
    observations: Array2<f64>,
    rewards: Array1<f64>,
    ends: [Array1<bool>; 2],
}

/// Runs a plan, and adds violations within this run to `found`. Returns `None` if a call fails, an array has the wrong
/// shape, or a step of an ended episode succeeds although automatic resets are disabled.
fn rollout<E: VectorEnv + ?Sized>(env: &mut E, plan: &RunVariant, found: &mut Vec<Finding>) -> Option<Rollout> {
    let n = env.num_envs();
    let (seen, acted) = (env.observation_space().clone(), env.action_space().clone());
    let initial_observations =
        env.reset(None, Some(plan.seed)).map_err(|error| report_error("a reset with a seed", &error, found)).ok()?;
    if !has_shape("the observation array of a reset", initial_observations.shape(), &[n, seen.len()], found) {
        return None;
    }
    check_bounds(&initial_observations, &seen, "after the reset", found);
    let mut run = Rollout { initial_observations, steps: Vec::new() };
    let mode = env.autoreset_mode();
    let mut watch = vec![AutoResetMonitor::default(); n];
    let mut over = vec![false; n];
    for step in 0..STEPS {
        let when = format!("step {step}");
        if plan.reset_odd && step == STEPS / 2 {
            let mask: Vec<bool> = (0..n).map(|env| env % 2 == 1).collect();
            let given =
                env.reset(Some(&mask), None).map_err(|error| report_error("a reset by mask", &error, found)).ok()?;
            if !has_shape("the observation array of a reset by mask", given.shape(), &[n, seen.len()], found) {
                return None;
            }
            over.iter_mut().zip(&mask).for_each(|(over, reset)| *over &= !reset);
            // The rows of environments that were not reset repeat their last observations.
            if let Some(last) = run.steps.last_mut() {
                last.observations = given;
            }
        }
        if mode == AutoresetMode::Disabled && over.contains(&true) {
            let when = "a reset of ended episodes";
            if env.step(plan.actions(&acted, n, step).view()).is_ok() {
                let what = "a step of an environment whose episode has ended";
                push_first_of_kind(found, Finding::MissingError { what });
                return None;
            }
            env.reset(Some(&over), None).map_err(|error| report_error(when, &error, found)).ok()?;
        }
        let actions = plan.actions(&acted, n, step);
        let done = env.step(actions.view()).map_err(|error| report_error(&when, &error, found)).ok()?;
        let Step { observations, final_observations, rewards, terminated, truncated, .. } = done;
        let tables = [("observations", &observations), ("final_observations", &final_observations)];
        let mut right = true;
        for (what, table) in tables {
            right &= has_shape(&format!("{what} of {when}"), table.shape(), &[n, seen.len()], found);
        }
        let columns = [("rewards", rewards.len()), ("terminated", terminated.len()), ("truncated", truncated.len())];
        for (what, length) in columns {
            right &= has_shape(&format!("{what} of {when}"), &[length], &[n], found);
        }
        if !right {
            return None;
        }
        for (what, table) in tables {
            check_bounds(table, &seen, &format!("{what} of {when}"), found);
        }
        for env in 0..n {
            if !rewards[env].is_finite() {
                push_first_of_kind(found, Finding::Reward { when: when.clone(), env, value: rewards[env] });
            }
            let same = same_bits(&observations, &final_observations, env);
            let ended = terminated[env] || truncated[env];
            if !ended && !same {
                push_first_of_kind(found, Finding::FinalObservation { when: when.clone(), env });
            }
            if mode == AutoresetMode::SameStep && watch[env].update(ended, same) {
                push_first_of_kind(found, Finding::NoAutoReset { when: when.clone(), env });
            }
            if mode != AutoresetMode::SameStep && ended && !same {
                push_first_of_kind(found, Finding::FinalObservation { when: when.clone(), env });
            }
            if mode == AutoresetMode::NextStep && over[env] && (ended || rewards[env] != 0.0) {
                let when = when.clone();
                push_first_of_kind(found, Finding::BeginningStep { when, env, reward: rewards[env], ended });
            }
            over[env] = ended;
        }
        run.steps.push(StepOutput { observations, rewards, ends: [terminated, truncated] });
    }
    Some(run)
}

/// Detects an environment that does not begin a new episode after an end.
#[derive(Clone, Copy, Debug, Default)]
struct AutoResetMonitor {
    /// Number of task steps of the longest episode.
    longest: usize,
    /// Number of task steps of the present episode.
    steps: usize,
    /// Consecutive steps that end the episode, with an observation equal to the final one.
    repeated_ends: usize,
}

impl AutoResetMonitor {
    /// Counts a step, and returns true if automatic resets are missing. `same` is true if the observation equals the
    /// final one. They are after three such ends in consecutive steps if an earlier episode was longer than one step.
    fn update(&mut self, ended: bool, same: bool) -> bool {
        self.steps += 1;
        self.repeated_ends = match ended && same && (self.repeated_ends == 0 || self.steps == 1) {
            true => self.repeated_ends + 1,
            false => 0,
        };
        self.longest = self.longest.max(self.steps);
        if ended {
            self.steps = 0;
        }
        self.repeated_ends >= 3 && self.longest > 1
    }
}

/// Checks that invalid arguments give errors.
fn check_invalid_calls<E: VectorEnv + ?Sized>(env: &mut E, seed: u64, found: &mut Vec<Finding>) {
    let n = env.num_envs();
    let width = env.action_space().len();
    let mut wrong = |what: &'static str, taken: bool| {
        if taken {
            found.push(Finding::MissingError { what });
        }
    };
    wrong("a mask that is too long", env.reset(Some(&vec![true; n + 1]), None).is_ok());
    let middle = RunVariant { seed, ..RunVariant::default() }.actions(env.action_space(), n, 0);
    for (what, shape) in [
        ("an action array with one row too many", (n + 1, width)),
        ("an action array with one column too many", (n, width + 1)),
    ] {
        // After an error the environments may be without an episode.
        if env.reset(None, Some(seed)).is_err() {
            return;
        }
        let actions = Array2::from_shape_fn(shape, |(row, k)| middle.get((row, k)).copied().unwrap_or(0.0));
        wrong(what, env.step(actions.view()).is_ok());
    }
    if width > 0 && env.reset(None, Some(seed)).is_ok() {
        let mut actions = middle;
        actions[(0, 0)] = f64::NAN;
        wrong("a NaN action", env.step(actions.view()).is_ok());
    }
}

/// Returns the first difference between two runs in the environments that `of` selects.
fn first_difference(
    first: &Rollout,
    second: &Rollout,
    names: &[String],
    of: &dyn Fn(usize) -> bool,
) -> Option<RunDifference> {
    let differ = |when: &str, env, what: &str, one: f64, other: f64| {
        (one.to_bits() != other.to_bits()).then(|| RunDifference {
            when: when.into(),
            env,
            what: what.into(),
            first: one,
            second: other,
        })
    };
    let tables = |when: &str, one: &Array2<f64>, other: &Array2<f64>| {
        let mut numbers = one.indexed_iter().filter(|((env, _), _)| of(*env));
        numbers.find_map(|((env, k), x)| differ(when, env, names.get(k).map_or("", |name| name), *x, other[(env, k)]))
    };
    tables("after the reset", &first.initial_observations, &second.initial_observations).or_else(|| {
        first.steps.iter().zip(&second.steps).enumerate().find_map(|(step, (one, other))| {
            let when = format!("step {step}");
            let number = |is: bool| f64::from(u8::from(is));
            tables(&when, &one.observations, &other.observations).or_else(|| {
                (0..one.rewards.len()).filter(|env| of(*env)).find_map(|env| {
                    let ends = ["terminated", "truncated"].into_iter().zip(one.ends.iter().zip(&other.ends));
                    differ(&when, env, "reward", one.rewards[env], other.rewards[env]).or_else(|| {
                        let mut ends = ends;
                        ends.find_map(|(what, (a, b))| differ(&when, env, what, number(a[env]), number(b[env])))
                    })
                })
            })
        })
    })
}

fn same_bits(one: &Array2<f64>, other: &Array2<f64>, env: usize) -> bool {
    one.row(env).iter().zip(other.row(env)).all(|(a, b)| a.to_bits() == b.to_bits())
}

fn has_shape(what: &str, found: &[usize], expected: &[usize], findings: &mut Vec<Finding>) -> bool {
    if found != expected {
        let (found, expected) = (found.to_vec(), expected.to_vec());
        push_first_of_kind(findings, Finding::Shape { what: what.into(), found, expected });
        return false;
    }
    true
}

fn check_bounds(table: &Array2<f64>, space: &Space, when: &str, found: &mut Vec<Finding>) {
    for ((env, k), &value) in table.indexed_iter() {
        let bounds = [space.low()[k], space.high()[k]];
        if !(value.is_finite() && bounds[0] <= value && value <= bounds[1]) {
            let column = space.names()[k].clone();
            push_first_of_kind(found, Finding::OutOfSpace { when: when.into(), env, column, value, bounds });
            return;
        }
    }
}

fn report_error(what: &str, error: &dyn fmt::Display, found: &mut Vec<Finding>) {
    push_first_of_kind(found, Finding::UnexpectedError { what: what.into(), error: error.to_string() });
}

/// Adds a finding unless there is one of its kind.
fn push_first_of_kind(found: &mut Vec<Finding>, finding: Finding) {
    let kind = std::mem::discriminant(&finding);
    if !found.iter().any(|known| std::mem::discriminant(known) == kind) {
        found.push(finding);
    }
}

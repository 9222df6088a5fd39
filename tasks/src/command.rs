//! Command terms: goals of an episode.

use crate::context::TermContext;
use crate::episode_rng::EpisodeRng;
use crate::error::{EnvError, Result, TermKind, TermResult};
use crate::guard::guard;
use crate::space::Space;
use ndarray::{Array2, ArrayView2};
use std::fmt;

type SampleCommand = Box<dyn Fn(&mut EpisodeRng) -> Vec<f64> + Send>;
type UpdateCommand = Box<dyn Fn(&TermContext<'_>, ArrayView2<'_, f64>) -> TermResult<Array2<f64>> + Send>;

/// Numbers that are drawn for an environment when an episode begins, such as a goal position or a target velocity.
/// Other terms read them with [`TermContext::command`].
///
/// They stay until the episode ends, unless the term [draws them again](Self::resampled_every) or
/// [computes them](Self::derived) from drawn numbers and the state.
pub struct CommandTerm {
    pub(crate) name: String,
    pub(crate) columns: Vec<String>,
    /// Number of drawn numbers.
    pub(crate) drawn: usize,
    sample: SampleCommand,
    /// Range of the time between two draws \[s\].
    resampling: Option<[f64; 2]>,
    update: Option<UpdateCommand>,
}

impl CommandTerm {
    /// Creates a term with named columns. `sample` draws the values of one environment: when an episode begins, and
    /// again with [`resampled_every`](Self::resampled_every). A value that is not finite is an error of that reset or
    /// step.
    pub fn new<const K: usize>(
        name: impl Into<String>,
        columns: [&str; K],
        sample: impl Fn(&mut EpisodeRng) -> [f64; K] + Send + 'static,
    ) -> Self {
        let columns = columns.map(String::from).to_vec();
        let sample: SampleCommand = Box::new(move |rng| sample(rng).to_vec());
        Self { name: name.into(), columns, drawn: K, sample, resampling: None, update: None }
    }

    /// Creates a term whose values are computed from drawn numbers and the state, such as a turning rate toward a drawn
    /// heading.
    ///
    /// `sample` returns the drawn numbers of one environment, `update` the values of all environments, shape (N,
    /// columns), from the drawn numbers, shape (N, D). `update` is called when episodes begin, after the reset events,
    /// and in each step before the observations. Reset events therefore see the values of the previous episode.
    pub fn derived<const D: usize, const K: usize>(
        name: impl Into<String>,
        columns: [&str; K],
        sample: impl Fn(&mut EpisodeRng) -> [f64; D] + Send + 'static,
        update: impl Fn(&TermContext<'_>, ArrayView2<'_, f64>) -> TermResult<Array2<f64>> + Send + 'static,
    ) -> Self {
        let columns = columns.map(String::from).to_vec();
        let sample: SampleCommand = Box::new(move |rng| sample(rng).to_vec());
        Self { name: name.into(), columns, drawn: D, sample, resampling: None, update: Some(Box::new(update)) }
    }

    /// Creates a term with independent, uniformly distributed columns.
    pub(crate) fn uniform(name: &str, columns: Vec<(String, [f64; 2])>) -> Self {
        let (columns, ranges): (Vec<String>, Vec<[f64; 2]>) = columns.into_iter().unzip();
        let drawn = columns.len();
        let sample: SampleCommand =
            Box::new(move |rng| ranges.iter().map(|[low, high]| rng.uniform_range(*low, *high)).collect());
        Self { name: name.into(), columns, drawn, sample, resampling: None, update: None }
    }

    /// Draws the numbers again during an episode, after random times of `seconds` (lowest and highest, uniformly
    /// distributed), rounded up to whole steps of the task. A new draw comes after the rewards and before the
    /// observations of a step.
    #[must_use]
    pub fn resampled_every(self, seconds: [f64; 2]) -> Self {
        Self { resampling: Some(seconds), ..self }
    }

    pub(crate) fn check(&self) -> Result<()> {
        Space::uniform(self.columns.iter().map(String::as_str), [f64::NEG_INFINITY, f64::INFINITY])?;
        match self.resampling {
            Some([low, high]) if !(low.is_finite() && high.is_finite() && 0.0 < low && low <= high) => {
                let field = format!("the resampling time of the command term {:?}", self.name);
                let (value, expected) = (format!("{low} to {high} s"), "it must be above 0 s, in order");
                Err(EnvError::Config { field, value, expected })
            }
            _ => Ok(()),
        }
    }

    /// Draws the numbers of an environment.
    pub(crate) fn sample(&self, rng: &mut EpisodeRng) -> Result<Vec<f64>> {
        let values = guard(TermKind::Command, &self.name, || Ok((self.sample)(rng)))?;
        match values.iter().position(|value| !value.is_finite()) {
            None => Ok(values),
            Some(k) => {
                let column = if self.is_derived() { format!("drawn number {k}") } else { self.columns[k].clone() };
                Err(self.not_finite(rng.env().0, column, values[k]))
            }
        }
    }

    /// Number of steps until the next draw; `u64::MAX` without [`resampled_every`](Self::resampled_every).
    pub(crate) fn steps_to_next_draw(&self, rng: &mut EpisodeRng, step_dt: f64) -> u64 {
        let Some([low, high]) = self.resampling else { return u64::MAX };
        // Times that are a whole number of steps up to rounding are that number.
        const ROUNDING: f64 = 1e-9;
        ((rng.uniform_range(low, high) / step_dt - ROUNDING).ceil() as u64).max(1)
    }

    /// True if values are computed from drawn numbers; else they are the drawn numbers.
    pub(crate) fn is_derived(&self) -> bool {
        self.update.is_some()
    }

    /// Computes the values of a derived command in all environments, and checks those of the environments `envs`. `None`
    /// for other commands.
    pub(crate) fn update(
        &self,
        now: &TermContext<'_>,
        drawn: ArrayView2<'_, f64>,
        envs: &[usize],
    ) -> Result<Option<Array2<f64>>> {
        let Some(update) = &self.update else { return Ok(None) };
        let values = guard(TermKind::Command, &self.name, || update(now, drawn))?;
        let expected = vec![now.num_envs(), self.columns.len()];
        if values.shape() != expected {
            let (what, found) = (TermKind::Command.result_label(&self.name), values.shape().to_vec());
            return Err(EnvError::Shape { what, found, expected, meaning: "environments, columns of the term" });
        }
        for &env in envs {
            if let Some(k) = values.row(env).iter().position(|value| !value.is_finite()) {
                return Err(self.not_finite(env, self.columns[k].clone(), values[(env, k)]));
            }
        }
        Ok(Some(values))
    }

    fn not_finite(&self, env: usize, column: String, value: f64) -> EnvError {
        EnvError::NotFinite { what: format!("the value of the command term {:?}", self.name), env, column, value }
    }
}

impl fmt::Debug for CommandTerm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = f.debug_struct("CommandTerm");
        out.field("name", &self.name).field("columns", &self.columns).field("resampling", &self.resampling);
        out.finish_non_exhaustive()
    }
}

//! Command terms: goals of an episode.

use crate::episode_rng::EpisodeRng;
use crate::error::{EnvError, Result};
use crate::space::Space;
use std::fmt;

type SampleCommand = Box<dyn Fn(&mut EpisodeRng) -> Vec<f64> + Send>;

/// Numbers that are drawn for an environment when an episode begins and stay until it ends, such as a goal position or
/// a target velocity. Other terms read them with [`TermContext::command`](crate::TermContext::command).
pub struct CommandTerm {
    pub(crate) name: String,
    pub(crate) columns: Vec<String>,
    sample: SampleCommand,
}

impl CommandTerm {
    /// Creates a term with named columns. `sample` returns the values for one episode of one environment. A value that
    /// is not finite is an error of the reset or step that begins the episode.
    pub fn new<const K: usize>(
        name: impl Into<String>,
        columns: [&str; K],
        sample: impl Fn(&mut EpisodeRng) -> [f64; K] + Send + 'static,
    ) -> Self {
        let columns = columns.map(String::from).to_vec();
        Self { name: name.into(), columns, sample: Box::new(move |rng| sample(rng).to_vec()) }
    }

    pub(crate) fn check(&self) -> Result<()> {
        Space::uniform(self.columns.iter().map(String::as_str), [f64::NEG_INFINITY, f64::INFINITY]).map(drop)
    }

    /// Draws the values of an episode.
    pub(crate) fn sample(&self, rng: &mut EpisodeRng) -> Result<Vec<f64>> {
        let values = (self.sample)(rng);
        match values.iter().position(|value| !value.is_finite()) {
            None => Ok(values),
            Some(k) => {
                let what = format!("the value of the command term {:?}", self.name);
                let (env, column) = (rng.env().0, self.columns[k].clone());
                Err(EnvError::NotFinite { what, env, column, value: values[k] })
            }
        }
    }
}

impl fmt::Debug for CommandTerm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CommandTerm").field("name", &self.name).field("columns", &self.columns).finish_non_exhaustive()
    }
}

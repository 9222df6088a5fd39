//! Reward terms.

use crate::context::TermContext;
use crate::error::{EnvError, Result, TermKind, TermResult};
use ndarray::Array1;
use std::fmt;

type Reward = Box<dyn Fn(&TermContext<'_>) -> TermResult<Array1<f64>> + Send>;

/// A term of the reward of a step: one number for each environment, times a weight.
///
/// Isaac Lab multiplies its weights by the duration of a step. To port a weight from there, multiply it by
/// [`Env::step_dt`](crate::Env::step_dt).
pub struct RewardTerm {
    pub(crate) name: String,
    pub(crate) weight: f64,
    reward: Reward,
}

impl RewardTerm {
    /// Creates the term `weight * reward`; `reward` returns one number for each environment, shape (N,).
    pub fn new(
        name: impl Into<String>,
        weight: f64,
        reward: impl Fn(&TermContext<'_>) -> TermResult<Array1<f64>> + Send + 'static,
    ) -> Self {
        Self { name: name.into(), weight, reward: Box::new(reward) }
    }

    pub(crate) fn check(&self) -> Result<()> {
        if self.weight.is_finite() {
            return Ok(());
        }
        let field = format!("the weight of the reward term {:?}", self.name);
        Err(EnvError::Config { field, value: self.weight.to_string(), expected: "it must be finite" })
    }

    /// Computes the weighted rewards of all environments, shape (N,); 0 where `is_counted` is false.
    pub(crate) fn rewards(&self, now: &TermContext<'_>, is_counted: impl Fn(usize) -> bool) -> Result<Array1<f64>> {
        let mut rewards = now.compute_per_env(TermKind::Reward, &self.name, || (self.reward)(now))?;
        rewards.indexed_iter_mut().for_each(|(env, value)| {
            *value = if is_counted(env) { self.weight * *value } else { 0.0 };
        });
        if let Some((env, &value)) = rewards.indexed_iter().find(|(_, value)| !value.is_finite()) {
            let what = TermKind::Reward.result_label(&self.name);
            return Err(EnvError::NotFinite { what, env, column: self.name.clone(), value });
        }
        Ok(rewards)
    }
}

impl fmt::Debug for RewardTerm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RewardTerm").field("name", &self.name).field("weight", &self.weight).finish_non_exhaustive()
    }
}

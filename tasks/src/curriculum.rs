//! Curriculum terms: a number for each environment that changes with the success of its episodes.

use crate::context::TermContext;
use crate::episode_rng::EpisodeRng;
use crate::error::{EnvError, Result, TermKind, TermResult};
use crate::guard::guard;
use ndarray::ArrayView1;
use std::fmt;

type Initial = Box<dyn Fn(&mut EpisodeRng) -> f64 + Send>;
type Advance = Box<dyn Fn(&TermContext<'_>, &mut [EpisodeRng], ArrayView1<'_, f64>) -> TermResult<Vec<f64>> + Send>;

/// A number for each environment that stays from episode to episode and changes when one ends, such as the level of a
/// terrain. Terms read it with [`TermContext::curriculum`], events with
/// [`EventContext::curriculum`](crate::EventContext::curriculum).
///
/// The number of an environment should depend on its own episodes only. Then a task with eight environments gives the
/// same bits as two with four.
pub struct CurriculumTerm {
    pub(crate) name: String,
    initial: Initial,
    advance: Advance,
}

impl CurriculumTerm {
    /// Creates a term.
    ///
    /// `initial` returns the number of an environment when the task is built, and after a reset with a seed. `advance`
    /// is called in each step in which episodes end, before any environment is reset. It gets the state of all
    /// environments, a random number generator for each one whose episode ended, and the numbers of all environments.
    /// It returns the new numbers of the environments of the generators, in their order.
    ///
    /// An episode that a reset from outside the task or a reset by the program cuts off is not an ended one.
    pub fn new(
        name: impl Into<String>,
        initial: impl Fn(&mut EpisodeRng) -> f64 + Send + 'static,
        advance: impl Fn(&TermContext<'_>, &mut [EpisodeRng], ArrayView1<'_, f64>) -> TermResult<Vec<f64>> + Send + 'static,
    ) -> Self {
        Self { name: name.into(), initial: Box::new(initial), advance: Box::new(advance) }
    }

    /// Returns the number at the start.
    pub(crate) fn initial(&self, rng: &mut EpisodeRng) -> Result<f64> {
        let value = guard(TermKind::Curriculum, &self.name, || Ok((self.initial)(rng)))?;
        self.check(rng.env().0, value)
    }

    /// Returns the numbers after the end of the episodes of `rngs`.
    pub(crate) fn advance(
        &self,
        now: &TermContext<'_>,
        rngs: &mut [EpisodeRng],
        values: ArrayView1<'_, f64>,
    ) -> Result<Vec<f64>> {
        let next = guard(TermKind::Curriculum, &self.name, || (self.advance)(now, rngs, values))?;
        if next.len() != rngs.len() {
            let (what, found, expected) =
                (TermKind::Curriculum.result_label(&self.name), vec![next.len()], vec![rngs.len()]);
            return Err(EnvError::Shape { what, found, expected, meaning: "environments whose episode ended" });
        }
        next.into_iter().zip(rngs).map(|(value, rng)| self.check(rng.env().0, value)).collect()
    }

    pub(crate) fn check(&self, env: usize, value: f64) -> Result<f64> {
        if value.is_finite() {
            return Ok(value);
        }
        let what = TermKind::Curriculum.result_label(&self.name);
        Err(EnvError::NotFinite { what, env, column: self.name.clone(), value })
    }
}

impl fmt::Debug for CurriculumTerm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CurriculumTerm").field("name", &self.name).finish_non_exhaustive()
    }
}

//! What terms see.

use crate::error::{EnvError, Result, TermKind, TermResult};
use kinetoscope_sim::SimulationManager;
use ndarray::{Array1, Array2, ArrayView2};

/// The present of all environments: what functions of terms look at.
#[derive(Clone, Copy, Debug)]
pub struct Now<'e> {
    present: &'e Present,
}

/// The simulation, and what a task knows beside it.
#[derive(Debug)]
pub(crate) struct Present {
    pub(crate) sim: SimulationManager,
    /// The last actions, within their bounds, shape (N, action columns).
    pub(crate) actions: Array2<f64>,
    /// Those before.
    pub(crate) previous: Array2<f64>,
    /// Steps of each episode so far.
    pub(crate) steps: Vec<u64>,
    /// Name and values of each command term.
    pub(crate) commands: Vec<(String, Array2<f64>)>,
}

impl Present {
    pub(crate) fn now(&self) -> Now<'_> {
        Now { present: self }
    }
}

impl<'e> Now<'e> {
    /// The simulation.
    pub fn sim(&self) -> &'e SimulationManager {
        &self.present.sim
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.present.sim.num_envs()
    }

    /// Actions of the last step, within their bounds, shape (N, columns of [`Env::action_space`](crate::Env::action_space));
    /// 0 at the start of an episode.
    pub fn actions(&self) -> ArrayView2<'e, f64> {
        self.present.actions.view()
    }

    /// Actions of the step before the last one, shaped as [`actions`](Self::actions); 0 where there was none.
    pub fn previous_actions(&self) -> ArrayView2<'e, f64> {
        self.present.previous.view()
    }

    /// Steps of the environment's episode so far, the present one included, shape (N,).
    pub fn episode_steps(&self) -> &'e [u64] {
        &self.present.steps
    }

    /// What the command term called `name` wants of each environment, shape (N, columns of the term).
    ///
    /// # Errors
    /// There is no such term; the error lists those there are.
    pub fn command(&self, name: &str) -> Result<ArrayView2<'e, f64>> {
        let commands = &self.present.commands;
        let found = commands.iter().find(|(of, _)| of == name);
        found
            .map(|(_, values)| values.view())
            .ok_or_else(|| EnvError::unknown("command", name, commands.iter().map(|(of, _)| of.as_str())))
    }

    /// What the function of a term gave, which is a number for each environment.
    pub(crate) fn for_each_env<T>(
        &self,
        kind: TermKind,
        name: &str,
        given: TermResult<Array1<T>>,
    ) -> Result<Array1<T>> {
        let given = given.map_err(|error| EnvError::term(kind, name, error))?;
        if given.len() == self.num_envs() {
            return Ok(given);
        }
        let (found, expected) = (vec![given.len()], vec![self.num_envs()]);
        Err(EnvError::Shape { what: kind.gives(name), found, expected, meaning: "environments" })
    }
}

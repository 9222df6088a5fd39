//! The context that is passed to terms.

use crate::error::{EnvError, Result, TermKind, TermResult};
use crate::guard::guard;
use kinetoscope_sim::SimulationManager;
use ndarray::{Array1, Array2, ArrayView1, ArrayView2};

/// Read access to the simulation and the task state of all environments, for the functions of terms.
#[derive(Clone, Copy, Debug)]
pub struct TermContext<'e> {
    state: &'e TaskState,
}

/// The simulation and the state of a task outside it.
#[derive(Debug)]
pub(crate) struct TaskState {
    pub(crate) sim: SimulationManager,
    /// Actions of the step in progress or of the last step, within their bounds, shape (N, action columns).
    pub(crate) actions: Array2<f64>,
    /// Actions of the step before that of `actions`, shape (N, action columns).
    pub(crate) previous_actions: Array2<f64>,
    /// Number of task steps of each episode so far.
    pub(crate) episode_steps: Vec<u64>,
    /// Numbers of each command term.
    pub(crate) commands: Vec<CommandState>,
    /// Name and numbers of each curriculum term, shape (N,).
    pub(crate) curricula: Vec<(String, Array1<f64>)>,
}

/// Numbers of a command term.
#[derive(Debug)]
pub(crate) struct CommandState {
    pub(crate) name: String,
    /// Drawn numbers, shape (N, drawn numbers).
    pub(crate) drawn: Array2<f64>,
    /// Values that other terms read, shape (N, columns).
    pub(crate) values: Array2<f64>,
}

impl TaskState {
    pub(crate) fn context(&self) -> TermContext<'_> {
        TermContext { state: self }
    }

    fn command(&self, name: &str) -> Result<ArrayView2<'_, f64>> {
        let found = self.commands.iter().find(|command| command.name == name);
        let names = || self.commands.iter().map(|command| command.name.as_str());
        found.map(|command| command.values.view()).ok_or_else(|| EnvError::unknown("command", name, names()))
    }

    fn curriculum(&self, name: &str) -> Result<ArrayView1<'_, f64>> {
        let found = self.curricula.iter().find(|(of, _)| of == name);
        let names = || self.curricula.iter().map(|(of, _)| of.as_str());
        found.map(|(_, values)| values.view()).ok_or_else(|| EnvError::unknown("curriculum", name, names()))
    }
}

/// Access of an event to the simulation, which it changes, and to the state of the task, which it reads.
#[derive(Debug)]
pub struct EventContext<'e> {
    pub(crate) state: &'e mut TaskState,
}

impl EventContext<'_> {
    /// Read access to the simulation.
    pub fn sim(&self) -> &SimulationManager {
        &self.state.sim
    }

    /// The simulation, to change it in the environments of the event.
    pub fn sim_mut(&mut self) -> &mut SimulationManager {
        &mut self.state.sim
    }

    /// Values of the command term called `name`, shape (N, columns of the term). A reset event gets the new numbers of
    /// the episode; those of a [derived](crate::CommandTerm::derived) command are still the old ones.
    ///
    /// # Errors
    /// There is no command term of this name; the error lists the existing ones, the nearest first.
    pub fn command(&self, name: &str) -> Result<ArrayView2<'_, f64>> {
        self.state.command(name)
    }

    /// Numbers of the curriculum term called `name`, shape (N,).
    ///
    /// # Errors
    /// There is no curriculum term of this name; the error lists the existing ones, the nearest first.
    pub fn curriculum(&self, name: &str) -> Result<ArrayView1<'_, f64>> {
        self.state.curriculum(name)
    }
}

impl<'e> TermContext<'e> {
    /// Read access to the simulation, in the state at which the term is evaluated.
    pub fn sim(&self) -> &'e SimulationManager {
        &self.state.sim
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.state.sim.num_envs()
    }

    /// Actions of the step in progress, or of the last step between steps, clamped to their bounds, shape (N, columns
    /// of [`Env::action_space`](crate::Env::action_space)); 0 at the start of an episode.
    pub fn actions(&self) -> ArrayView2<'e, f64> {
        self.state.actions.view()
    }

    /// Actions of the step before that of [`actions`](Self::actions), in the same shape; 0 if the episode had no such
    /// step.
    pub fn previous_actions(&self) -> ArrayView2<'e, f64> {
        self.state.previous_actions.view()
    }

    /// Number of steps of each environment's episode so far, including the step in progress, shape (N,); 0 at the start
    /// of an episode.
    pub fn episode_steps(&self) -> &'e [u64] {
        &self.state.episode_steps
    }

    /// Values of the command term called `name`, shape (N, columns of the term); 0 before the first reset.
    ///
    /// # Errors
    /// There is no command term of this name; the error lists the existing ones, the nearest first.
    pub fn command(&self, name: &str) -> Result<ArrayView2<'e, f64>> {
        self.state.command(name)
    }

    /// Numbers of the curriculum term called `name`, shape (N,).
    ///
    /// # Errors
    /// There is no curriculum term of this name; the error lists the existing ones, the nearest first.
    pub fn curriculum(&self, name: &str) -> Result<ArrayView1<'e, f64>> {
        self.state.curriculum(name)
    }

    /// Calls a term's function and checks its result, which must have shape (N,).
    pub(crate) fn compute_per_env<T>(
        &self,
        kind: TermKind,
        name: &str,
        compute: impl FnOnce() -> TermResult<Array1<T>>,
    ) -> Result<Array1<T>> {
        let given = guard(kind, name, compute)?;
        if given.len() == self.num_envs() {
            return Ok(given);
        }
        let (found, expected) = (vec![given.len()], vec![self.num_envs()]);
        Err(EnvError::Shape { what: kind.result_label(name), found, expected, meaning: "environments" })
    }
}

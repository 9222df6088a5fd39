//! The context that is passed to terms.

use crate::error::{EnvError, Result, TermKind, TermResult};
use crate::guard::guard;
use crate::robot_cache::RobotCache;
use kinetoscope_sim::{RobotId, RobotState, SimulationManager};
use ndarray::{Array1, Array2, ArrayView1, ArrayView2};

/// Read access to the simulation and the task state of all environments, for the functions of terms.
#[derive(Clone, Copy, Debug)]
pub struct TermContext<'e> {
    state: &'e TaskState,
}

/// The simulation and the state of a task outside it.
#[derive(Debug)]
pub(crate) struct TaskState {
    /// Changed through [`sim_mut`](Self::sim_mut) only, which clears `robots`.
    sim: SimulationManager,
    robots: RobotCache,
    /// Physics steps of a task step.
    decimation: u32,
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
    /// Creates the state before the first reset, without commands and curricula.
    pub(crate) fn new(sim: SimulationManager, decimation: u32, action_columns: usize) -> Self {
        let n = sim.num_envs();
        Self {
            sim,
            decimation,
            robots: RobotCache::default(),
            actions: Array2::zeros((n, action_columns)),
            previous_actions: Array2::zeros((n, action_columns)),
            episode_steps: vec![0; n],
            commands: Vec::new(),
            curricula: Vec::new(),
        }
    }

    /// Duration of a task step \[s\].
    pub(crate) fn step_dt(&self) -> f64 {
        f64::from(self.decimation) * self.sim.cfg().physics_dt
    }

    /// Read access to the simulation.
    pub(crate) fn sim(&self) -> &SimulationManager {
        &self.sim
    }

    /// The simulation, to change it.
    pub(crate) fn sim_mut(&mut self) -> &mut SimulationManager {
        self.robots.clear();
        &mut self.sim
    }

    /// The simulation, to change it, and the actions.
    pub(crate) fn sim_and_actions(&mut self) -> (&mut SimulationManager, ArrayView2<'_, f64>) {
        self.robots.clear();
        (&mut self.sim, self.actions.view())
    }

    pub(crate) fn into_sim(self) -> SimulationManager {
        self.sim
    }

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
        self.state.sim_mut()
    }

    /// Present state of a robot in all environments; see [`TermContext::robot`].
    ///
    /// # Panics
    /// The robot belongs to another manager.
    pub fn robot(&self, robot: RobotId) -> &RobotState {
        self.state.robots.get(&self.state.sim, robot)
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

    /// State of a robot in all environments. It is gathered when the first term reads it, and shared by all terms until
    /// the simulation changes: prefer it to the methods of [`Robot`](kinetoscope_sim::Robot), which gather at every
    /// call.
    ///
    /// # Panics
    /// The robot belongs to another manager.
    pub fn robot(&self, robot: RobotId) -> &'e RobotState {
        self.state.robots.get(&self.state.sim, robot)
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.state.sim.num_envs()
    }

    /// Duration of a task step \[s\].
    pub fn step_dt(&self) -> f64 {
        self.state.step_dt()
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

//! The batch of environments of a task: [`Env`].

use crate::builder::Terms;
use crate::cfg::EnvCfg;
use crate::command::CommandTerm;
use crate::context::{CommandState, TaskState, TermContext};
use crate::episode_rng::EpisodeKey;
use crate::error::{EnvError, Result};
use crate::event::EventMode;
use crate::group::{GroupBuffers, ObservationGroup};
use crate::reset_monitor::ResetMonitor;
use crate::space::Space;
use kinetoscope_sim::{ObserverId, SimulationManager};
use ndarray::{Array1, Array2, ArrayView2};

/// A batch of environments with a task, made of terms by an [`EnvBuilder`](crate::EnvBuilder).
///
/// Call [`reset`](Self::reset) before the first [`step`](Self::step). A step does the following, in this order. Isaac
/// Lab has the same order, except that it resets before interval events and has no final observations.
///
/// 1. Clamp the actions to their bounds, apply them, and do [`EnvCfg::decimation`] physics steps.
/// 2. Count the step, and find the episodes that end and the reason of each.
/// 3. Compute the rewards. Publish rewards and ends to the observers of the simulation ([`StepResult`](kinetoscope_sim::StepResult)).
/// 4. Run the due [`EventMode::Interval`] events in environments whose episode goes on. Update the curricula of
///    environments whose episode ended. Draw the due commands in the environments whose episode goes on.
/// 5. Compute derived commands and the observations, which include the final ones of the episodes that ended.
/// 6. Reset the environments whose episode ended to the initial state, draw new commands, run the [`EventMode::Reset`]
///    events, and observe these environments again.
///
/// This is the order of [`AutoresetMode::SameStep`](crate::AutoresetMode::SameStep), in which no step is spent on a reset alone. In
/// [`AutoresetMode::NextStep`](crate::AutoresetMode::NextStep), point 6 comes before point 5, in the environments whose episode ended in the step before.
/// In [`AutoresetMode::Disabled`](crate::AutoresetMode::Disabled) there is no point 6.
pub struct Env {
    pub(crate) state: TaskState,
    pub(crate) cfg: EnvCfg,
    pub(crate) terms: Terms,
    pub(crate) action_space: Space,
    pub(crate) episodes: Vec<EpisodeState>,
    /// Sums of the weighted rewards of each episode, shape (N, reward terms).
    pub(crate) reward_sums: Array2<f64>,
    /// The latest observations of each group.
    pub(crate) buffers: Vec<GroupBuffers>,
    /// Records which environments were reset, with its id in the simulation.
    pub(crate) reset_monitor: (ResetMonitor, ObserverId<ResetMonitor>),
}

/// State of one environment outside the simulation.
#[derive(Debug)]
pub(crate) struct EpisodeState {
    pub(crate) key: EpisodeKey,
    /// Number of the next episode.
    pub(crate) next_episode: u64,
    pub(crate) phase: Phase,
    /// Episode step at which each command is drawn next.
    pub(crate) next_command_steps: Vec<u64>,
    /// Episode step at which each event is due next; unused for events without an interval.
    pub(crate) next_event_steps: Vec<u64>,
}

/// Phase of an environment between two steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    /// The environment was never reset, or its last reset or the last step failed.
    NoEpisode,
    /// Its episode goes on.
    Running,
    /// Its episode ended, and no other one has begun.
    Ended,
}

impl std::fmt::Debug for Env {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Env").field("cfg", &self.cfg).field("terms", &self.terms).finish_non_exhaustive()
    }
}

/// Accessors.
impl Env {
    /// Read access to the simulation in its current state: after the last step, including the resets of episodes that
    /// ended in it.
    pub fn sim(&self) -> &SimulationManager {
        self.state.sim()
    }

    /// The simulation, to serve, record or change it between steps.
    ///
    /// The next step starts from a state that is written to it. If it is reset, by the caller or by a viewer, the next
    /// step ends the episode ([`EndReason::Reset`](crate::EndReason::Reset)), and a new one begins as
    /// [`EnvCfg::autoreset`] says. To begin a new episode at once, call [`reset`](Self::reset).
    pub fn sim_mut(&mut self) -> &mut SimulationManager {
        self.state.sim_mut()
    }

    /// Returns the simulation in its current state: after the last step, including the resets of episodes that ended in
    /// it.
    pub fn into_sim(self) -> SimulationManager {
        let (mut sim, (_, id)) = (self.state.into_sim(), self.reset_monitor);
        // The caller may have swapped the simulation through `sim_mut`. Then it lacks this observer.
        if sim.observers().contains(id) {
            let _ = sim.observers_mut().remove(id);
        }
        sim
    }

    /// Returns the context that terms would get now, between steps.
    pub fn context(&self) -> TermContext<'_> {
        self.state.context()
    }

    /// Configuration of the task: lengths of steps and episodes.
    pub fn cfg(&self) -> &EnvCfg {
        &self.cfg
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.episodes.len()
    }

    /// Duration of a task step \[s\]: `decimation` times the physics time step.
    pub fn step_dt(&self) -> f64 {
        self.state.step_dt()
    }

    /// Columns of the observations in the group [`POLICY_GROUP`](crate::POLICY_GROUP), named `term/column`, with the
    /// bounds of the clip after scaling. Columns of a term without a clip are unbounded.
    pub fn observation_space(&self) -> &Space {
        &self.terms.groups[0].space
    }

    /// Columns of the actions, named `term/column`, with the bounds to which actions are clamped.
    pub fn action_space(&self) -> &Space {
        &self.action_space
    }

    /// Names of the reward terms, in the order in which they were added.
    pub fn reward_names(&self) -> Vec<&str> {
        self.terms.rewards.iter().map(|term| term.name.as_str()).collect()
    }

    /// The observation group called `name`, with its latest observations and images.
    ///
    /// # Errors
    /// There is no such group; the error lists the existing ones.
    pub fn group(&self, name: &str) -> Result<ObservationGroup<'_>> {
        let names = || self.terms.groups.iter().map(|group| group.name.as_str());
        let index = names().position(|of| of == name);
        let index = index.ok_or_else(|| EnvError::unknown("observation group", name, names()))?;
        Ok(ObservationGroup::new(&self.terms.groups[index], &self.buffers[index]))
    }

    /// The observation groups, [`POLICY_GROUP`](crate::POLICY_GROUP) first, then in the order in which they were added.
    pub fn groups(&self) -> impl Iterator<Item = ObservationGroup<'_>> {
        self.terms.groups.iter().zip(&self.buffers).map(|(group, buffers)| ObservationGroup::new(group, buffers))
    }

    /// Names of the curriculum terms, in the order in which they were added.
    pub fn curriculum_names(&self) -> Vec<&str> {
        self.terms.curricula.iter().map(|term| term.name.as_str()).collect()
    }

    /// Sets the numbers of the curriculum term called `name`, shape (N,): those that
    /// [`TermContext::curriculum`] returned in an earlier run, to continue it. Terms read them from now on, reset
    /// events from the next reset on.
    ///
    /// # Errors
    /// There is no such term, the array has another length than N, or a number is not finite. Nothing is changed then.
    pub fn set_curriculum(&mut self, name: &str, values: &[f64]) -> Result<()> {
        let n = self.num_envs();
        self.state.context().curriculum(name)?;
        if values.len() != n {
            let (what, found, expected) = (format!("the curriculum {name:?}"), vec![values.len()], vec![n]);
            return Err(EnvError::Shape { what, found, expected, meaning: "environments" });
        }
        for (term, (_, own)) in self.terms.curricula.iter().zip(&mut self.state.curricula) {
            if term.name == name {
                values.iter().enumerate().try_for_each(|(env, &value)| term.check(env, value).map(drop))?;
                own.iter_mut().zip(values).for_each(|(own, value)| *own = *value);
            }
        }
        Ok(())
    }

    /// The latest observations in the group [`POLICY_GROUP`](crate::POLICY_GROUP), with noise, clip and scale, shape (N,
    /// columns of [`observation_space`](Self::observation_space)); zeros before the first reset.
    pub fn observations(&self) -> ArrayView2<'_, f64> {
        self.buffers[0].values().view()
    }
}

/// Resets.
impl Env {
    /// Creates the environments from checked terms.
    pub(crate) fn new(mut sim: SimulationManager, cfg: EnvCfg, terms: Terms, action_space: Space) -> Result<Self> {
        let (n, seed, first) = (sim.num_envs(), sim.cfg().seed, sim.cfg().first_env());
        let row = |env: usize| {
            let key = EpisodeKey { seed, global_env: first + env, episode: 0 };
            EpisodeState {
                key,
                next_episode: 0,
                phase: Phase::NoEpisode,
                next_command_steps: vec![u64::MAX; terms.commands.len()],
                next_event_steps: vec![0; terms.events.len()],
            }
        };
        let command = |term: &CommandTerm| CommandState {
            name: term.name.clone(),
            drawn: Array2::zeros((n, term.drawn)),
            values: Array2::zeros((n, term.columns.len())),
        };
        let watch = ResetMonitor::new(n);
        let reset_monitor = (watch.clone(), sim.observers_mut().add(watch));
        let mut state = TaskState::new(sim, cfg.decimation, action_space.len());
        state.commands = terms.commands.iter().map(command).collect();
        state.curricula = terms.curricula.iter().map(|term| (term.name.clone(), Array1::zeros(n))).collect();
        let mut env = Self {
            reset_monitor,
            episodes: (0..n).map(row).collect(),
            reward_sums: Array2::zeros((n, terms.rewards.len())),
            buffers: terms.groups.iter().map(|group| GroupBuffers::new(group, n)).collect(),
            state,
            cfg,
            terms,
            action_space,
        };
        let all: Vec<usize> = (0..n).collect();
        env.begin_curricula(&all)?;
        env.run_events(&all, |when| when == EventMode::Startup, |event| format!("event/{event}"))?;
        Ok(env)
    }

    /// Begins new episodes where `mask` is true (everywhere if it is `None`), and returns the observations of all
    /// environments, shape (N, columns of [`observation_space`](Self::observation_space)).
    ///
    /// Other environments continue their episodes unchanged. With a `seed`, the random numbers of the reset
    /// environments and their curricula restart: the same seed gives the same episodes. Without a seed they continue, as
    /// at the automatic resets. The initial seed is the simulation's. The noise of sensors and of
    /// [`randomize`](kinetoscope_sim::EnvPropertiesMut::randomize) depends on the simulation's seed only.
    ///
    /// Properties such as masses and gains keep the values that events gave them. An event that changes a property at a
    /// reset should therefore set it, and not scale the value that it finds.
    ///
    /// # Errors
    /// The mask has another length than N, or a term fails. After a failed term these environments have no episode
    /// until they are reset.
    pub fn reset(&mut self, mask: Option<&[bool]>, seed: Option<u64>) -> Result<Array2<f64>> {
        let n = self.num_envs();
        if let Some(mask) = mask.filter(|mask| mask.len() != n) {
            let (what, found, expected) = ("the mask".into(), vec![mask.len()], vec![n]);
            return Err(EnvError::Shape { what, found, expected, meaning: "environments" });
        }
        let envs: Vec<usize> = (0..n).filter(|&env| mask.is_none_or(|mask| mask[env])).collect();
        for &env in &envs {
            let row = &mut self.episodes[env];
            row.phase = Phase::NoEpisode;
            if let Some(seed) = seed {
                row.key.seed = seed;
                row.next_episode = 0;
            }
        }
        if seed.is_some() {
            self.begin_curricula(&envs)?;
        }
        self.begin_episodes(&envs)?;
        self.observe(&envs)?;
        self.buffers.iter_mut().for_each(|buffers| buffers.set_final(false));
        envs.iter().for_each(|&env| self.episodes[env].phase = Phase::Running);
        Ok(self.buffers[0].values().clone())
    }
}

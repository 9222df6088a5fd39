//! The batch of environments of a task: [`Env`].

use crate::autoreset::AutoresetMode;
use crate::builder::Terms;
use crate::cfg::EnvCfg;
use crate::context::{TaskState, TermContext};
use crate::episode_rng::{EpisodeKey, EpisodeRng};
use crate::error::{EnvError, Result, TermKind};
use crate::event::EventMode;
use crate::reset_monitor::ResetMonitor;
use crate::space::Space;
use crate::step::{EndReason, EndedEpisode, Step, StepInfo};
use kinetoscope_scene::KeyedRng;
use kinetoscope_sim::{EnvId, ObserverId, SimulationManager, StepResult};
use ndarray::{Array1, Array2, ArrayView2, AsArray, Axis, Ix2, Slice};

/// A batch of environments with a task, made of terms by an [`EnvBuilder`](crate::EnvBuilder).
///
/// Call [`reset`](Self::reset) before the first [`step`](Self::step). A step does the following, in this order. Isaac
/// Lab has the same order, except that it resets before interval events and has no final observations.
///
/// 1. Clamp the actions to their bounds, apply them, and do [`EnvCfg::decimation`] physics steps.
/// 2. Count the step, and find the episodes that end and the reason of each.
/// 3. Compute the rewards. Publish rewards and ends to the observers of the simulation ([`StepResult`]).
/// 4. Run the due [`EventMode::Interval`] events in environments whose episode goes on.
/// 5. Compute the observations, which include the final ones of the episodes that ended.
/// 6. Reset the environments whose episode ended to the initial state, draw new commands, run the [`EventMode::Reset`]
///    events, and observe these environments again.
///
/// This is the order of [`AutoresetMode::SameStep`], in which no step is spent on a reset alone. In
/// [`AutoresetMode::NextStep`], point 6 comes before point 5, in the environments whose episode ended in the step before.
/// In [`AutoresetMode::Disabled`] there is no point 6.
pub struct Env {
    state: TaskState,
    cfg: EnvCfg,
    terms: Terms,
    observation_space: Space,
    action_space: Space,
    episodes: Vec<EpisodeState>,
    /// Sums of the weighted rewards of each episode, shape (N, reward terms).
    reward_sums: Array2<f64>,
    /// The latest observations, shape (N, observation columns).
    observations: Array2<f64>,
    /// Records which environments were reset, with its id in the simulation.
    reset_monitor: (ResetMonitor, ObserverId<ResetMonitor>),
}

/// State of one environment outside the simulation.
#[derive(Debug)]
struct EpisodeState {
    key: EpisodeKey,
    /// Number of the next episode.
    next_episode: u64,
    phase: Phase,
    /// Noise generator of each observation term.
    noise_rngs: Vec<KeyedRng>,
    /// Episode step at which each event is due next; unused for events without an interval.
    next_event_steps: Vec<u64>,
}

/// Phase of an environment between two steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
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
        &self.state.sim
    }

    /// The simulation, to serve, record or change it between steps.
    ///
    /// The next step starts from a state that is written here. If the simulation is reset here or by a viewer, the next
    /// step ends the episode ([`EndReason::Reset`]) and begins a new one. To begin a new episode at once, call
    /// [`reset`](Self::reset).
    pub fn sim_mut(&mut self) -> &mut SimulationManager {
        &mut self.state.sim
    }

    /// Returns the simulation in its current state: after the last step, including the resets of episodes that ended in
    /// it.
    pub fn into_sim(self) -> SimulationManager {
        let (mut sim, (_, id)) = (self.state.sim, self.reset_monitor);
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
        f64::from(self.cfg.decimation) * self.state.sim.cfg().physics_dt
    }

    /// Columns of the observations, named `term/column`, with the bounds of the clip after scaling. Columns of a term
    /// without a clip are unbounded.
    pub fn observation_space(&self) -> &Space {
        &self.observation_space
    }

    /// Columns of the actions, named `term/column`, with the bounds to which actions are clamped.
    pub fn action_space(&self) -> &Space {
        &self.action_space
    }

    /// Names of the reward terms, in the order in which they were added.
    pub fn reward_names(&self) -> Vec<&str> {
        self.terms.rewards.iter().map(|term| term.name.as_str()).collect()
    }

    /// The latest observations, with noise, clip and scale, shape (N, columns of
    /// [`observation_space`](Self::observation_space)); zeros before the first reset.
    pub fn observations(&self) -> ArrayView2<'_, f64> {
        self.observations.view()
    }
}

/// Resets and steps.
impl Env {
    /// Creates the environments from checked terms. `spaces` are those of the observations and of the actions.
    pub(crate) fn new(mut sim: SimulationManager, cfg: EnvCfg, terms: Terms, spaces: [Space; 2]) -> Result<Self> {
        let [observation_space, action_space] = spaces;
        let (n, seed, first) = (sim.num_envs(), sim.cfg().seed, sim.cfg().first_env());
        let row = |env: usize| {
            let key = EpisodeKey { seed, global_env: first + env, episode: 0 };
            EpisodeState {
                key,
                next_episode: 0,
                phase: Phase::NoEpisode,
                noise_rngs: Vec::new(),
                next_event_steps: vec![0; terms.events.len()],
            }
        };
        let actions = Array2::zeros((n, action_space.len()));
        let commands = terms.commands.iter();
        let commands = commands.map(|term| (term.name.clone(), Array2::zeros((n, term.columns.len())))).collect();
        let previous_actions = actions.clone();
        let watch = ResetMonitor::new(n);
        let mut env = Self {
            reset_monitor: (watch.clone(), sim.observers_mut().add(watch)),
            episodes: (0..n).map(row).collect(),
            reward_sums: Array2::zeros((n, terms.rewards.len())),
            observations: Array2::zeros((n, observation_space.len())),
            state: TaskState { sim, actions, previous_actions, episode_steps: vec![0; n], commands },
            cfg,
            terms,
            observation_space,
            action_space,
        };
        let all: Vec<usize> = (0..n).collect();
        env.run_events(&all, |when| when == EventMode::Startup, |event| format!("event/{event}"))?;
        Ok(env)
    }

    /// Begins new episodes where `mask` is true (everywhere if it is `None`), and returns the observations of all
    /// environments, shape (N, columns of [`observation_space`](Self::observation_space)).
    ///
    /// Other environments continue their episodes unchanged. With a `seed`, the random numbers of the reset
    /// environments restart: the same seed gives the same episodes. Without a seed they continue, as at the automatic
    /// resets. The initial seed is the simulation's. The noise of sensors and of
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
        self.begin_episodes(&envs)?;
        self.observations = self.observe(&envs)?;
        envs.iter().for_each(|&env| self.episodes[env].phase = Phase::Running);
        Ok(self.observations.clone())
    }

    /// Does one step in all environments.
    ///
    /// `actions` has shape (N, columns of [`action_space`](Self::action_space)). Actions beyond their bounds are
    /// clamped.
    ///
    /// If the physics of an environment diverges, its episode terminates with [`EndReason::Diverged`]. Its final
    /// observation and reward are those of its last good state. Other environments are not affected.
    ///
    /// # Errors
    /// - The actions have another shape or are not finite, or an environment has no episode. Nothing was done then.
    ///   Actions that [`AutoresetMode::NextStep`] ignores may be any number.
    /// - A term fails, or returns an array of another shape or a number that is not finite. The step is then incomplete
    ///   and every environment has to be reset.
    pub fn step<'a>(&mut self, actions: impl AsArray<'a, f64, Ix2>) -> Result<Step> {
        let actions = self.clamp_actions(actions.into())?;
        if let Some(env) = self.episodes.iter().position(|row| row.phase == Phase::NoEpisode) {
            return Err(EnvError::ResetFirst { env });
        }
        if self.cfg.autoreset == AutoresetMode::Disabled
            && let Some(env) = self.episodes.iter().position(|row| row.phase == Phase::Ended)
        {
            return Err(EnvError::EpisodeEnded { env });
        }
        let step = self.advance(actions);
        if step.is_err() {
            self.episodes.iter_mut().for_each(|row| row.phase = Phase::NoEpisode);
        }
        step
    }

    fn clamp_actions(&self, actions: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        let (found, expected) = (actions.shape().to_vec(), vec![self.num_envs(), self.action_space.len()]);
        if found != expected {
            let what = "the action array".into();
            return Err(EnvError::Shape {
                what,
                found,
                expected,
                meaning: "environments, columns of the action space",
            });
        }
        let is_wrong = |env: usize, value: f64| !value.is_finite() && self.episodes[env].phase != Phase::Ended;
        if let Some(((env, k), &value)) = actions.indexed_iter().find(|((env, _), value)| is_wrong(*env, **value)) {
            let column = self.action_space.names()[k].clone();
            return Err(EnvError::NotFinite { what: "the action".into(), env, column, value });
        }
        let used =
            |env: usize, k: usize| if self.episodes[env].phase == Phase::Ended { 0.0 } else { actions[(env, k)] };
        Ok(Array2::from_shape_fn(actions.dim(), |(env, k)| self.action_space.clamp(k, used(env, k))))
    }

    fn advance(&mut self, actions: Array2<f64>) -> Result<Step> {
        let n = self.num_envs();
        // Environments that only begin an episode in this step, in the mode `NextStep`. They take part in the physics
        // steps like the others, and are reset afterwards.
        let beginning: Vec<usize> = (0..n).filter(|&env| self.episodes[env].phase == Phase::Ended).collect();
        self.state.previous_actions = std::mem::replace(&mut self.state.actions, actions);
        self.apply_actions()?;
        self.state.episode_steps.iter_mut().for_each(|steps| *steps += 1);
        let (terminated, truncated, reasons) = self.check_terminations()?;
        let reward_terms = self.compute_rewards()?;
        self.reward_sums += &reward_terms;
        // Sums in the order of the terms.
        let rewards = reward_terms.map_axis(Axis(1), |terms| terms.iter().fold(0.0, |sum, reward| sum + reward));
        let result =
            StepResult { rewards: rewards.clone(), terminated: terminated.clone(), truncated: truncated.clone() };
        result.publish(&mut self.state.sim)?;
        let is_running = |env: &usize| self.episodes[*env].phase == Phase::Running && reasons[*env].is_none();
        let going_on: Vec<usize> = (0..n).filter(is_running).collect();
        self.run_interval_events(&going_on)?;
        let mut ended: Vec<EndedEpisode> = Vec::new();
        for (env, reason) in reasons.into_iter().enumerate() {
            if let Some(reason) = reason {
                let (steps, reward_sums) = (self.state.episode_steps[env], self.reward_sums.row(env).to_vec());
                ended.push(EndedEpisode { env: EnvId(env), reason, steps, reward_sums });
            }
        }
        self.begin_episodes(&beginning)?;
        let all: Vec<usize> = (0..n).collect();
        let final_observations = self.observe(&all)?;
        self.observations = final_observations.clone();
        beginning.iter().for_each(|&env| self.episodes[env].phase = Phase::Running);
        ended.iter().for_each(|ended| self.episodes[ended.env.0].phase = Phase::Ended);
        if self.cfg.autoreset == AutoresetMode::SameStep && !ended.is_empty() {
            let envs: Vec<usize> = ended.iter().map(|ended| ended.env.0).collect();
            self.begin_episodes(&envs)?;
            self.observations = self.observe(&envs)?;
            envs.iter().for_each(|&env| self.episodes[env].phase = Phase::Running);
        }
        Ok(Step {
            observations: self.observations.clone(),
            final_observations,
            rewards,
            terminated,
            truncated,
            info: StepInfo { reward_terms, ended },
        })
    }

    /// Applies the actions and does the physics steps.
    fn apply_actions(&mut self) -> Result<()> {
        let apply = |present: &mut TaskState, again: bool| -> Result<()> {
            let mut first = 0;
            for term in &self.terms.actions {
                let end = first + term.space.len();
                if !again || term.every_physics_step {
                    let columns = present.actions.slice_axis(Axis(1), Slice::from(first..end));
                    let applied = (term.apply)(&mut present.sim, columns);
                    applied.map_err(|e| EnvError::term(TermKind::Action, &term.name, e))?;
                }
                first = end;
            }
            Ok(())
        };
        let present = &mut self.state;
        apply(present, false)?;
        if self.terms.actions.iter().any(|term| term.every_physics_step) {
            present.sim.update(1);
            for _ in 1..self.cfg.decimation {
                apply(present, true)?;
                present.sim.update(1);
            }
        } else {
            present.sim.update(self.cfg.decimation);
        }
        Ok(())
    }

    /// Finds the episodes that end: terminated, truncated, and the first reason of each. No episode ends in an
    /// environment that only begins one in this step.
    #[expect(clippy::type_complexity, reason = "three columns of a step")]
    fn check_terminations(&self) -> Result<(Array1<bool>, Array1<bool>, Vec<Option<EndReason>>)> {
        let n = self.num_envs();
        let (mut terminated, mut truncated) = (Array1::from_elem(n, false), Array1::from_elem(n, false));
        let mut reasons: Vec<Option<EndReason>> = vec![None; n];
        for diverged in self.state.sim.diverged() {
            terminated[diverged.env.0] = true;
            reasons[diverged.env.0] = Some(EndReason::Diverged(diverged.to_string()));
        }
        for env in (0..n).filter(|&env| self.reset_monitor.0.was_reset(env)) {
            truncated[env] = true;
            reasons[env].get_or_insert(EndReason::Reset);
        }
        for term in &self.terms.terminations {
            for (env, _) in term.evaluate(&self.context())?.indexed_iter().filter(|(_, ends)| **ends) {
                if term.truncates {
                    truncated[env] = true
                } else {
                    terminated[env] = true
                }
                reasons[env].get_or_insert_with(|| EndReason::Term(term.name.clone()));
            }
        }
        for (env, steps) in self.state.episode_steps.iter().enumerate() {
            if self.cfg.episode_steps.is_some_and(|limit| *steps >= limit) {
                truncated[env] = true;
                reasons[env].get_or_insert(EndReason::TimeLimit);
            }
        }
        for env in (0..n).filter(|&env| self.episodes[env].phase == Phase::Ended) {
            (terminated[env], truncated[env], reasons[env]) = (false, false, None);
        }
        Ok((terminated, truncated, reasons))
    }

    /// Computes the weighted reward terms, shape (N, reward terms); 0 in environments that only begin an episode in
    /// this step.
    fn compute_rewards(&self) -> Result<Array2<f64>> {
        let mut table = Array2::zeros((self.num_envs(), self.terms.rewards.len()));
        let is_counted = |env: usize| self.episodes[env].phase == Phase::Running;
        for (mut column, term) in table.columns_mut().into_iter().zip(&self.terms.rewards) {
            column.assign(&term.rewards(&self.context(), is_counted)?);
        }
        Ok(table)
    }

    /// Returns the latest observations, computed anew in `envs`.
    fn observe(&mut self, envs: &[usize]) -> Result<Array2<f64>> {
        let mut seen = self.observations.clone();
        let mut first = 0;
        for (k, term) in self.terms.observations.iter().enumerate() {
            let values = term.compute(&self.state.context())?;
            for &env in envs {
                for (column, &value) in values.row(env).iter().enumerate() {
                    let value = term.process(value, &mut self.episodes[env].noise_rngs[k]);
                    if !value.is_finite() {
                        let what = TermKind::Observation.result_label(&term.name);
                        let column = term.columns[column].clone();
                        return Err(EnvError::NotFinite { what, env, column, value });
                    }
                    seen[(env, first + column)] = value;
                }
            }
            first += term.columns.len();
        }
        Ok(seen)
    }

    /// Begins an episode in each of `envs`.
    fn begin_episodes(&mut self, envs: &[usize]) -> Result<()> {
        if envs.is_empty() {
            return Ok(());
        }
        let ids: Vec<EnvId> = envs.iter().map(|&env| EnvId(env)).collect();
        self.state.sim.reset(Some(&ids))?;
        for &env in envs {
            let row = &mut self.episodes[env];
            row.key.episode = row.next_episode;
            row.next_episode += 1;
            let noise = |name: &String| row.key.rng(&format!("observation/{name}"));
            row.noise_rngs = self.terms.observations.iter().map(|term| noise(&term.name)).collect();
            for (next, event) in row.next_event_steps.iter_mut().zip(&self.terms.events) {
                if let EventMode::Interval { steps } = event.mode {
                    *next = draw_interval(row.key, env, &event.name, 0, steps);
                }
            }
            for (term, (name, values)) in self.terms.commands.iter().zip(&mut self.state.commands) {
                let drawn = term.sample(&mut row.key.episode_rng(env, &format!("command/{name}")))?;
                values.row_mut(env).iter_mut().zip(drawn).for_each(|(to, from)| *to = from);
            }
            self.state.episode_steps[env] = 0;
            self.state.actions.row_mut(env).fill(0.0);
            self.state.previous_actions.row_mut(env).fill(0.0);
            self.reward_sums.row_mut(env).fill(0.0);
        }
        self.run_events(envs, |when| when == EventMode::Reset, |event| format!("event/{event}"))?;
        // The monitor also saw the resets of this function, which do not end an episode.
        envs.iter().for_each(|&env| self.reset_monitor.0.clear(env));
        Ok(())
    }

    /// Runs the events that are `due` in `envs`, each with random numbers keyed by `name(event)`.
    fn run_events(
        &mut self,
        envs: &[usize],
        due: impl Fn(EventMode) -> bool,
        name: impl Fn(&str) -> String,
    ) -> Result<()> {
        for event in self.terms.events.iter().filter(|event| due(event.mode)) {
            let what = name(&event.name);
            let mut episode_rngs: Vec<EpisodeRng> =
                envs.iter().map(|&env| self.episodes[env].key.episode_rng(env, &what)).collect();
            (event.apply)(&mut self.state.sim, &mut episode_rngs)
                .map_err(|e| EnvError::term(TermKind::Event, &event.name, e))?;
        }
        Ok(())
    }

    /// Runs the interval events that are due at the present step of the episodes in `envs`.
    fn run_interval_events(&mut self, envs: &[usize]) -> Result<()> {
        for (k, event) in self.terms.events.iter().enumerate() {
            let EventMode::Interval { steps } = event.mode else { continue };
            let mut episode_rngs = Vec::new();
            for &env in envs {
                let (row, now) = (&mut self.episodes[env], self.state.episode_steps[env]);
                if row.next_event_steps[k] == now {
                    row.next_event_steps[k] = now.saturating_add(draw_interval(row.key, env, &event.name, now, steps));
                    episode_rngs.push(row.key.episode_rng(env, &format!("event/{}/{now}", event.name)));
                }
            }
            if !episode_rngs.is_empty() {
                (event.apply)(&mut self.state.sim, &mut episode_rngs)
                    .map_err(|e| EnvError::term(TermKind::Event, &event.name, e))?;
            }
        }
        Ok(())
    }
}

/// Number of steps from step `now` until an interval event is due again, uniform in `low..=high`.
fn draw_interval(key: EpisodeKey, env: usize, event: &str, now: u64, [low, high]: [u64; 2]) -> u64 {
    let share = key.episode_rng(env, &format!("interval/{event}/{now}")).uniform();
    // Rounding may make the product of a share below 1 the whole width.
    low + ((share * (high - low + 1) as f64) as u64).min(high - low)
}

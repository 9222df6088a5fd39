//! Steps of a batch of environments.

use crate::autoreset::AutoresetMode;
use crate::context::TaskState;
use crate::environment::{Env, Phase};
use crate::episode_rng::{EpisodeKey, EpisodeRng};
use crate::error::{EnvError, Result};
use crate::event::EventMode;
use crate::step::{EndReason, EndedEpisode, Step, StepInfo};
use kinetoscope_sim::{EnvId, Error, StepResult, update_until};
use ndarray::{Array1, Array2, ArrayView2, AsArray, Axis, Ix2, Slice};
use std::sync::atomic::{AtomicBool, Ordering};

/// Steps.
impl Env {
    /// Does one step in all environments.
    ///
    /// `actions` has shape (N, columns of [`action_space`](Self::action_space)). Actions beyond their bounds are
    /// clamped.
    ///
    /// If the physics of an environment diverges, its episode terminates with [`EndReason::Diverged`]. Its final
    /// observation and reward are those of its last good state. Other environments are not affected.
    ///
    /// # Errors
    /// - The actions have another shape or are not finite, an environment has no episode, or its episode ended in the
    ///   mode [`AutoresetMode::Disabled`]. Nothing was done then. Actions that [`AutoresetMode::NextStep`] ignores may
    ///   be any number.
    /// - A term fails, or returns an array of another shape or a number that is not finite. The step is then incomplete
    ///   and every environment has to be reset.
    pub fn step<'a>(&mut self, actions: impl AsArray<'a, f64, Ix2>) -> Result<Step> {
        self.checked_step(None, actions.into())
    }

    /// [`step`](Self::step) that another thread can end by setting `stop`, between its physics steps.
    ///
    /// # Errors
    /// Same as [`step`](Self::step), and [`Error::Interrupted`] if `stop` was set before the last physics step. The step is
    /// then incomplete and every environment has to be reset.
    pub fn step_until<'a>(&mut self, stop: &AtomicBool, actions: impl AsArray<'a, f64, Ix2>) -> Result<Step> {
        self.checked_step(Some(stop), actions.into())
    }

    /// A step, which ends with an error once `stop` is set.
    fn checked_step(&mut self, stop: Option<&AtomicBool>, actions: ArrayView2<'_, f64>) -> Result<Step> {
        let actions = self.clamp_actions(actions)?;
        if let Some(env) = self.episodes.iter().position(|row| row.phase == Phase::NoEpisode) {
            return Err(EnvError::ResetFirst { env });
        }
        if self.cfg.autoreset == AutoresetMode::Disabled
            && let Some(env) = self.episodes.iter().position(|row| row.phase == Phase::Ended)
        {
            return Err(EnvError::EpisodeEnded { env });
        }
        let step = self.advance(stop, actions);
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

    fn advance(&mut self, stop: Option<&AtomicBool>, actions: Array2<f64>) -> Result<Step> {
        let n = self.num_envs();
        // Environments that only begin an episode in this step, in the mode `NextStep`. They take part in the physics
        // steps like the others, and are reset afterwards.
        let beginning: Vec<usize> = (0..n).filter(|&env| self.episodes[env].phase == Phase::Ended).collect();
        self.state.previous_actions = std::mem::replace(&mut self.state.actions, actions);
        self.apply_actions(stop)?;
        self.state.episode_steps.iter_mut().for_each(|steps| *steps += 1);
        let (terminated, truncated, reasons) = self.check_terminations()?;
        let reward_terms = self.compute_rewards()?;
        self.reward_sums += &reward_terms;
        // Sums in the order of the terms.
        let rewards = reward_terms.map_axis(Axis(1), |terms| terms.iter().fold(0.0, |sum, reward| sum + reward));
        let result =
            StepResult { rewards: rewards.clone(), terminated: terminated.clone(), truncated: truncated.clone() };
        result.publish(self.state.sim_mut())?;
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
        self.advance_curricula(&ended)?;
        self.draw_due_commands(&going_on)?;
        let running: Vec<usize> = (0..n).filter(|&env| self.episodes[env].phase == Phase::Running).collect();
        self.update_commands(&running)?;
        self.begin_episodes(&beginning)?;
        let all: Vec<usize> = (0..n).collect();
        self.observe(&all)?;
        let begins = self.cfg.autoreset == AutoresetMode::SameStep && !ended.is_empty();
        self.buffers.iter_mut().for_each(|buffers| buffers.set_final(begins));
        beginning.iter().for_each(|&env| self.episodes[env].phase = Phase::Running);
        ended.iter().for_each(|ended| self.episodes[ended.env.0].phase = Phase::Ended);
        if begins {
            let envs: Vec<usize> = ended.iter().map(|ended| ended.env.0).collect();
            self.begin_episodes(&envs)?;
            self.observe(&envs)?;
            envs.iter().for_each(|&env| self.episodes[env].phase = Phase::Running);
        }
        Ok(Step {
            observations: self.buffers[0].values().clone(),
            final_observations: self.buffers[0].final_values().clone(),
            rewards,
            terminated,
            truncated,
            info: StepInfo { reward_terms, ended },
        })
    }

    /// Applies the actions and does the physics steps.
    fn apply_actions(&mut self, stop: Option<&AtomicBool>) -> Result<()> {
        let apply = |present: &mut TaskState, again: bool| -> Result<()> {
            let mut first = 0;
            for term in &self.terms.actions {
                let end = first + term.space.len();
                if !again || term.every_physics_step {
                    let (sim, actions) = present.sim_and_actions();
                    term.apply(sim, actions.slice_axis(Axis(1), Slice::from(first..end)))?;
                }
                first = end;
            }
            Ok(())
        };
        let present = &mut self.state;
        apply(present, false)?;
        if self.terms.actions.iter().any(|term| term.every_physics_step) {
            present.sim_mut().update(1);
            for _ in 1..self.cfg.decimation {
                if stop.is_some_and(|stop| stop.load(Ordering::Relaxed)) {
                    return Err(Error::Interrupted.into());
                }
                apply(present, true)?;
                present.sim_mut().update(1);
            }
        } else if let Some(stop) = stop {
            // In blocks, which cost more than one call for all steps.
            if update_until(present.sim_mut(), stop, self.cfg.decimation) < self.cfg.decimation {
                return Err(Error::Interrupted.into());
            }
        } else {
            present.sim_mut().update(self.cfg.decimation);
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
        for diverged in self.state.sim().diverged() {
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

    /// Observes the environments `envs` in all groups.
    pub(crate) fn observe(&mut self, envs: &[usize]) -> Result<()> {
        let now = self.state.context();
        let mut groups = self.terms.groups.iter().zip(&mut self.buffers);
        groups.try_for_each(|(group, buffers)| buffers.observe(group, &now, envs))
    }

    /// Begins an episode in each of `envs`. The caller observes these environments, and sets their phase.
    pub(crate) fn begin_episodes(&mut self, envs: &[usize]) -> Result<()> {
        if envs.is_empty() {
            return Ok(());
        }
        let ids: Vec<EnvId> = envs.iter().map(|&env| EnvId(env)).collect();
        self.state.sim_mut().reset(Some(&ids))?;
        for &env in envs {
            let row = &mut self.episodes[env];
            row.key.episode = row.next_episode;
            row.next_episode += 1;
            let groups = self.terms.groups.iter().zip(&mut self.buffers);
            groups.for_each(|(group, buffers)| buffers.begin_noise(group, env, row.key));
            for (next, event) in row.next_event_steps.iter_mut().zip(&self.terms.events) {
                if let EventMode::Interval { steps } = event.mode {
                    *next = draw_interval(row.key, env, &event.name, 0, steps);
                }
            }
            self.state.episode_steps[env] = 0;
            self.state.actions.row_mut(env).fill(0.0);
            self.state.previous_actions.row_mut(env).fill(0.0);
            self.reward_sums.row_mut(env).fill(0.0);
            (0..self.terms.commands.len()).try_for_each(|k| self.draw_command(k, env))?;
        }
        self.run_events(envs, |when| when == EventMode::Reset, |event| format!("event/{event}"))?;
        // The monitor also saw the resets of this function, which do not end an episode.
        envs.iter().for_each(|&env| self.reset_monitor.0.clear(env));
        self.update_commands(envs)
    }

    /// Draws the numbers of command `k` in environment `env` at the present step of its episode.
    fn draw_command(&mut self, k: usize, env: usize) -> Result<()> {
        let (term, row, now) = (&self.terms.commands[k], &mut self.episodes[env], self.state.episode_steps[env]);
        let name = &term.name;
        let what = if now == 0 { format!("command/{name}") } else { format!("command/{name}/{now}") };
        let drawn = term.sample(&mut row.key.episode_rng(env, &what))?;
        let command = &mut self.state.commands[k];
        command.drawn.row_mut(env).iter_mut().zip(&drawn).for_each(|(to, from)| *to = *from);
        if !term.is_derived() {
            command.values.row_mut(env).iter_mut().zip(&drawn).for_each(|(to, from)| *to = *from);
        }
        let mut time = row.key.episode_rng(env, &format!("command time/{name}/{now}"));
        row.next_command_steps[k] = now.saturating_add(term.steps_to_next_draw(&mut time, self.state.step_dt()));
        Ok(())
    }

    /// Draws the commands that are due at the present step of the episodes in `envs`.
    fn draw_due_commands(&mut self, envs: &[usize]) -> Result<()> {
        for k in 0..self.terms.commands.len() {
            for &env in envs {
                if self.episodes[env].next_command_steps[k] == self.state.episode_steps[env] {
                    self.draw_command(k, env)?;
                }
            }
        }
        Ok(())
    }

    /// Computes the values of derived commands in the environments `envs`.
    fn update_commands(&mut self, envs: &[usize]) -> Result<()> {
        for k in 0..self.terms.commands.len() {
            let updated =
                self.terms.commands[k].update(&self.state.context(), self.state.commands[k].drawn.view(), envs)?;
            if let Some(updated) = updated {
                let values = &mut self.state.commands[k].values;
                envs.iter().for_each(|&env| values.row_mut(env).assign(&updated.row(env)));
            }
        }
        Ok(())
    }

    /// Sets the curricula of the environments `envs` to their start, with the present seed.
    pub(crate) fn begin_curricula(&mut self, envs: &[usize]) -> Result<()> {
        for (term, (name, values)) in self.terms.curricula.iter().zip(&mut self.state.curricula) {
            for &env in envs {
                let key = EpisodeKey { episode: 0, ..self.episodes[env].key };
                values[env] = term.initial(&mut key.episode_rng(env, &format!("curriculum start/{name}")))?;
            }
        }
        Ok(())
    }

    /// Updates the curricula of environments whose episode ended, except by a reset from outside the task.
    fn advance_curricula(&mut self, ended: &[EndedEpisode]) -> Result<()> {
        let envs: Vec<usize> =
            ended.iter().filter(|ended| ended.reason != EndReason::Reset).map(|ended| ended.env.0).collect();
        if envs.is_empty() {
            return Ok(());
        }
        for (k, term) in self.terms.curricula.iter().enumerate() {
            let what = format!("curriculum/{}", term.name);
            let mut rngs: Vec<EpisodeRng> =
                envs.iter().map(|&env| self.episodes[env].key.episode_rng(env, &what)).collect();
            let next = term.advance(&self.state.context(), &mut rngs, self.state.curricula[k].1.view())?;
            let values = &mut self.state.curricula[k].1;
            envs.iter().zip(next).for_each(|(&env, next)| values[env] = next);
        }
        Ok(())
    }

    /// Runs the events that are `due` in `envs`, each with random numbers keyed by `name(event)`.
    pub(crate) fn run_events(
        &mut self,
        envs: &[usize],
        due: impl Fn(EventMode) -> bool,
        name: impl Fn(&str) -> String,
    ) -> Result<()> {
        for event in self.terms.events.iter().filter(|event| due(event.mode)) {
            let what = name(&event.name);
            let mut episode_rngs: Vec<EpisodeRng> =
                envs.iter().map(|&env| self.episodes[env].key.episode_rng(env, &what)).collect();
            event.apply(&mut self.state, &mut episode_rngs)?;
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
                event.apply(&mut self.state, &mut episode_rngs)?;
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

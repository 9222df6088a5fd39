//! The place of a sensor with its owner: measures when it is due, or when it is read.

use crate::cached::Cached;
use crate::error::SensorError;
use crate::schedule::{Phases, Schedule};
use crate::sensor::Sensor;
use kinetoscope_scene::Requires;
use kinetoscope_scene::SceneState;

/// A sensor, eager or [lazy](crate::SensorCfg::lazy), as an owner keeps it: everything that happens is told to the slot, and
/// the sensor is read through it.
///
/// A sensor that fails is not asked any more; reading says why.
#[derive(Debug)]
pub struct SensorSlot {
    requires: Requires,
    /// When it is due, where it is lazy.
    phases: Option<Phases>,
    /// What there is to measure for a lazy sensor, when each environment was last due, reset or written to.
    kept: Option<SceneState>,
    /// Environments that are due, between updates without meaning: its memory is kept.
    due: Vec<bool>,
    /// The sensor, outdated while it has something to measure: `kept`. Empty where measuring panicked.
    sensor: Cached<Holder>,
}

/// A sensor, and why it is not asked any more.
#[derive(Debug)]
struct Holder {
    sensor: Box<dyn Sensor>,
    fault: Option<SensorError>,
}

impl Holder {
    /// Asks the sensor for something, unless it failed before.
    fn ask(&mut self, act: impl FnOnce(&mut dyn Sensor) -> Result<(), SensorError>) {
        if self.fault.is_none() {
            self.fault = act(self.sensor.as_mut()).err();
        }
    }
}

impl SensorSlot {
    /// A place for a sensor of `num_envs` environments that was built from a configuration which requires `requires`, and is
    /// lazy by `lazy`. It is to be reset before anything else.
    pub fn new(sensor: Box<dyn Sensor>, requires: Requires, lazy: Option<Schedule>, num_envs: usize) -> Self {
        let holder = Holder { sensor, fault: None };
        Self {
            requires,
            phases: lazy.map(|schedule| schedule.phases(num_envs)),
            kept: None,
            due: vec![false; num_envs],
            sensor: Cached::current(holder),
        }
    }

    /// Whether it measures when it is read.
    pub fn is_lazy(&self) -> bool {
        self.phases.is_some()
    }

    /// As [`Sensor::update`]: measures, or keeps what there is to measure.
    pub fn update(&mut self, state: &SceneState) {
        if self.keep(state) {
            return self.wait();
        }
        if let Some(holder) = self.now() {
            holder.ask(|sensor| sensor.update(state));
        }
    }

    /// Keeps the environments that are due, where the sensor is lazy; `false` where it is to measure at once.
    fn keep(&mut self, state: &SceneState) -> bool {
        let (Some(phases), Some(kept)) = (&mut self.phases, &mut self.kept) else { return false };
        // A state of another scene: the sensor will say so.
        if state.num_envs() != self.due.len() {
            return false;
        }
        for (env, due) in self.due.iter_mut().enumerate() {
            *due = phases.is_due(env, state.step[env]);
        }
        kept.take_over(state, &self.due)
    }

    /// From now on the sensor has something to measure, unless it failed.
    fn wait(&mut self) {
        if self.due.contains(&true) && !self.has_failed() {
            self.sensor.invalidate();
        }
    }

    /// As [`Sensor::reset`], at once. What the environments had to measure is gone.
    pub fn reset(&mut self, env_ids: &[usize], state: &SceneState) {
        if let Some(holder) = self.sensor.value_mut() {
            holder.ask(|sensor| sensor.reset(env_ids, state));
            if holder.fault.is_some() {
                return;
            }
        }
        if let Some(phases) = &mut self.phases {
            let known = env_ids.iter().filter(|&&env| env < self.due.len());
            known.filter_map(|&env| Some((env, *state.step.get(env)?))).for_each(|(env, step)| phases.reset(env, step));
        }
        self.keep_written(env_ids, state);
    }

    /// As [`Sensor::refresh`], at once, after what there was to measure was measured.
    pub fn refresh(&mut self, env_ids: &[usize], state: &SceneState) {
        if let Some(holder) = self.now() {
            holder.ask(|sensor| sensor.refresh(env_ids, state));
        }
        self.keep_written(env_ids, state);
    }

    /// Keeps environments that were reset or written to: what was before is never measured again.
    fn keep_written(&mut self, env_ids: &[usize], state: &SceneState) {
        if self.phases.is_none() {
            return;
        }
        self.due.fill(false);
        for &env in env_ids {
            if let Some(written) = self.due.get_mut(env) {
                *written = true;
            }
        }
        let taken = self.kept.as_mut().is_some_and(|kept| kept.take_over(state, &self.due));
        if !taken {
            self.kept = Some(self.requires.part_of(state));
        }
    }

    /// As [`Sensor::due_in`].
    pub fn due_in(&self, step: &[u64]) -> u64 {
        match &self.phases {
            Some(phases) => phases.due_in(step.iter().copied()),
            None => self.sensor.get().map_or(u64::MAX, |holder| holder.sensor.due_in(step)),
        }
    }

    /// Whether it failed, as far as that is known: one that has something to measure may yet fail.
    pub fn has_failed(&self) -> bool {
        match self.sensor.get() {
            Some(holder) => holder.fault.is_some(),
            None => self.sensor.is_empty(),
        }
    }

    /// The sensor, to read: measures what there is to measure.
    ///
    /// # Errors
    ///
    /// Why it failed. A panic of the sensor goes on to who reads first; after that it has failed.
    pub fn sensor(&self) -> Result<&dyn Sensor, &SensorError> {
        // One that panics is lost: its state is not known any more.
        let lost = || Err(&SensorError::BrokenOff);
        let holder = self.sensor.get_or_update(lost, |holder| {
            if let Some(kept) = &self.kept {
                holder.ask(|sensor| sensor.update(kept));
            }
            Ok(())
        })?;
        match holder {
            Holder { fault: None, sensor } => Ok(sensor.as_ref()),
            Holder { fault: Some(fault), .. } => Err(fault),
        }
    }

    /// The sensor, to change: measures first what there is to measure.
    ///
    /// # Errors
    ///
    /// As [`sensor`](Self::sensor).
    pub fn sensor_mut(&mut self) -> Result<&mut dyn Sensor, &SensorError> {
        match self.now() {
            Some(Holder { fault: None, sensor }) => Ok(sensor.as_mut()),
            Some(Holder { fault: Some(fault), .. }) => Err(fault),
            None => Err(&SensorError::BrokenOff),
        }
    }

    /// The sensor with nothing to measure.
    fn now(&mut self) -> Option<&mut Holder> {
        // Its fault is returned by the next read.
        let _ = self.sensor();
        self.sensor.value_mut()
    }
}

#[cfg(test)]
mod tests;

//! Owner of a sensor: measures when the sensor is due, or when it is read.

use crate::cached::Cached;
use crate::error::SensorError;
use crate::schedule::{Phases, Schedule};
use crate::sensor::Sensor;
use kinetoscope_scene::SceneState;
use kinetoscope_scene::StateFields;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// An eager or [lazy](crate::SensorCfg::lazy) sensor in its owner. The owner forwards all updates, resets and refreshes
/// to the slot, and reads the sensor through it.
///
/// After an error, the sensor no longer gets states; reading returns the error. The methods that forward a state
/// therefore return no errors.
#[derive(Debug)]
pub struct SensorSlot {
    requires: StateFields,
    /// Step counters of a lazy sensor; `None` for an eager sensor.
    phases: Option<Phases>,
    /// Stored state of a lazy sensor: each environment as of its last due step, reset or write. `None` for an eager
    /// sensor, or before the first state.
    stored_state: Option<SceneState>,
    /// Environments that are due. Only used within an update, kept for its memory.
    due: Vec<bool>,
    /// The sensor, outdated while the stored state is not measured yet.
    sensor: Cached<SensorAndError>,
}

/// A sensor, and the error after which it is not called any more.
#[derive(Debug)]
struct SensorAndError {
    sensor: Box<dyn Sensor>,
    error: Option<SensorError>,
}

impl SensorAndError {
    /// Calls the sensor, unless it failed before. A panic is an error of this sensor: the others are called, too.
    fn call(&mut self, act: impl FnOnce(&mut dyn Sensor) -> Result<(), SensorError>) {
        if self.error.is_none() {
            let sensor = self.sensor.as_mut();
            self.error = match catch_unwind(AssertUnwindSafe(|| act(sensor))) {
                Ok(result) => result.err(),
                Err(panic) => Some(SensorError::Panicked { message: message_of(panic.as_ref()) }),
            };
        }
    }
}

/// Message of a panic.
fn message_of(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_string());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into())
}

/// Error of a slot without a sensor, which no call leaves behind.
static NO_SENSOR: SensorError = SensorError::Panicked { message: String::new() };

impl SensorSlot {
    /// Creates a slot for a sensor of `num_envs` environments. `requires` are the requirements of its configuration;
    /// `lazy` is the schedule of a lazy sensor, `None` for an eager one. All environments must be reset before any
    /// other call.
    pub fn new(sensor: Box<dyn Sensor>, requires: StateFields, lazy: Option<Schedule>, num_envs: usize) -> Self {
        let holder = SensorAndError { sensor, error: None };
        Self {
            requires,
            phases: lazy.map(|schedule| schedule.phases(num_envs)),
            stored_state: None,
            due: vec![false; num_envs],
            sensor: Cached::current(holder),
        }
    }

    /// True if the sensor measures when it is read.
    pub fn is_lazy(&self) -> bool {
        self.phases.is_some()
    }

    /// Forwards [`Sensor::update`]: measures, or stores the state to measure.
    pub fn update(&mut self, state: &SceneState) {
        if self.store_due(state) {
            return self.invalidate_if_due();
        }
        if let Some(holder) = self.up_to_date() {
            holder.call(|sensor| sensor.update(state));
        }
    }

    /// Stores the environments that are due if the sensor is lazy; returns false if it must measure at once.
    fn store_due(&mut self, state: &SceneState) -> bool {
        let (Some(phases), Some(kept)) = (&mut self.phases, &mut self.stored_state) else { return false };
        // The sensor reports a state of another scene as an error.
        if state.num_envs() != self.due.len() {
            return false;
        }
        for (env, due) in self.due.iter_mut().enumerate() {
            *due = phases.is_due(env, state.step[env]);
        }
        kept.copy_envs_from(state, &self.due)
    }

    /// Marks the sensor as outdated if an environment is due, unless the sensor failed.
    fn invalidate_if_due(&mut self) {
        if self.due.contains(&true) && !self.has_failed() {
            self.sensor.invalidate();
        }
    }

    /// Forwards [`Sensor::reset`] at once. Stored states of these environments are dropped without being measured.
    pub fn reset(&mut self, env_ids: &[usize], state: &SceneState) {
        if let Some(holder) = self.sensor.value_mut() {
            holder.call(|sensor| sensor.reset(env_ids, state));
            if holder.error.is_some() {
                return;
            }
        }
        if let Some(phases) = &mut self.phases {
            let known = env_ids.iter().filter(|&&env| env < self.due.len());
            known.filter_map(|&env| Some((env, *state.step.get(env)?))).for_each(|(env, step)| phases.reset(env, step));
        }
        self.store_written(env_ids, state);
    }

    /// Forwards [`Sensor::refresh`] at once, after measuring the stored state.
    pub fn refresh(&mut self, env_ids: &[usize], state: &SceneState) {
        if let Some(holder) = self.up_to_date() {
            holder.call(|sensor| sensor.refresh(env_ids, state));
        }
        self.store_written(env_ids, state);
    }

    /// Replaces the stored states of environments that were reset or written to. Has no effect for an eager sensor.
    fn store_written(&mut self, env_ids: &[usize], state: &SceneState) {
        if self.phases.is_none() {
            return;
        }
        self.due.fill(false);
        for &env in env_ids {
            if let Some(written) = self.due.get_mut(env) {
                *written = true;
            }
        }
        let taken = self.stored_state.as_mut().is_some_and(|kept| kept.copy_envs_from(state, &self.due));
        if !taken {
            self.stored_state = Some(self.requires.part_of(state));
        }
    }

    /// Returns the physics steps until the slot needs its next update. `step` is the step of each environment. For an
    /// eager sensor, this is [`Sensor::due_in`] (`u64::MAX` after an error); for a lazy one, its schedule decides.
    pub fn due_in(&self, step: &[u64]) -> u64 {
        match &self.phases {
            Some(phases) => phases.due_in(step.iter().copied()),
            None => match self.sensor.get() {
                Some(SensorAndError { sensor, error: None }) => sensor.due_in(step),
                _ => u64::MAX,
            },
        }
    }

    /// True if the sensor is known to have failed; a stored state that is not measured yet may still fail.
    pub fn has_failed(&self) -> bool {
        match self.sensor.get() {
            Some(holder) => holder.error.is_some(),
            None => self.sensor.is_empty(),
        }
    }

    /// Returns the sensor for reading. A lazy sensor measures its stored state first.
    ///
    /// # Errors
    ///
    /// The error of the sensor, or [`SensorError::Panicked`] if it panicked.
    pub fn sensor(&self) -> Result<&dyn Sensor, &SensorError> {
        let missing = || Err(&NO_SENSOR);
        let holder = self.sensor.get_or_update(missing, |holder| {
            if let Some(kept) = &self.stored_state {
                holder.call(|sensor| sensor.update(kept));
            }
            Ok(())
        })?;
        match holder {
            SensorAndError { error: None, sensor } => Ok(sensor.as_ref()),
            SensorAndError { error: Some(fault), .. } => Err(fault),
        }
    }

    /// Returns the sensor for changes. A lazy sensor measures its stored state first.
    ///
    /// # Errors
    ///
    /// Same as [`sensor`](Self::sensor).
    pub fn sensor_mut(&mut self) -> Result<&mut dyn Sensor, &SensorError> {
        match self.up_to_date() {
            Some(SensorAndError { error: None, sensor }) => Ok(sensor.as_mut()),
            Some(SensorAndError { error: Some(fault), .. }) => Err(fault),
            None => Err(&NO_SENSOR),
        }
    }

    /// Returns the sensor and its error after measuring the stored state.
    fn up_to_date(&mut self) -> Option<&mut SensorAndError> {
        // An error is returned by the next read.
        let _ = self.sensor();
        self.sensor.value_mut()
    }
}

#[cfg(test)]
mod tests;

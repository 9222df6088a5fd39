//! Requirements of a sensor on a state: required fields, and the shapes of the scene that the sensor was built for.

use crate::error::SensorError;
use crate::sensor::SensorContext;
use kinetoscope_scene::StateFields;
use kinetoscope_scene::{SceneState, StateDims};

/// Requirements of a sensor on a state.
#[derive(Clone, Debug)]
pub struct StateRequirements {
    sensor: &'static str,
    requires: StateFields,
    lengths: StateDims,
}

impl StateRequirements {
    /// Creates the requirements of the kind of sensor named `sensor`, for states of the scene of `context`.
    pub fn new(sensor: &'static str, requires: StateFields, context: &SensorContext) -> Self {
        let lengths = StateDims {
            num_envs: context.num_envs,
            bodies: context.bodies.len(),
            joints: context.joints.len(),
            actuators: context.actuators.len(),
            engine_values: context.engine_sensors.iter().map(|s| s.first + s.width).max().unwrap_or(0),
            instances: context.scene.as_ref().map_or(0, |scene| scene.instances().len()),
        };
        Self { sensor, requires, lengths }
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.lengths.num_envs
    }

    /// Checks that a state has the required fields, with the shapes of the scene.
    ///
    /// # Errors
    ///
    /// [`SensorError::MissingFields`] or [`SensorError::WrongShape`].
    pub fn check(&self, state: &SceneState) -> Result<(), SensorError> {
        let missing = self.requires.without(StateFields::present_in(state));
        if !missing.is_empty() {
            return Err(SensorError::MissingFields { sensor: self.sensor, missing });
        }
        let of_contacts = state.contacts.as_ref().map(|contacts| contacts.first.len().saturating_sub(1));
        let found = [state.step.len(), state.time.len(), state.force_time.len()].into_iter().chain(of_contacts);
        let other_count = found.map(|found| ("environments", self.num_envs(), found)).find(|(_, n, found)| n != found);
        match other_count.or_else(|| state.misfit(self.requires, &self.lengths)) {
            Some((what, expected, found)) => Err(SensorError::WrongShape { what, expected, found }),
            None => Ok(()),
        }
    }

    /// Checks indices of environments.
    ///
    /// # Errors
    ///
    /// [`SensorError::IndexOutOfRange`].
    pub fn check_envs(&self, env_ids: &[usize]) -> Result<(), SensorError> {
        match env_ids.iter().find(|&&env| env >= self.num_envs()) {
            Some(&index) => Err(SensorError::IndexOutOfRange { what: "environment", index, count: self.num_envs() }),
            None => Ok(()),
        }
    }
}

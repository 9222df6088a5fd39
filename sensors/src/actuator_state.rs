//! Actuator state sensor: controls, forces and activations.

use crate::error::SensorError;
use crate::sampling::{SampleChannel, Sampled, Sampler, SamplingCfg, Stamp};
use crate::schedule::Schedule;
use crate::select::{Selection, at_least_one, read_columns, select_or_all};
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use crate::summary;
use kinetoscope_scene::SceneState;
use kinetoscope_scene::StateFields;
use ndarray::{ArrayView2, ArrayView3};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Configuration of an [`ActuatorState`] sensor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ActuatorStateCfg {
    /// Name patterns of the actuators to measure, in the order they are reported; `None` measures all. The drive of a
    /// joint of a robot or articulation is named `uid/joint`, an actuator of an MJCF file `uid/actuator`. The part
    /// after the first slash is enough.
    pub actuators: Option<Vec<String>>,
    /// Rate, history, latency, dropout and noise; the channels are `controls`, `forces` and `activations`.
    pub sampling: SamplingCfg,
}

/// Controls, forces and activations of actuators in all environments. [`Sampled`] gives their stamps and counts.
#[derive(Clone, Debug)]
pub struct ActuatorState {
    actuators: Vec<usize>,
    names: Vec<String>,
    sampler: Sampler,
}

impl SensorCfg for ActuatorStateCfg {
    type Sensor = ActuatorState;

    fn requires(&self) -> StateFields {
        StateFields::ACTUATORS
    }

    fn lazy(&self, dt: f64) -> Option<Schedule> {
        self.sampling.lazy_schedule(dt)
    }

    /// # Errors
    ///
    /// A pattern that matches nothing, an actuator that two patterns match, an empty selection, or an invalid sampling
    /// configuration.
    fn build(&self, context: &SensorContext) -> Result<ActuatorState, SensorError> {
        let all = &context.actuators;
        let actuators = select_or_all(self.actuators.as_deref(), all, "actuator")?;
        at_least_one(
            actuators.len(),
            Selection { sensor: "actuator state", field: "actuators", what: "actuator" },
            all,
        )?;
        // No unit: each actuator of an MJCF file has its own.
        let channel = |name| SampleChannel::new(name, actuators.len());
        let channels = [channel("controls"), channel("forces").with_stamp(Stamp::Force), channel("activations")];
        Ok(ActuatorState {
            names: actuators.iter().map(|&actuator| all[actuator].clone()).collect(),
            actuators,
            sampler: Sampler::new("actuator state", self.requires(), context, &self.sampling, &channels)?,
        })
    }
}

/// Writes the measurement of environment `env` to `row`.
fn read(actuators: &[usize], state: &SceneState, env: usize, row: &mut [f64]) {
    let fields = [&state.actuator_controls, &state.actuator_forces, &state.actuator_activations];
    read_columns(fields, actuators, env, row);
}

impl Sensor for ActuatorState {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.sampler.update(state, |env, row| read(&self.actuators, state, env, row))
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.reset(env_ids, state, |env, row| read(&self.actuators, state, env, row))
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.refresh(env_ids, state, |env, row| read(&self.actuators, state, env, row))
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.sampler.due_in(step)
    }

    fn sampled(&self) -> Option<&dyn Sampled> {
        Some(self)
    }
}

/// Writes a summary of several lines.
impl fmt::Display for ActuatorState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        summary::write_sampled(f, "Actuator state", &self.sampler, &[("actuators", &summary::list(&self.names))])
    }
}

impl Sampled for ActuatorState {
    fn sampler(&self) -> &Sampler {
        &self.sampler
    }

    fn columns(&self) -> &[String] {
        &self.names
    }
}

impl ActuatorState {
    /// Names of the actuators, in the order of the sensor's columns.
    pub fn actuator_names(&self) -> &[String] {
        &self.names
    }

    /// Controls (inputs) of the actuators, shape \[num_envs, actuators\]. For a drive, its position target \[rad or
    /// m\]. For an actuator of an MJCF file, its control in the unit of the file, before clamping to `ctrlrange`.
    pub fn controls(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("controls")
    }

    /// Forces of the actuators, shape \[num_envs, actuators\]. For a drive, the effort of the last step \[N m or N\]: 0
    /// after a reset, unchanged by a write. For an actuator of an MJCF file, the force in the unit of the file, before
    /// the gear. After a step, both belong to [`Sampled::force_stamps`].
    pub fn forces(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("forces")
    }

    /// Activations, shape \[num_envs, actuators\]; 0 for actuators without activation.
    pub fn activations(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("activations")
    }

    /// History of the controls, newest first, shape \[num_envs, history_length, actuators\]; 0 where not filled yet.
    pub fn control_history(&self) -> ArrayView3<'_, f64> {
        self.sampler.history("controls")
    }

    /// History of the forces, newest first, shape \[num_envs, history_length, actuators\]; 0 where not filled yet.
    pub fn force_history(&self) -> ArrayView3<'_, f64> {
        self.sampler.history("forces")
    }
}

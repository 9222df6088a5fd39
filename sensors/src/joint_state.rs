//! Joint state sensor: positions, velocities and efforts of joints.
//!
//! This file is the template of a sensor with a sampler: configuration, channels, reading of one environment, and
//! accessors.

use crate::error::SensorError;
use crate::sampling::{SampleChannel, Sampled, Sampler, SamplingCfg, Stamp};
use crate::schedule::Schedule;
use crate::select::{Selection, at_least_one, read_columns, select_or_all};
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use crate::summary;
use kinetoscope_scene::SceneState;
use kinetoscope_scene::StateFields;
use ndarray::{ArrayView1, ArrayView2, ArrayView3};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Configuration of a [`JointState`] sensor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct JointStateCfg {
    /// Name patterns of the joints to measure (`uid/joint`, or `joint` alone), in the order they are reported; `None`
    /// measures all. These are the movable joints of robots and articulations, and the hinge and slide joints of MJCF
    /// files.
    pub joints: Option<Vec<String>>,
    /// Rate, history, latency, dropout and noise; the channels are `positions`, `velocities` and `efforts`.
    pub sampling: SamplingCfg,
}

/// Positions, velocities and efforts of joints in all environments; [`Sampled`] gives their stamps and counts.
#[derive(Clone, Debug)]
pub struct JointState {
    joints: Vec<usize>,
    names: Vec<String>,
    sampler: Sampler,
}

impl SensorCfg for JointStateCfg {
    type Sensor = JointState;

    fn requires(&self) -> StateFields {
        StateFields::JOINT_STATE | StateFields::JOINT_EFFORTS
    }

    fn lazy(&self, dt: f64) -> Option<Schedule> {
        self.sampling.lazy_schedule(dt)
    }

    /// # Errors
    ///
    /// A pattern that matches nothing, a joint that two patterns match, an empty list of patterns, or an invalid
    /// sampling configuration. `None` in a scene without joints is valid: the sensor then has no columns.
    fn build(&self, context: &SensorContext) -> Result<JointState, SensorError> {
        let joints = select_or_all(self.joints.as_deref(), &context.joints, "joint")?;
        if self.joints.is_some() {
            at_least_one(
                joints.len(),
                Selection { sensor: "joint state", field: "joints", what: "joint" },
                &context.joints,
            )?;
        }
        let channels = [
            SampleChannel::new("positions", joints.len()).with_unit("rad or m"),
            SampleChannel::new("velocities", joints.len()).with_unit("rad/s or m/s"),
            SampleChannel::new("efforts", joints.len()).with_unit("N m or N").with_stamp(Stamp::Force),
        ];
        Ok(JointState {
            names: joints.iter().map(|&joint| context.joints[joint].clone()).collect(),
            joints,
            sampler: Sampler::new("joint state", self.requires(), context, &self.sampling, &channels)?,
        })
    }
}

/// Writes the measurement of environment `env` to `row`.
fn read(joints: &[usize], state: &SceneState, env: usize, row: &mut [f64]) {
    let fields = [&state.joint_positions, &state.joint_velocities, &state.joint_efforts];
    read_columns(fields, joints, env, row);
}

impl Sensor for JointState {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.sampler.update(state, |env, row| read(&self.joints, state, env, row))
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.reset(env_ids, state, |env, row| read(&self.joints, state, env, row))
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.refresh(env_ids, state, |env, row| read(&self.joints, state, env, row))
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.sampler.due_in(step)
    }

    fn sampled(&self) -> Option<&dyn Sampled> {
        Some(self)
    }
}

/// Writes a summary of several lines.
impl fmt::Display for JointState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        summary::write_sampled(f, "Joint state", &self.sampler, &[("joints", &summary::list(&self.names))])
    }
}

impl Sampled for JointState {
    fn sampler(&self) -> &Sampler {
        &self.sampler
    }

    fn columns(&self) -> &[String] {
        &self.names
    }
}

impl JointState {
    /// Indices of the measured joints on the joint axis of [`SceneState`], in the order of the sensor's columns.
    pub fn joints(&self) -> &[usize] {
        &self.joints
    }

    /// Names of the joints, `uid/joint`, in the order of the sensor's columns.
    pub fn joint_names(&self) -> &[String] {
        &self.names
    }

    /// Positions \[rad or m\], shape \[num_envs, joints\]; 0 before the first measurement or reset.
    pub fn positions(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("positions")
    }

    /// Velocities \[rad/s or m/s\], shape \[num_envs, joints\]; 0 before the first measurement or reset.
    pub fn velocities(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("velocities")
    }

    /// Efforts of the drives or actuators on the joints in the last step \[N m or N\], shape \[num_envs, joints\],
    /// captured at [`effort_stamps`](Self::effort_stamps): see [`SceneState::joint_efforts`]. 0 before the first
    /// measurement or reset.
    pub fn efforts(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("efforts")
    }

    /// Capture times of the efforts since the last reset \[s\], shape \[num_envs\]: see [`SceneState::force_time`].
    pub fn effort_stamps(&self) -> ArrayView1<'_, f64> {
        self.force_stamps()
    }

    /// History of the positions \[rad or m\], newest first, shape \[num_envs, history_length, joints\]; 0 where not
    /// filled yet.
    pub fn position_history(&self) -> ArrayView3<'_, f64> {
        self.sampler.history("positions")
    }

    /// History of the velocities \[rad/s or m/s\], newest first, shape \[num_envs, history_length, joints\]; 0 where
    /// not filled yet.
    pub fn velocity_history(&self) -> ArrayView3<'_, f64> {
        self.sampler.history("velocities")
    }

    /// History of the efforts \[N m or N\], newest first, shape \[num_envs, history_length, joints\]; 0 where not
    /// filled yet.
    pub fn effort_history(&self) -> ArrayView3<'_, f64> {
        self.sampler.history("efforts")
    }
}

#[cfg(test)]
mod tests;
